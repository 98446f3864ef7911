"""Memorisation: descriptors by hand, nearest distances against brute force, copies found, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.distance import cdist

from bench.errors import BadInput
from bench.metrics.memorisation import (
    copied,
    copy_threshold,
    mirrored_positions,
    nearest_distance,
    nearest_distance_within,
    neighbour_ratio,
    pose_descriptors,
    window_descriptors,
)


def test_descriptor_distance_is_rms_joint_distance() -> None:
    windows = np.random.default_rng(0).normal(size=(1, 64, 21, 3))
    moved = windows.copy()
    moved[..., 0] += 0.03
    moved[..., 1] += 0.04
    first, second = pose_descriptors(windows), pose_descriptors(moved)
    assert first.shape == (1, 8 * 21 * 3) and first.dtype == np.float32
    assert np.linalg.norm(first - second) == pytest.approx(0.05, rel=1e-5)
    halfway = windows.copy()
    halfway[:, 32:, :, 2] += 0.05
    assert np.linalg.norm(first - pose_descriptors(halfway)) == pytest.approx(0.05 / np.sqrt(2), rel=1e-5)


def test_descriptors_keep_every_step_th_pose() -> None:
    windows = np.arange(2 * 6 * 1 * 3, dtype=np.float64).reshape(2, 6, 1, 3)
    np.testing.assert_allclose(
        pose_descriptors(windows, 3) * np.sqrt(2), windows[:, [0, 3], 0].reshape(2, 6), rtol=1e-6
    )
    motion = np.random.default_rng(1).normal(size=(20, 4, 3))
    cut = np.stack([motion[3:11], motion[12:20]])
    np.testing.assert_array_equal(window_descriptors(motion, [3, 12], n_frames=8, step=3), pose_descriptors(cut, 3))


def test_mirror_by_hand_and_twice_is_the_same() -> None:
    positions = np.array([[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])
    np.testing.assert_array_equal(mirrored_positions(positions, [1, 0]), [[-4.0, 5.0, 6.0], [-1.0, 2.0, 3.0]])
    np.testing.assert_array_equal(mirrored_positions(mirrored_positions(positions, [1, 0]), [1, 0]), positions)


@pytest.mark.parametrize("offset", [0.0, 30.0])
def test_nearest_distance_equals_brute_force(offset: float) -> None:
    rng = np.random.default_rng(2)
    bank = (np.cumsum(rng.normal(size=(700, 30)), axis=0) * 1e-3 + offset).astype(np.float32)
    queries = (bank[rng.integers(0, 700, 300)] + rng.choice([0.0, 1e-4, 0.1], (300, 1))).astype(np.float32)
    expected = cdist(queries.astype(np.float64), bank.astype(np.float64)).min(axis=1)
    np.testing.assert_allclose(nearest_distance(queries, bank), expected, rtol=1e-12, atol=1e-15)


def test_nearest_distance_by_hand_and_argument_order() -> None:
    bank, queries = np.array([[0.0, 0.0], [10.0, 0.0]]), np.array([[3.0, 4.0]])
    assert nearest_distance(queries, bank).tolist() == [5.0]
    assert nearest_distance(bank, queries).tolist() == pytest.approx([5.0, np.sqrt(65.0)])
    assert nearest_distance(bank, bank).tolist() == [0.0, 0.0]


def test_own_group_is_passed_over_or_searched_alone() -> None:
    bank, groups = np.array([[0.0], [1.0], [7.0], [9.0]]), np.array([5, 5, 8, 8])
    queries, own = np.array([[0.0], [8.5], [1.5]]), np.array([5, 8, 6])
    assert nearest_distance(queries, bank, query_groups=own, bank_groups=groups).tolist() == [7.0, 7.5, 0.5]
    within = nearest_distance_within(queries, bank, query_groups=[8, 5, 5], bank_groups=groups[[0, 1, 2, 3]])
    assert within.tolist() == [7.0, 7.5, 0.5]
    shuffled = nearest_distance_within(queries, bank[::-1], query_groups=[8, 5, 5], bank_groups=groups[::-1])
    assert shuffled.tolist() == within.tolist()


def test_several_own_groups_are_passed_over() -> None:
    bank, groups = np.array([[0.0], [1.0], [7.0], [9.0]]), np.array([5, 6, 8, 8])
    own = np.array([[5, 6], [8, 6], [3, 3]])
    assert nearest_distance([[0.0], [8.5], [0.2]], bank, query_groups=own, bank_groups=groups) == pytest.approx(
        [7.0, 8.5, 0.2]
    )
    np.testing.assert_array_equal(
        nearest_distance(bank, bank, query_groups=groups[:, None], bank_groups=groups),
        nearest_distance(bank, bank, query_groups=groups, bank_groups=groups),
    )


def test_distance_grows_as_the_copy_is_disturbed() -> None:
    rng = np.random.default_rng(3)
    bank = rng.normal(size=(50, 20))
    noise = rng.normal(size=(50, 20))
    means = [nearest_distance(bank + s * noise, bank).mean() for s in (0.0, 0.01, 0.05, 0.1)]
    assert means[0] == 0.0
    assert (np.diff(means) > 0).all()
    turn, _ = np.linalg.qr(rng.normal(size=(20, 20)))
    turned = nearest_distance((bank + 0.1 * noise) @ turn, bank @ turn).mean()
    assert turned == pytest.approx(means[3], rel=1e-5)


def test_copies_are_found_and_real_takes_are_not() -> None:
    rng = np.random.default_rng(4)
    given, real = rng.normal(size=(400, 10)), rng.normal(size=(200, 10))
    real_distances = nearest_distance(real, given)
    threshold = copy_threshold(real_distances)
    assert copied(real_distances, threshold).mean() == pytest.approx(0.05)
    assert copied(nearest_distance(given[:100] + 1e-3, given), threshold).all()
    assert copied([0.1, 0.2, 0.3], 0.2).tolist() == [True, False, False]
    assert copy_threshold([0.0, 1.0, 2.0], 0.25) == 0.5


def test_neighbour_ratio() -> None:
    assert neighbour_ratio([1.0, 2.0, 9.0], [4.0]) == 0.5
    assert neighbour_ratio([4.0], [1.0, 2.0, 9.0]) == 2.0


def test_refusals() -> None:
    windows = np.zeros((2, 8, 3, 3))
    rows = np.ones((3, 4))
    with pytest.raises(BadInput, match=r"positions_m must have shape \[any, any, any, 3\]"):
        pose_descriptors(windows[0])
    with pytest.raises(BadInput, match=r"step must lie in 1\.\.8, got 9"):
        pose_descriptors(windows, 9)
    with pytest.raises(BadInput, match="windows of 8 frames must lie within 8 frames"):
        window_descriptors(windows[0], [1], n_frames=8)
    with pytest.raises(BadInput, match="mirror_joints must permute 3 joints"):
        mirrored_positions(windows, [0, 1, 1])
    with pytest.raises(BadInput, match=r"bank must be finite \[rows, D\]"):
        nearest_distance(rows, rows * np.nan)
    with pytest.raises(BadInput, match="queries must have 4 columns like the bank, got 3"):
        nearest_distance(rows[:, :3], rows)
    with pytest.raises(BadInput, match="query_groups is missing"):
        nearest_distance(rows, rows, bank_groups=[0, 0, 0])
    with pytest.raises(BadInput, match=r"query_groups must be \[n\] or \[n, g\], got \[1, 1, 1\]"):
        nearest_distance(rows, rows, query_groups=[[[0]]], bank_groups=[0, 0, 0])
    with pytest.raises(BadInput, match=r"query_groups must have shape \[3\], got \[2\]"):
        nearest_distance(rows, rows, query_groups=[0, 1], bank_groups=[0, 0, 0])
    with pytest.raises(BadInput, match="query 1 has no row left in the bank"):
        nearest_distance(rows, rows, query_groups=[1, 0, 0], bank_groups=[0, 0, 0])
    with pytest.raises(BadInput, match="group 2 has no row in the bank"):
        nearest_distance_within(rows, rows, query_groups=[2, 0, 0], bank_groups=[0, 0, 0])
    with pytest.raises(BadInput, match="real_distances must not be negative"):
        copy_threshold([-1.0])
    with pytest.raises(BadInput, match="quantile must lie between 0 and 1"):
        copy_threshold([1.0], 0.0)
    with pytest.raises(BadInput, match=r"threshold must be positive, got 0\.0; likely cause: duplicate real takes"):
        copied([1.0], 0.0)
    with pytest.raises(BadInput, match="the median must be positive"):
        neighbour_ratio([1.0], [0.0])
