"""Frames of Mason 2022: widths as printed, independence of place and heading, and the way back."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from bench.datasets.procedural.dataset import load as load_procedural
from bench.methods.mason2022.features import (
    Layout,
    body_of,
    clip_features,
    gate_velocities,
    input_frames,
    local_rotations,
    output_frames,
    path_at,
    pose_of,
)
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.kinematics import world_positions, yaw_aligned
from bench.motion.skeleton import LEFT_TOE


@cache
def walk() -> Clip:
    take = next(take for take in load_procedural(None).takes if take.content == "walk" and take.clip.n_frames > 90)
    return resample(take.clip, 60.0)


@pytest.mark.parametrize(
    ("n_joints", "n_phases", "n_input", "n_output"),
    [(25, 16, 348, 342), (25, 1, 348, 327), (25, 0, 348, 326), (21, 16, 300, 294)],
)
def test_widths_as_printed(n_joints: int, n_phases: int, n_input: int, n_output: int) -> None:
    layout = Layout(n_joints, n_phases)
    assert (layout.n_input, layout.n_output) == (n_input, n_output)
    assert layout.pose.stop == layout.phases.start
    assert layout.phases.stop == layout.contacts.start


def test_features_do_not_know_where_the_motion_is() -> None:
    clip = walk()
    turned, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, 1.1)
    elsewhere = body_of(clip.with_motion(turned, root + np.array([3.0, 0.0, -2.0])))
    here = body_of(clip)
    assert input_frames(here).shape == (clip.n_frames - 1, Layout().n_input)
    for mine, theirs in zip(
        (input_frames(here), *output_frames(here), clip_features(here)),
        (input_frames(elsewhere), *output_frames(elsewhere), clip_features(elsewhere)),
        strict=True,
    ):
        assert np.allclose(mine, theirs, atol=1e-9)


def test_path_passes_through_now_and_goes_forward() -> None:
    body = body_of(walk())
    path = input_frames(body)[:, :48].reshape(-1, 4, 12)
    assert np.allclose(path[:, :3, 6], 0.0, atol=1e-12)
    assert np.allclose(path[:, 3, 6], 1.0)
    middle = path[60 : body.n_frames - 61]
    assert (middle[:, 1, 11] > 0.0).all()
    assert (middle[:, 1, 0] < 0.0).all()
    step, pose, _ = output_frames(body)
    assert np.allclose(
        np.hypot(*step.reshape(-1, 4, 6)[:, :2, 0].T), np.linalg.norm(np.diff(body.path_xz_m, axis=0), axis=1)
    )
    assert np.allclose(pose.reshape(len(pose), -1, 12)[:, 0, [0, 2]], step.reshape(-1, 4, 6)[:, :2, 0])


def test_path_goes_on_at_constant_velocity_beyond_the_clip() -> None:
    body = body_of(walk())
    last = body.n_frames - 1
    (one, two), yaw = path_at(body, np.array([last + 1.0, last + 2.0]))
    assert np.allclose(one - body.path_xz_m[last], two - one)
    assert np.allclose(one - body.path_xz_m[last], (body.path_xz_m[last] - body.path_xz_m[last - 10]) / 10.0)
    assert np.allclose(yaw, body.yaw_rad[last])


def test_pose_comes_back() -> None:
    clip = walk()
    body = body_of(clip)
    positions, rotations = pose_of(clip_features(body))
    assert np.allclose(positions[:, 0, [0, 2]], 0.0, atol=1e-12)
    local = local_rotations(rotations)
    assert np.allclose(quat.angle_between(local[:, 1:], clip.rotations_wxyz[:, 1:]), 0.0, atol=1e-6)
    heights = world_positions(clip)[..., 1]
    assert np.allclose(positions[..., 1] - heights, (positions[..., 1] - heights)[0, 0], atol=1e-9)


def test_gate_sees_the_velocities_of_hands_and_toes() -> None:
    pose = np.zeros((2, 252))
    pose.reshape(2, 21, 12)[:, LEFT_TOE, 9:] = [1.0, 2.0, 3.0]
    assert np.allclose(gate_velocities(pose)[0], [0, 0, 0, 0, 0, 0, 1, 2, 3, 0, 0, 0])
