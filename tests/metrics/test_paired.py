"""Geodesic and position errors against the true answer."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadInput
from bench.metrics.dtw import Backend
from bench.metrics.paired import paired_errors, position_errors_cm, rotation_errors_deg
from bench.motion.quat import about_y, angle_between, multiply, normalise

IDENTITY = about_y(0.0)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def rotations(shape: tuple[int, ...], rng: np.random.Generator) -> FloatArray:
    return normalise(rng.standard_normal((*shape, 4)))


def test_rotation_errors_by_hand() -> None:
    angles = np.radians([0.0, 1e-6, 30.0, 90.0, 179.999999, 270.0])
    measured = rotation_errors_deg(np.tile(IDENTITY, (1, 6, 1)), about_y(angles)[None])
    assert measured[0] == pytest.approx([0.0, 1e-6, 30.0, 90.0, 179.999999, 90.0], rel=1e-9, abs=1e-12)


def test_rotation_errors_agree_with_the_motion_core(rng: np.random.Generator) -> None:
    true, output = rotations((7, 21), rng), rotations((7, 21), rng)
    assert rotation_errors_deg(true, output) == pytest.approx(np.degrees(angle_between(true, output)))


def test_rotation_errors_ignore_signs_order_and_a_common_turn(rng: np.random.Generator) -> None:
    true, output = rotations((5, 3), rng), rotations((5, 3), rng)
    errors = rotation_errors_deg(true, output)
    assert rotation_errors_deg(-true, output) == pytest.approx(errors)
    assert rotation_errors_deg(output, true) == pytest.approx(errors)
    turn = np.broadcast_to(about_y(1.0), true.shape)
    assert rotation_errors_deg(multiply(turn, true), multiply(turn, output)) == pytest.approx(errors)
    assert np.all(rotation_errors_deg(true, true) == 0.0)


def test_rounding_of_quaternion_lengths_is_no_error(rng: np.random.Generator) -> None:
    true = rotations((5, 3), rng)
    assert rotation_errors_deg(true, 1.0005 * true) == pytest.approx(np.zeros((5, 3)), abs=1e-9)


def test_position_errors_by_hand() -> None:
    true, output = np.zeros((1, 2, 3)), np.zeros((1, 2, 3))
    output[0, 1] = 0.03, 0.0, 0.04
    assert position_errors_cm(true, output).tolist() == [[0.0, pytest.approx(5.0)]]
    assert position_errors_cm(output + 9.0, true + 9.0) == pytest.approx(position_errors_cm(true, output))


def test_position_errors_ignore_order_and_grow_with_the_fault(rng: np.random.Generator) -> None:
    true, noise = rng.standard_normal((5, 3, 3)), rng.standard_normal((5, 3, 3))
    assert np.all(position_errors_cm(true, true) == 0.0)
    assert position_errors_cm(true + noise, true) == pytest.approx(position_errors_cm(true, true + noise))
    means = [position_errors_cm(true, true + scale * noise).mean() for scale in (0.1, 0.2, 0.8)]
    assert means[1] == pytest.approx(2.0 * means[0]) and means[2] == pytest.approx(8.0 * means[0])


def motion(frames: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    return rotations((frames, 4), rng), rng.standard_normal((frames, 4, 3))


def test_the_true_answer_has_no_error(rng: np.random.Generator) -> None:
    turns, places = motion(20, rng)
    errors = paired_errors(turns, turns, places, places)
    assert (errors.rotation_deg, errors.position_cm) == (0.0, 0.0)
    assert (errors.aligned_rotation_deg, errors.aligned_position_cm) == (0.0, 0.0)


def test_all_four_errors_by_hand() -> None:
    """One joint. True places 0, 0, 1 m, output 0, 1, 1 m and 2 cm higher; the path pairs 0-0, 1-0, 2-1, 2-2.

    Frame by frame the second frame is 1 m off besides. True turns 0, 10, 0 degrees, output 0, 0, 30: exact
    (0 + 10 + 30) / 3, along the path (0 + 10 + 0 + 30) / 4.
    """
    true_places, output_places = np.zeros((3, 1, 3)), np.zeros((3, 1, 3))
    true_places[2, 0, 0] = output_places[1:, 0, 0] = 1.0
    output_places[:, 0, 1] = 0.02
    true_turns = about_y(np.radians([[0.0], [10.0], [0.0]]))
    output_turns = about_y(np.radians([[0.0], [0.0], [30.0]]))
    errors = paired_errors(true_turns, output_turns, true_places, output_places)
    assert errors.position_cm == pytest.approx((2.0 + 100.02 + 2.0) / 3.0, rel=1e-6)
    assert errors.rotation_deg == pytest.approx(40.0 / 3.0)
    assert errors.aligned_position_cm == pytest.approx(2.0)
    assert errors.aligned_rotation_deg == pytest.approx(10.0)


def test_aligned_errors_forgive_tempo_and_exact_ones_need_equal_length(rng: np.random.Generator) -> None:
    turns, places = motion(15, rng)
    errors = paired_errors(turns, np.repeat(turns, 2, axis=0), places, np.repeat(places, 2, axis=0))
    assert np.isnan(errors.rotation_deg) and np.isnan(errors.position_cm)
    assert (errors.aligned_rotation_deg, errors.aligned_position_cm) == (0.0, 0.0)


def test_errors_grow_with_the_fault(rng: np.random.Generator) -> None:
    turns, places = motion(15, rng)
    noise = rng.standard_normal(places.shape)
    found = [
        paired_errors(turns, multiply(np.broadcast_to(about_y(x), turns.shape), turns), places, places + x * noise)
        for x in (0.0, 0.01, 0.1, 0.3)
    ]
    for values in zip(*((e.rotation_deg, e.position_cm, e.aligned_position_cm) for e in found), strict=True):
        assert list(values) == sorted(values) and values[0] == pytest.approx(0.0, abs=1e-5) and values[1] > 0.1


def test_argument_order_does_not_matter_for_cost_free_alignments(rng: np.random.Generator) -> None:
    turns, places = motion(15, rng)
    other_turns, other_places = motion(15, rng)
    there = paired_errors(turns, other_turns, places, other_places)
    back = paired_errors(other_turns, turns, other_places, places)
    assert back.rotation_deg == pytest.approx(there.rotation_deg)
    assert back.aligned_position_cm == pytest.approx(there.aligned_position_cm)


TURNS, PLACES = np.tile(IDENTITY, (4, 2, 1)), np.zeros((4, 2, 3))


@pytest.mark.parametrize("bad", [TURNS[:0], TURNS[0], np.full((4, 2, 4), np.nan), 2.0 * TURNS, np.zeros((4, 2, 4))])
def test_refuses_what_are_no_rotations(bad: FloatArray) -> None:
    for function in (rotation_errors_deg, lambda a, b: paired_errors(a, b, PLACES, PLACES)):
        with pytest.raises(BadInput, match="true_rotations_wxyz"):
            function(bad, TURNS)
        with pytest.raises(BadInput, match="output_rotations_wxyz"):
            function(TURNS, bad)


def test_refuses_a_single_bad_quaternion() -> None:
    bad = TURNS.copy()
    bad[2, 1] *= 1.1
    with pytest.raises(BadInput, match="output_rotations_wxyz"):
        rotation_errors_deg(TURNS, bad)


@pytest.mark.parametrize("bad", [PLACES[:0], PLACES[0], np.full((4, 2, 3), np.nan), np.zeros((4, 2, 2))])
def test_refuses_what_are_no_positions(bad: FloatArray) -> None:
    for function in (position_errors_cm, lambda a, b: paired_errors(TURNS, TURNS, a, b)):
        with pytest.raises(BadInput, match="true_positions_m"):
            function(bad, PLACES)
        with pytest.raises(BadInput, match="output_positions_m"):
            function(PLACES, bad)


def test_refuses_an_unknown_backend() -> None:
    with pytest.raises(BadConfig, match="backend"):
        paired_errors(TURNS, TURNS, PLACES, PLACES, cast(Backend, "slow"))


def test_refuses_different_lengths_and_skeletons() -> None:
    with pytest.raises(BadInput, match="output_rotations_wxyz"):
        rotation_errors_deg(TURNS, TURNS[:3])
    with pytest.raises(BadInput, match="output_positions_m"):
        position_errors_cm(PLACES, PLACES[:1])
    with pytest.raises(BadInput, match="output_rotations_wxyz"):
        paired_errors(TURNS, TURNS[:, :1], PLACES, PLACES)
    with pytest.raises(BadInput, match="true_positions_m"):
        paired_errors(TURNS, TURNS, PLACES[:2], PLACES)
    with pytest.raises(BadInput, match="output_positions_m"):
        paired_errors(TURNS, TURNS, PLACES, PLACES[:2])
