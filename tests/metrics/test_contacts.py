"""Feet and the floor: worked out by hand on simple feet, invariances, monotone in the fault, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics.contacts import (
    contact_timing,
    estimated_floor,
    float_height,
    foot_skate,
    penetration,
    planted,
    skate_gmd,
)

FPS = 30.0


def sliding_foot(speed_m_s: float, height_m: float = 0.0, n_frames: int = 31) -> FloatArray:
    """Joint 0 a root overhead, joint 1 a foot that slides along x at ``height_m``, joint 2 one that stands on 0."""
    positions = np.zeros((1, n_frames, 3, 3))
    positions[0, :, 0, 1] = 1.0
    positions[0, :, 1, 0] = speed_m_s * np.arange(n_frames) / FPS
    positions[0, :, 1, 1] = height_m
    return positions


def turned(positions: FloatArray, yaw_rad: float) -> FloatArray:
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(positions @ np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]]))


def elsewhere(positions: FloatArray) -> FloatArray:
    return np.asarray(turned(positions, 1.2) + np.array([3.0, 0.0, -4.0]))


def test_foot_skate_by_hand() -> None:
    np.testing.assert_allclose(foot_skate(sliding_foot(0.4), FPS, [1]), 40.0)
    np.testing.assert_allclose(foot_skate(sliding_foot(0.4), 2 * FPS, [1]), 80.0)
    both = sliding_foot(0.4)
    both[0, :, 2, 0] = -0.5 * both[0, :, 1, 0]
    np.testing.assert_allclose(foot_skate(both, FPS, [1, 2]), 20.0)
    assert (np.diff([foot_skate(sliding_foot(v), FPS, [1])[0] for v in (0.0, 0.2, 5.0)]) > 0).all()


def test_a_foot_that_swings_past_a_standing_one_does_not_skate() -> None:
    np.testing.assert_array_equal(foot_skate(sliding_foot(2.0, height_m=0.02), FPS, [1, 2]), 0.0)
    lifted = sliding_foot(0.4)
    lifted[0, 16:, 2, 1] = 0.2
    # The standing foot holds the body for 15 of the 30 steps; over the others the sliding one does.
    np.testing.assert_allclose(foot_skate(lifted, FPS, [1, 2]), 20.0)


def test_contact_holds_between_its_two_heights() -> None:
    positions = sliding_foot(0.3, n_frames=40)
    positions[0, :, 1, 1] = np.repeat([0.10, 0.04, 0.0, 0.04], 10)
    positions[0, 3:, 2, 1] = 1.0
    # Coming down at 4 cm is no contact; going up it still is: 19 steps slide. The other foot stands for the first 2.
    np.testing.assert_allclose(foot_skate(positions, FPS, [1, 2]), 30.0 * 19 / (19 + 2))


@pytest.mark.parametrize(("height_m", "touches"), [(0.029, True), (0.031, False)])
def test_contact_begins_at_its_height(height_m: float, touches: bool) -> None:
    feet = planted(sliding_foot(0.0, height_m=height_m), FPS, [1, 2])
    assert feet[0, :, 0].all() == touches == feet[0, :, 0].any()


@pytest.mark.parametrize(("height_m", "touches"), [(0.049, True), (0.051, False)])
def test_contact_ends_at_its_height(height_m: float, touches: bool) -> None:
    positions = sliding_foot(0.0)
    positions[0, 10:, 1, 1] = height_m
    assert planted(positions, FPS, [1, 2])[0, 10:, 0].all() == touches


def test_no_contact_is_nan() -> None:
    positions = sliding_foot(0.3, n_frames=2)
    positions[0, :, 1, 1] = [0.0, 1.0]
    assert np.isnan(foot_skate(positions, FPS, [1])).all()


def test_skate_gmd_by_hand() -> None:
    # At 20 fps 20 steps of 5 cm; zeros beyond the ends leave averages of 0.6, 0.8, 1, ... m/s, all over 0.5.
    np.testing.assert_allclose(skate_gmd(sliding_foot(1.0), FPS, [1, 2]), 100.0)
    np.testing.assert_allclose(skate_gmd(sliding_foot(0.49), FPS, [1, 2]), 0.0)
    np.testing.assert_allclose(skate_gmd(sliding_foot(1.0, height_m=0.06), FPS, [1, 2]), 0.0)
    # At 0.6 m/s the averages at the ends are 0.36 and 0.48: two steps at each end do not count.
    np.testing.assert_allclose(skate_gmd(sliding_foot(0.6), FPS, [1, 2]), 100.0 * 16 / 20)


def test_skate_gmd_is_of_twenty_frames_a_second() -> None:
    fast, slow = (sliding_foot(0.6 * FPS / fps, n_frames=n) for fps, n in ((60.0, 61), (20.0, 21)))
    for positions, fps in ((slow, 20.0), (sliding_foot(0.6), 30.0), (fast, 60.0)):
        np.testing.assert_allclose(skate_gmd(positions, fps, [1]), 80.0)


def test_skate_gmd_at_its_thresholds() -> None:
    """A frame skates over 0.5 m/s, now and on average over 5 (0.5 at the ends), under 5 cm now and before."""
    for speeds, share in (([1.0, 1.0, 0.5, 1.0, 1.0], 40.0), ([0.0, 0.5, 1.0, 0.5, 0.5], 0.0)):
        positions = np.zeros((1, 6, 1, 3))
        positions[0, 1:, 0, 0] = np.cumsum(speeds) / 20.0
        np.testing.assert_allclose(skate_gmd(positions, 20.0, [0]), share)
    positions = sliding_foot(30.0 / 20.0, n_frames=21)
    positions[0, 10:, 1, 1] = 0.05
    np.testing.assert_allclose(skate_gmd(positions, 20.0, [1]), 100.0 * 9 / 20)


def test_floor_penetration_and_float() -> None:
    positions = sliding_foot(0.0, n_frames=100)
    positions[0, :, 1:, 1] = np.repeat([0.10, -0.02], 50)[:, None]
    np.testing.assert_allclose(estimated_floor(positions, [1, 2]), -0.02)
    np.testing.assert_allclose(penetration(positions, [1, 2]), 1.0)
    np.testing.assert_allclose(float_height(positions, [1, 2]), 5.0)
    np.testing.assert_allclose(penetration(positions, [1, 2], floor_m=0.10), 6.0)
    np.testing.assert_allclose(float_height(positions, [1, 2], floor_m=-0.02), 6.0)
    positions[0, 0, 1, 1] = -5.0
    assert estimated_floor(positions, [1, 2])[0] > -0.05


def test_feet_on_the_floor_are_perfect_and_faults_add_up() -> None:
    still = sliding_foot(0.0)
    for value in (foot_skate(still, FPS, [1, 2]), skate_gmd(still, FPS, [1, 2])):
        assert value.tolist() == [0.0]
    assert penetration(still, [1, 2]).tolist() == float_height(still, [1, 2]).tolist() == [0.0]
    heights = (0.0, 0.01, 0.05, 0.2)
    deep = [penetration(sliding_foot(0.0, height_m=-h), [1])[0] for h in heights]
    high = [float_height(sliding_foot(0.0, height_m=h), [1])[0] for h in heights]
    np.testing.assert_allclose(deep, high)
    np.testing.assert_allclose(deep, [0.0, 1.0, 5.0, 20.0])
    shares = []
    for frames in (0, 10, 30):
        positions = sliding_foot(1.0)
        positions[0, frames:, 1, 0] = positions[0, frames, 1, 0]
        shares.append(skate_gmd(positions, FPS, [1, 2])[0])
    assert shares[0] == 0.0 < shares[1] < shares[2]


def test_feet_ignore_where_on_the_floor_and_which_way() -> None:
    positions = sliding_foot(0.8)
    for measure in (skate_gmd, foot_skate):
        np.testing.assert_allclose(measure(elsewhere(positions), FPS, [1]), measure(positions, FPS, [1]))
    sunk = elsewhere(sliding_foot(0.8, height_m=-0.03))
    np.testing.assert_allclose(penetration(sunk, [1]), 3.0)
    np.testing.assert_allclose(estimated_floor(sunk, [1]), -0.03)
    np.testing.assert_allclose(float_height(sunk, [1], floor_m=-0.05), 2.0)
    raised = positions + np.array([0.0, 2.0, 0.0])
    np.testing.assert_allclose(foot_skate(raised, FPS, [1]), 80.0)
    np.testing.assert_array_equal(planted(raised, FPS, [1, 2]), planted(positions, FPS, [1, 2]))


def test_planted_feet_touch_and_are_slow() -> None:
    assert planted(sliding_foot(0.39), FPS, [1, 2]).all()
    np.testing.assert_array_equal(planted(sliding_foot(0.41), FPS, [1, 2]).all(axis=(0, 1)), [False, True])
    assert planted(sliding_foot(0.0, n_frames=8), FPS, [1, 2]).shape == (1, 7, 2)


def contacts(*feet: str) -> np.ndarray[tuple[int, ...], np.dtype[np.bool_]]:
    """One sample ``[1, T, F]`` from a string a foot, ``x`` where it stands."""
    return np.array([[[frame == "x" for frame in foot] for foot in feet]]).swapaxes(1, 2)


def test_contact_timing_by_hand_and_argument_order() -> None:
    source, output = contacts("xxxx....", "....xxxx"), contacts("xx......", "..xxxx..")
    timing = contact_timing(source, output)
    # 2 + 2 frames in common, of 6 of the output and 8 of the source.
    np.testing.assert_allclose(timing.precision, 100.0 * 4 / 6)
    np.testing.assert_allclose(timing.recall, 100.0 * 4 / 8)
    swapped = contact_timing(output, source)
    np.testing.assert_allclose([swapped.precision, swapped.recall], [timing.recall, timing.precision])


def test_contact_timing_of_the_source_is_perfect_and_falls_with_delay() -> None:
    walk = contacts(*(8 * "xxxxx..." for _ in range(2)))
    walk[..., 1] = np.roll(walk[..., 1], 4, axis=1)
    values = [contact_timing(walk, np.roll(walk, delay, axis=1)) for delay in range(4)]
    for side in ("precision", "recall"):
        falling = [float(getattr(timing, side)[0]) for timing in values]
        assert falling[0] == 100.0 and (np.diff(falling) < 0.0).all()
    assert contact_timing(walk[..., ::-1], walk[..., ::-1]).recall.tolist() == [100.0]


def test_contact_timing_without_contacts_is_nan() -> None:
    none, some = contacts("...."), contacts(".xx.")
    assert np.isnan(contact_timing(some, none).precision).all() and contact_timing(some, none).recall.tolist() == [0.0]
    assert np.isnan(contact_timing(none, some).recall).all() and contact_timing(none, some).precision.tolist() == [0.0]


POSITION_FUNCTIONS: list[tuple[Callable[[FloatArray], object], int]] = [
    (lambda p: estimated_floor(p, [1]), 1),
    (lambda p: foot_skate(p, FPS, [1]), 2),
    (lambda p: skate_gmd(p, 20.0, [1]), 2),
    (lambda p: penetration(p, [1]), 1),
    (lambda p: float_height(p, [1]), 1),
    (lambda p: planted(p, FPS, [1]), 2),
]


@pytest.mark.parametrize(("function", "min_frames"), POSITION_FUNCTIONS)
def test_refuses_what_is_no_motion(function: Callable[[FloatArray], object], min_frames: int) -> None:
    motion = np.random.default_rng(0).normal(size=(3, 40, 5, 3))
    function(motion[:, :min_frames])
    broken = motion.copy()
    broken[1, 2, 3, 0] = np.inf
    with pytest.raises(BadInput, match=r"^positions_m: positions_m must be finite, got 1 NaN or Inf"):
        function(broken)
    for shape in ((3, 40, 5), (3, 40, 5, 2), (0, 40, 5, 3), (3, 0, 5, 3)):
        with pytest.raises(BadInput, match=r"^positions_m: positions_m must have shape \[any, any, any, 3\]"):
            function(np.zeros(shape))
    if min_frames > 1:
        with pytest.raises(BadInput, match=f"positions_m must have at least {min_frames} frames, got {min_frames - 1}"):
            function(motion[:, : min_frames - 1])


JOINT_FUNCTIONS: list[Callable[[FloatArray, list[int]], object]] = [
    estimated_floor,
    lambda p, joints: foot_skate(p, FPS, joints),
    lambda p, joints: skate_gmd(p, FPS, joints),
    penetration,
    float_height,
    lambda p, joints: planted(p, FPS, joints),
]


@pytest.mark.parametrize("function", JOINT_FUNCTIONS)
@pytest.mark.parametrize("joints", [[3], [-1], [1, 1], []])
def test_refuses_joints_that_do_not_exist(
    function: Callable[[FloatArray, list[int]], object], joints: list[int]
) -> None:
    with pytest.raises(BadInput, match=r"^joints: joints must be different indices in 0\.\.2"):
        function(sliding_foot(0.1), joints)


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf")])
def test_refuses_a_frame_rate_that_is_none(fps: float) -> None:
    for measure in (foot_skate, skate_gmd, planted):
        with pytest.raises(BadInput, match=r"^fps: fps must be positive"):
            measure(sliding_foot(0.1), fps, [1])


def test_refusals() -> None:
    with pytest.raises(BadInput, match=r"positions_m must last 1/20 s, got 2 frames at 60 fps"):
        skate_gmd(sliding_foot(0.1, n_frames=2), 60.0, [1])
    good = contacts("..x.")
    with pytest.raises(BadInput, match=r"^output_planted: .* match the source's \[1, 4, 1\], got \[1, 3, 1\]"):
        contact_timing(good, good[:, 1:])
    with pytest.raises(BadInput, match=r"source_planted must be booleans \[n, T, F\], got float64 \[1, 4, 1\]"):
        contact_timing(good.astype(np.float64), good)
    with pytest.raises(BadInput, match=r"output_planted must be booleans \[n, T, F\], got bool \[4, 1\]"):
        contact_timing(good, good[0])
