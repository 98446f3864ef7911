from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput, BadMotion
from bench.motion import quat
from bench.motion import representation as rep
from bench.motion.kinematics import yaw_aligned
from bench.motion.skeleton import Skeleton
from tests.motion.factory import random_clip


def test_park_round_trip() -> None:
    clip = random_clip(amount_rad=1.0)
    features, track = rep.park_features(clip)
    assert features.shape == (40, 21, 7)
    back = rep.clip_from_park(features, track, clip.skeleton, clip.fps)
    assert quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz).max() < 1e-12
    np.testing.assert_allclose(back.root_xyz_m, clip.root_xyz_m, atol=1e-12)


def test_position_6d_round_trip() -> None:
    clip = random_clip(amount_rad=1.0)
    features, track = rep.position_6d_features(clip)
    assert features.shape == (40, 21, 9)
    back = rep.clip_from_position_6d(features, track, clip.skeleton, clip.fps)
    assert quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz).max() < 1e-9
    np.testing.assert_allclose(back.root_xyz_m, clip.root_xyz_m, atol=1e-12)


def test_axes_that_are_not_orthonormal_are_made_so() -> None:
    forward, up = np.array([0.0, 0.0, 2.0]), np.array([0.0, 3.0, 1.0])
    np.testing.assert_allclose(rep.matrix_from_axes(forward, up), np.eye(3), atol=1e-12)


def test_features_of_the_wrong_shape_are_refused() -> None:
    clip = random_clip()
    features, track = rep.park_features(clip)
    with pytest.raises(BadInput, match="features must have shape"):
        rep.clip_from_park(features[..., :6], track, clip.skeleton, clip.fps)


def test_judge_features_ignore_place_and_heading() -> None:
    clip = random_clip()
    rotations, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, 1.3)
    moved = clip.with_motion(rotations, root + np.array([3.0, 0.4, -2.0]))
    own, other = rep.judge_features(clip), rep.judge_features(moved)
    position, rotation = rep.JUDGE_SLICES["position_statures"], rep.JUDGE_SLICES["rotation_wxyz"]
    np.testing.assert_allclose(other[..., position], own[..., position], atol=1e-9)
    assert quat.angle_between(other[..., rotation], own[..., rotation]).max() < 1e-9


def test_judge_features_keep_a_turn_within_the_window() -> None:
    clip = random_clip(amount_rad=0.0)
    turning, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, -np.linspace(-0.5, 0.5, 40))
    features = rep.judge_features(clip.with_motion(turning, clip.root_xyz_m))
    turn = quat.angle_between(features[0, 0, 3:], features[-1, 0, 3:])
    assert turn == pytest.approx(1.0, abs=1e-6)


def test_positions_are_in_statures_over_the_windows_own_floor() -> None:
    clip = random_clip(amount_rad=0.0)
    positions = rep.judge_features(clip)[..., :3]
    assert positions[..., 1].min() == pytest.approx(0.0, abs=1e-12)
    head_over_toe = positions[:, 12, 1] - positions[:, 4, 1]
    np.testing.assert_allclose(head_over_toe, 1.0, atol=1e-9)


def test_other_skeletons_are_refused() -> None:
    skeleton = Skeleton(("a", "b"), (-1, 0), np.ones((2, 3)))
    with pytest.raises(BadMotion, match="canonical 21 joints"):
        rep.window_frame(np.tile(quat.IDENTITY, (3, 2, 1)), np.zeros((3, 3)), skeleton)
