from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import (
    facing_yaw,
    floor_height,
    foot_contacts,
    forward_kinematics,
    velocities,
    world_positions,
    yaw_aligned,
)
from tests.motion.factory import person, random_clip


def positions_by_scipy(clip: Clip) -> FloatArray:
    """World positions by rotation matrices, joint by joint: an independent second opinion."""
    matrices = Rotation.from_quat(clip.rotations_wxyz.reshape(-1, 4), scalar_first=True).as_matrix()
    local = matrices.reshape(clip.n_frames, -1, 3, 3)
    world, positions = local.copy(), np.zeros((clip.n_frames, clip.skeleton.n_joints, 3))
    positions[:, 0] = clip.root_xyz_m
    for joint, parent in enumerate(clip.skeleton.parents):
        if parent >= 0:
            positions[:, joint] = positions[:, parent] + world[:, parent] @ clip.skeleton.offsets_m[joint]
            world[:, joint] = world[:, parent] @ local[:, joint]
    return positions


@given(st.integers(0, 1000))
def test_forward_kinematics_agrees_with_matrices(seed: int) -> None:
    clip = random_clip(6, seed=seed, amount_rad=1.5)
    np.testing.assert_allclose(world_positions(clip), positions_by_scipy(clip), atol=1e-12)


def test_bones_keep_their_length() -> None:
    clip = random_clip(amount_rad=2.0)
    positions = world_positions(clip)
    bones = positions[:, 1:] - positions[:, clip.skeleton.parents[1:]]
    lengths = np.linalg.norm(bones, axis=-1)
    np.testing.assert_allclose(lengths, np.tile(clip.skeleton.bone_lengths_m[1:], (40, 1)), atol=1e-12)


def test_batches_of_clips_are_the_same_as_one_by_one() -> None:
    clip = random_clip(12)
    rotations, root = clip.rotations_wxyz.reshape(3, 4, 21, 4), clip.root_xyz_m.reshape(3, 4, 3)
    batched, _ = forward_kinematics(rotations, root, clip.skeleton)
    np.testing.assert_array_equal(batched.reshape(12, 21, 3), world_positions(clip))


@pytest.mark.parametrize("yaw", [-3.0, -1.0, 0.0, 0.5, 2.5])
def test_facing_follows_the_body(yaw: float) -> None:
    rest = Clip(person(), np.tile(quat.IDENTITY, (1, 21, 1)), np.zeros((1, 3)), 30.0)
    rotations, root = yaw_aligned(rest.rotations_wxyz, rest.root_xyz_m, -yaw)
    assert facing_yaw(world_positions(rest.with_motion(rotations, root)))[0] == pytest.approx(yaw)


def test_floor_is_the_lowest_foot_point() -> None:
    rest = Clip(person(), np.tile(quat.IDENTITY, (2, 21, 1)), np.array([[0, 1.0, 0], [0, 1.5, 0]]), 30.0)
    assert floor_height(world_positions(rest)) == pytest.approx(1.0 - 0.95)


def test_velocity_of_uniform_motion() -> None:
    positions = np.arange(5.0)[:, None, None] * np.array([0.0, 0.0, 0.1])
    np.testing.assert_allclose(velocities(positions, 30.0)[..., 2], 3.0)
    assert velocities(positions[:1], 30.0).max() == 0.0


def test_contacts_of_a_standing_and_a_sliding_foot() -> None:
    positions = np.zeros((10, 21, 3))
    positions[:, (3, 4), 2] = np.arange(10)[:, None] * 0.05
    contacts = foot_contacts(positions, 30.0)
    assert not contacts[:, :2].any() and contacts[:, 2:].all()
