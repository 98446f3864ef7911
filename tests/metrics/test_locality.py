"""Per-joint displacement, index lists and leak ratio of Motion Puzzle's locality test."""

from __future__ import annotations

import itertools
from typing import cast

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadInput
from bench.metrics.locality import TABLE_THRESHOLDS, Alignment, joint_displacement, joints_above, leak_ratio
from bench.metrics.paired import rotation_errors_deg
from bench.motion.quat import about_y
from bench.motion.skeleton import PARTS


@pytest.fixture
def source() -> FloatArray:
    return np.random.default_rng(0).standard_normal((12, 21, 3))


def test_a_copy_of_the_source_moves_nothing(source: FloatArray) -> None:
    assert np.all(joint_displacement(source, source, 1.6) == 0.0)


def test_displacement_by_hand() -> None:
    """Joint 1 is 0.5 m off in one of two frames, stature 2 m: squared (0.25^2) / 2, plain 0.25 / 2."""
    source = np.zeros((2, 3, 3))
    output = source.copy()
    output[1, 1] = 0.3, 0.4, 0.0
    assert joint_displacement(source, output, 2.0) == pytest.approx([0.0, 0.03125, 0.0])
    assert joint_displacement(source, output, 2.0, squared=False) == pytest.approx([0.0, 0.125, 0.0])


def test_displacement_ignores_argument_order_and_scale(source: FloatArray) -> None:
    output = source + np.random.default_rng(1).standard_normal(source.shape)
    measured = joint_displacement(source, output, 1.7)
    assert joint_displacement(output, source, 1.7) == pytest.approx(measured)
    assert joint_displacement(3.0 * source, 3.0 * output, 5.1) == pytest.approx(measured)


def test_displacement_grows_with_the_fault(source: FloatArray) -> None:
    noise = np.random.default_rng(1).standard_normal(source.shape)
    means = [joint_displacement(source, source + scale * noise, 1.6).mean() for scale in (0.0, 0.1, 0.2, 0.8)]
    assert means == sorted(means) and means[0] == 0.0 < means[1]
    assert means[2] == pytest.approx(4.0 * means[1])


def test_alignments(source: FloatArray) -> None:
    """A start elsewhere on the ground is forgiven by "start", a drift of the root by "root" only, height by "root"."""
    shifted = source + np.array([3.0, 0.0, 4.0])
    assert joint_displacement(source, shifted, 1.0, squared=False) == pytest.approx(np.full(21, 5.0))
    assert joint_displacement(source, shifted, 1.0, align="start") == pytest.approx(np.zeros(21), abs=1e-20)
    drifting = source + np.linspace(0.0, 1.0, 12)[:, None, None] * np.array([1.0, 0.0, 0.0])
    assert joint_displacement(source, drifting, 1.0, align="start").min() > 0.1
    assert joint_displacement(source, drifting, 1.0, align="root") == pytest.approx(np.zeros(21), abs=1e-20)
    drifting[:, 5] += np.array([0.0, 0.0, 2.0])
    wanted = np.where(np.arange(21) == 5, 2.0, 0.0)
    assert joint_displacement(source, drifting, 1.0, squared=False, align="root") == pytest.approx(wanted, abs=1e-12)
    lifted = source + np.array([0.0, 2.0, 0.0])
    assert joint_displacement(source, lifted, 1.0, align="start") == pytest.approx(np.full(21, 4.0))


def test_start_is_where_the_root_is_in_the_first_frame() -> None:
    """Root off by 1 m, then 3 m; joint 1 off by 6 m: after the start is taken away 0 and 2 m, and 5 m twice."""
    source = np.zeros((2, 2, 3))
    output = source.copy()
    output[:, 0, 0] = 1.0, 3.0
    output[:, 1, 0] = 6.0
    assert joint_displacement(source, output, 1.0, squared=False, align="start") == pytest.approx([1.0, 5.0])
    assert joint_displacement(source, output, 1.0, squared=False, align="root") == pytest.approx([0.0, 4.0])


def test_lists_of_the_table() -> None:
    displacement = np.zeros(21)
    displacement[[3, 4]] = 0.3
    displacement[[2, 13]] = 0.07
    displacement[5] = 0.1
    assert TABLE_THRESHOLDS == (0.1, 0.05)
    assert joints_above(displacement, 0.1) == (3, 4)
    assert joints_above(displacement, 0.05) == (2, 3, 4, 5, 13)
    assert joints_above(displacement, 0.05, virtual=(4, 13)) == (2, 3, 5)


def test_leak_ratio_by_hand() -> None:
    """Inside mean 3, outside mean 1.5."""
    displacement = [2.0, 4.0, 1.0, 2.0]
    assert leak_ratio(displacement, (0, 1)) == pytest.approx(0.5)
    assert leak_ratio(displacement, (0, 1), virtual=(3,)) == pytest.approx(1.0 / 3.0)
    assert leak_ratio(displacement, (0, 1), virtual=(1,)) == pytest.approx(0.75)
    assert leak_ratio(displacement, (2, 3)) == pytest.approx(2.0)
    assert leak_ratio(3.0 * np.array(displacement), (0, 1)) == pytest.approx(0.5)


def test_lists_grow_with_displacement_and_ignore_what_lies_below() -> None:
    displacement = np.random.default_rng(0).uniform(0.0, 0.2, 21)
    lists = [joints_above(scale * displacement, 0.1) for scale in (0.0, 0.6, 1.0, 9.0)]
    assert lists[0] == () and all(set(a) <= set(b) for a, b in itertools.pairwise(lists))
    assert len(lists[1]) < len(lists[2]) < len(lists[3])
    assert joints_above(np.minimum(displacement, 0.1), 0.1) == ()
    mirrored = joints_above(displacement[::-1], 0.1)
    assert tuple(sorted(20 - joint for joint in mirrored)) == lists[2]


def test_swapping_inside_and_outside_inverts_the_ratio() -> None:
    displacement = np.random.default_rng(1).uniform(0.1, 1.0, 21)
    inside = PARTS["legs"]
    outside = tuple(joint for joint in range(21) if joint not in inside)
    assert leak_ratio(displacement, outside) == pytest.approx(1.0 / leak_ratio(displacement, inside))


def test_a_splice_of_one_part_does_not_leak(source: FloatArray) -> None:
    output = source.copy()
    touched = PARTS["left_arm"]
    output[:, touched] += 0.3
    assert leak_ratio(joint_displacement(source, output, 1.6), touched) == 0.0


def test_a_spine_that_turns_does_not_leak_in_local_rotations() -> None:
    still = np.tile(about_y(0.0), (5, 21, 1))
    output = still.copy()
    output[:, 9] = about_y(0.5)
    assert leak_ratio(rotation_errors_deg(still, output).mean(axis=0), PARTS["spine"]) == 0.0


def test_leak_ratio_grows_with_the_leak() -> None:
    ratios = [leak_ratio([1.0, 1.0, leak, 0.0], (0, 1)) for leak in (0.0, 0.2, 0.5, 3.0)]
    assert ratios == sorted(ratios) and ratios[0] == 0.0 < ratios[1]


def test_leak_ratio_is_undefined_where_nothing_was_touched_or_nothing_is_left() -> None:
    assert np.isnan(leak_ratio(np.zeros(21), PARTS["legs"]))
    assert np.isnan(leak_ratio([0.0, 1.0], (0,)))
    assert np.isnan(leak_ratio(np.ones(21), PARTS["all"]))
    assert np.isnan(leak_ratio(np.ones(3), (0, 1), virtual=(2,)))


GOOD = np.zeros((4, 3, 3))


@pytest.mark.parametrize("bad", [np.zeros((0, 3, 3)), np.zeros((4, 3)), np.full((4, 3, 3), np.nan)])
def test_refuses_what_is_no_motion(bad: FloatArray) -> None:
    with pytest.raises(BadInput, match="source_positions_m"):
        joint_displacement(bad, GOOD, 1.6)
    with pytest.raises(BadInput, match="output_positions_m"):
        joint_displacement(GOOD, bad, 1.6)


@pytest.mark.parametrize("other", [np.zeros((5, 3, 3)), np.zeros((4, 2, 3)), np.zeros((1, 3, 3))])
def test_refuses_motions_of_different_length_or_skeleton(other: FloatArray) -> None:
    with pytest.raises(BadInput, match="output_positions_m"):
        joint_displacement(GOOD, other, 1.6)


@pytest.mark.parametrize("stature_m", [0.0, -1.6, float("nan"), float("inf")])
def test_refuses_a_stature_that_is_none(stature_m: float) -> None:
    with pytest.raises(BadInput, match="stature_m"):
        joint_displacement(GOOD, GOOD, stature_m)


def test_refuses_an_unknown_alignment() -> None:
    with pytest.raises(BadConfig, match="align"):
        joint_displacement(GOOD, GOOD, 1.6, align=cast(Alignment, "best"))


@pytest.mark.parametrize("bad", [[], [[1.0]], [np.nan], [-1.0, 0.0]])
def test_refuses_displacements_that_are_none(bad: list[float]) -> None:
    with pytest.raises(BadInput, match="displacement"):
        leak_ratio(bad, (0,))
    with pytest.raises(BadInput, match="displacement"):
        joints_above(bad, 0.1)


@pytest.mark.parametrize("joint", [-1, 3])
def test_refuses_joints_that_do_not_exist(joint: int) -> None:
    with pytest.raises(BadInput, match="touched"):
        leak_ratio(np.ones(3), (joint,))
    with pytest.raises(BadInput, match="virtual"):
        leak_ratio(np.ones(3), (0,), virtual=(joint,))
    with pytest.raises(BadInput, match="virtual"):
        joints_above(np.ones(3), 0.1, virtual=(joint,))


def test_refuses_a_part_without_real_joints() -> None:
    with pytest.raises(BadInput, match="touched"):
        leak_ratio(np.ones(3), ())
    with pytest.raises(BadInput, match="touched"):
        leak_ratio(np.ones(3), (1,), virtual=(1,))


@pytest.mark.parametrize("threshold", [float("nan"), float("inf"), -0.1])
def test_a_threshold_that_is_none_is_refused(threshold: float) -> None:
    with pytest.raises(BadInput, match="threshold must be at least 0 and finite"):
        joints_above([0.1, 0.2], threshold)
