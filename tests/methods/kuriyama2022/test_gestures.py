"""Clips as logarithmic maps and back, and the root on its planted foot."""

from __future__ import annotations

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.datasets.procedural import unseen_takes
from bench.methods.kuriyama2022.gestures import LOWER_JOINTS, UPPER_JOINTS, clip_of, gesture_of, root_on_planted_foot
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.kinematics import FOOT_JOINTS, world_positions
from bench.motion.skeleton import PARTS


@pytest.fixture(scope="module")
def gesture() -> Clip:
    takes = unseen_takes(takes_per_cell=1)
    return next(take.clip for take in takes if str(take.content).startswith("gesture-"))


def turned(clip: Clip, other: Clip) -> FloatArray:
    """Angles between the rotations of two clips."""
    return np.asarray(quat.angle_between(clip.rotations_wxyz, other.rotations_wxyz))


def test_thirteen_joints_are_read_and_eight_are_legs() -> None:
    assert len(UPPER_JOINTS) == 13
    assert sorted(LOWER_JOINTS) == sorted(PARTS["legs"])


def test_round_trip(gesture: Clip) -> None:
    clip = resample(gesture, 60.0)
    maps = gesture_of(clip)
    back = clip_of(maps.upper, maps.lower, clip)
    assert back.n_frames == clip.n_frames and back.skeleton == clip.skeleton
    assert turned(back, clip).max() < 1e-6


def test_a_planted_foot_stays_where_it_is(gesture: Clip) -> None:
    clip = resample(gesture, 60.0)
    root = root_on_planted_foot(clip.rotations_wxyz, clip.skeleton, clip.root_xyz_m[0, [0, 2]], 0.0)
    feet = world_positions(clip.with_motion(clip.rotations_wxyz, root))[:, FOOT_JOINTS]
    np.testing.assert_allclose(feet[..., 1].min(axis=1), 0.0, atol=1e-9)
    lowest = feet[..., 1].argmin(axis=1)[:-1]
    frames = np.arange(len(lowest))
    slid = feet[frames + 1, lowest][:, [0, 2]] - feet[frames, lowest][:, [0, 2]]
    np.testing.assert_allclose(slid, 0.0, atol=1e-9)
    np.testing.assert_allclose(root[0, [0, 2]], clip.root_xyz_m[0, [0, 2]])


def test_heading_is_not_seen(gesture: Clip) -> None:
    turn = quat.about_y(np.array(1.0))
    rotations = gesture.rotations_wxyz.copy()
    rotations[:, 0] = quat.multiply(turn[None], rotations[:, 0])
    turned_clip = gesture.with_motion(rotations, quat.rotate(turn[None], gesture.root_xyz_m))
    np.testing.assert_allclose(gesture_of(turned_clip).upper, gesture_of(gesture).upper, atol=1e-8)
    np.testing.assert_allclose(gesture_of(turned_clip).yaw_rad - gesture_of(gesture).yaw_rad, 1.0, atol=1e-8)
