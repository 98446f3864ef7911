from __future__ import annotations

import warnings
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadMotion
from bench.motion import quat
from bench.motion.bvh import BvhMotion, read_bvh, world_motion, write_bvh
from bench.motion.clip import Clip
from bench.motion.kinematics import facing_yaw, forward_kinematics, world_positions
from bench.motion.retarget import folding_error_m, to_canonical
from bench.motion.skeleton import (
    CANONICAL_NAMES,
    LEFT_ARM,
    LEFT_FINGER,
    LEFT_FOOT,
    LEFT_FOREARM,
    LEFT_HAND,
    LEFT_LEG,
    LEFT_TOE,
    LEFT_UP_LEG,
    MIRROR_JOINTS,
    RIGHT_ARM,
    RIGHT_FINGER,
    RIGHT_FOREARM,
    RIGHT_HAND,
    SPINE1,
    Skeleton,
)
from bench.motion.skeleton_maps import BANDAI_NAMCO, CMU_31, CMU_UNIT_M, SkeletonMap
from tests.motion.source_trees import BANDAI_NAMCO_TREE, CMU_31_TREE

SOURCES = [
    pytest.param(BANDAI_NAMCO, BANDAI_NAMCO_TREE, id="bandai-namco"),
    pytest.param(CMU_31, CMU_31_TREE, id="cmu-31"),
]
"""Maps and the trees they are for (Park 2021's 31 CMU joints; the 22 of Bandai-Namco)."""

BANDAI_NAMCO_FOLDING_MEAN_M, BANDAI_NAMCO_FOLDING_MAX_M = 0.003, 0.025
"""Bounds on what a shoulder's turn away from its T-pose costs. The 1310 takes have 2.3 mm and 24.3 mm, arms only."""
CMU_FOLDING_MEAN_M, CMU_FOLDING_MAX_M = 0.03, 0.13
"""The same for four clips of Xia 2015, 26 mm and 122 mm: clavicles rise with the arms, the lower back bends."""


def source_motion(
    skeleton_map: SkeletonMap, tree: dict[str, str | None], turns_wxyz: FloatArray | None = None, unit_m: float = 0.01
) -> BvhMotion:
    """A source skeleton with random bones whose joints start in the map's T-pose, each then turned in the world.

    ``turns_wxyz`` is ``[F, J, 4]``: the world turn of each joint away from the T-pose.
    """
    rng = np.random.default_rng(5)
    names = tuple(tree)
    parents = tuple(-1 if parent is None else names.index(parent) for parent in tree.values())
    t_pose = np.stack([skeleton_map.t_pose_wxyz.get(name, quat.IDENTITY) for name in names])
    turns = np.tile(quat.IDENTITY, (1, len(names), 1)) if turns_wxyz is None else turns_wxyz
    world = quat.multiply(turns, t_pose)
    local = world.copy()
    local[:, 1:] = quat.multiply(quat.conjugate(world[:, list(parents[1:])]), world[:, 1:])
    with warnings.catch_warnings():
        # At the pole the angles are not unique; any will do.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_quat(local.reshape(-1, 4), scalar_first=True).as_euler("ZXY", degrees=True)
    offsets = rng.uniform(-0.3, 0.3, (len(names), 3)) / unit_m
    offsets[0] = 0.0
    root = rng.uniform(-1.0, 1.0, (len(turns), 3)) / unit_m
    rotations = ("Zrotation", "Xrotation", "Yrotation")
    channels = (("Xposition", "Yposition", "Zposition", *rotations), *[rotations] * (len(names) - 1))
    values = np.concatenate([root, angles.reshape(len(turns), -1)], axis=1)
    return BvhMotion(names, parents, offsets, channels, values, 0.0333333)


def random_turns(n_frames: int, tree: dict[str, str | None], seed: int = 0) -> FloatArray:
    vectors = np.random.default_rng(seed).uniform(-1.0, 1.0, (n_frames, len(tree), 3))
    return quat.from_rotation_vector(vectors)


@pytest.mark.parametrize(("skeleton_map", "tree"), SOURCES)
def test_t_pose_has_identity_rotations(skeleton_map: SkeletonMap, tree: dict[str, str | None]) -> None:
    source = source_motion(skeleton_map, tree)
    clip = to_canonical(source, skeleton_map, unit_m=0.01)
    np.testing.assert_allclose(np.abs(clip.rotations_wxyz @ quat.IDENTITY), 1.0, atol=1e-12)
    assert np.nanmax(folding_error_m(source, clip, skeleton_map, unit_m=0.01)) < 1e-9
    assert clip.skeleton.virtual == frozenset(skeleton_map.virtual_offsets_m)
    assert clip.fps == 30.0


@pytest.mark.parametrize(("skeleton_map", "tree"), SOURCES)
def test_world_turns_are_kept(skeleton_map: SkeletonMap, tree: dict[str, str | None]) -> None:
    turns = random_turns(6, tree)
    clip = to_canonical(source_motion(skeleton_map, tree, turns), skeleton_map, unit_m=0.01)
    world = forward_kinematics(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)[1]
    for canonical, source in skeleton_map.joints.items():
        ours, theirs = world[:, CANONICAL_NAMES.index(canonical)], turns[:, list(tree).index(source)]
        np.testing.assert_allclose(quat.angle_between(ours, theirs), 0.0, atol=1e-7, err_msg=canonical)


@pytest.mark.parametrize(("skeleton_map", "tree"), SOURCES)
def test_positions_are_kept_while_dropped_joints_follow(skeleton_map: SkeletonMap, tree: dict[str, str | None]) -> None:
    turns = random_turns(6, tree)
    names = list(tree)
    for joint, (name, parent) in enumerate(tree.items()):
        if name not in skeleton_map.joints.values() and parent is not None:
            turns[:, joint] = turns[:, names.index(parent)]
    source = source_motion(skeleton_map, tree, turns)
    clip = to_canonical(source, skeleton_map, unit_m=0.01)
    assert np.nanmax(folding_error_m(source, clip, skeleton_map, unit_m=0.01)) < 1e-9


def test_folding_error_is_what_a_dropped_joint_moves() -> None:
    turns = np.tile(quat.IDENTITY, (1, len(BANDAI_NAMCO_TREE), 1))
    shoulder, upper_arm = (list(BANDAI_NAMCO_TREE).index(name) for name in ("Shoulder_L", "UpperArm_L"))
    turns[:, shoulder] = quat.about_y(0.2)
    source = source_motion(BANDAI_NAMCO, BANDAI_NAMCO_TREE, turns)
    error = folding_error_m(source, to_canonical(source, BANDAI_NAMCO, unit_m=0.01), BANDAI_NAMCO, unit_m=0.01)[0]
    bone_m = quat.rotate(BANDAI_NAMCO.t_pose_wxyz["Shoulder_L"], source.offsets[upper_arm]) * 0.01
    moved = np.linalg.norm(quat.rotate(quat.about_y(0.2), bone_m) - bone_m)
    np.testing.assert_allclose(error[[LEFT_ARM, LEFT_FOREARM, LEFT_HAND]], moved, atol=1e-9)
    np.testing.assert_allclose(np.delete(error, [13, 14, 15, 16, 20]), 0.0, atol=1e-9)
    assert np.isnan(error[[LEFT_FINGER, RIGHT_FINGER]]).all()


def test_moving_joint_above_the_hips_is_composed() -> None:
    still = source_motion(BANDAI_NAMCO, BANDAI_NAMCO_TREE)
    moved = still.channel_values.copy()
    moved[:, :3] += [100.0, 0.0, -50.0]
    before, after = (
        to_canonical(motion, BANDAI_NAMCO, unit_m=0.01) for motion in (still, replace(still, channel_values=moved))
    )
    np.testing.assert_allclose(after.root_xyz_m - before.root_xyz_m, [[1.0, 0.0, -0.5]], atol=1e-12)
    assert after.skeleton.same_bones(before.skeleton, 1e-12)


def test_positions_that_leave_offset_make_the_bones() -> None:
    source = source_motion(CMU_31, CMU_31_TREE)
    joint = source.names.index("LeftLeg")
    channels = list(source.channels)
    channels[joint] = ("Xposition", "Yposition", "Zposition", *channels[joint])
    column = 3 + 3 * joint
    values = np.insert(source.channel_values, [column] * 3, source.offsets[joint] * 2.0, axis=1)
    longer = replace(source, channels=tuple(channels), channel_values=values)
    before, after = (to_canonical(motion, CMU_31, unit_m=0.01).skeleton for motion in (source, longer))
    np.testing.assert_allclose(after.offsets_m[LEFT_LEG], 2.0 * before.offsets_m[LEFT_LEG], atol=1e-12)


def test_z_up_is_the_same_motion() -> None:
    y_up = source_motion(CMU_31, CMU_31_TREE, random_turns(4, CMU_31_TREE))
    to_z_up = Rotation.from_euler("X", 90, degrees=True)
    values = y_up.channel_values.copy()
    values[:, :3] = to_z_up.apply(values[:, :3])
    root = to_z_up * Rotation.from_euler("ZXY", values[:, 3:6], degrees=True)
    values[:, 3:6] = root.as_euler("ZXY", degrees=True)
    expected = to_canonical(y_up, CMU_31, unit_m=0.01)
    clip = to_canonical(replace(y_up, channel_values=values), CMU_31, unit_m=0.01, up="z")
    np.testing.assert_allclose(world_positions(clip), world_positions(expected), atol=1e-9)


def test_unit_and_frame_rate() -> None:
    source = source_motion(CMU_31, CMU_31_TREE)
    small, large = (to_canonical(source, CMU_31, unit_m=unit_m, fps=24.0) for unit_m in (0.01, 0.02))
    np.testing.assert_allclose(large.skeleton.offsets_m, 2.0 * small.skeleton.offsets_m)
    np.testing.assert_allclose(large.root_xyz_m, 2.0 * small.root_xyz_m)
    assert small.fps == 24.0


def test_other_skeleton_is_refused() -> None:
    with pytest.raises(
        BadMotion, match=r"the skeleton lacks UpperLeg_L.*not a bandai-namco skeleton.*another joint map"
    ):
        to_canonical(source_motion(CMU_31, CMU_31_TREE), BANDAI_NAMCO, unit_m=0.01)


@pytest.mark.parametrize("frame_time_s", [33.333, 30.0, 0.0001])
def test_frame_time_of_no_motion_is_refused(frame_time_s: float) -> None:
    source = replace(source_motion(CMU_31, CMU_31_TREE), frame_time_s=frame_time_s)
    with pytest.raises(BadMotion, match=r"frames per second; likely cause: .*; remedy: give fps"):
        to_canonical(source, CMU_31, unit_m=0.01)
    assert to_canonical(source, CMU_31, unit_m=0.01, fps=30.0).fps == 30.0


def test_other_up_is_refused() -> None:
    with pytest.raises(BadConfig, match="up must be 'y' or 'z', got 'x'"):
        to_canonical(source_motion(CMU_31, CMU_31_TREE), CMU_31, unit_m=0.01, up="x")


@pytest.mark.parametrize("unit_m", [0.0, -0.01, np.nan, np.inf])
def test_unit_is_refused(unit_m: float) -> None:
    with pytest.raises(BadConfig, match="unit_m must be metres per file unit"):
        to_canonical(source_motion(CMU_31, CMU_31_TREE), CMU_31, unit_m=unit_m)


def test_maps_name_every_canonical_joint_once() -> None:
    joints = {name: name for name in CANONICAL_NAMES}
    with pytest.raises(BadConfig, match=r"toy: .*see \['Neck1'\]"):
        SkeletonMap("toy", {name: name for name in CANONICAL_NAMES if name != "Neck1"})
    with pytest.raises(BadConfig, match=r"toy: .*see \['Tail'\]"):
        SkeletonMap("toy", {**joints, "Tail": "Tail"})
    with pytest.raises(BadConfig, match=r"toy: .*see \['Head'\]"):
        SkeletonMap("toy", joints, virtual_offsets_m={"Head": (0.0, 0.1, 0.0)})
    del joints["Hips"]
    with pytest.raises(BadConfig, match="Hips cannot be virtual"):
        SkeletonMap("toy", joints, virtual_offsets_m={"Hips": (0.0, 0.0, 0.0)})


def assert_t_pose(skeleton: Skeleton, tolerance_m: float) -> None:
    """Facing +Z, left arm along +X, legs straight down, toes ahead, left and right alike, grown-up."""
    rest = skeleton.rest_positions_m
    assert abs(float(facing_yaw(rest[None])[0])) < 0.05
    assert 1.2 < skeleton.stature_m < 1.5
    arms = [LEFT_ARM, LEFT_FOREARM, LEFT_HAND, LEFT_FINGER]
    assert (np.diff(rest[arms, 0]) > 0.03).all()
    np.testing.assert_allclose(rest[arms, 1:], np.tile(rest[LEFT_ARM, 1:], (4, 1)), atol=tolerance_m)
    legs = [LEFT_UP_LEG, LEFT_LEG, LEFT_FOOT]
    assert (np.diff(rest[legs, 1]) < -0.3).all()
    np.testing.assert_allclose(rest[legs][:, [0, 2]], np.tile(rest[LEFT_UP_LEG, [0, 2]], (3, 1)), atol=tolerance_m)
    assert rest[LEFT_TOE, 2] > rest[LEFT_FOOT, 2] + 0.05
    assert rest[SPINE1, 1] > 0.2
    mirrored = rest[list(MIRROR_JOINTS)] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(rest, mirrored, atol=0.03)


def round_trip_error_m(clip: Clip, path: Path) -> float:
    """How far world positions move when a clip is written to BVH and read again."""
    write_bvh(path, clip)
    return float(np.abs(world_motion(read_bvh(path))[0] * 0.01 - world_positions(clip)).max())


def test_bandai_namco_takes(bandai_namco_zip: Path, tmp_path: Path) -> None:
    check_bandai_namco(bandai_namco_zip, slice(None, None, 131), tmp_path)


@pytest.mark.slow
def test_all_bandai_namco_takes(bandai_namco_zip: Path, tmp_path: Path) -> None:
    assert check_bandai_namco(bandai_namco_zip, slice(None), tmp_path) == 1310


def check_bandai_namco(archive_path: Path, which: slice, folder: Path) -> int:
    errors, skeletons = [], []
    with zipfile.ZipFile(archive_path) as archive:
        members = [name for name in archive.namelist() if name.endswith(".bvh")][which]
        for member in members:
            source = read_bvh(archive.read(member), name=member)
            clip = to_canonical(source, BANDAI_NAMCO, unit_m=0.01)
            errors.append(folding_error_m(source, clip, BANDAI_NAMCO, unit_m=0.01))
            skeletons.append(clip.skeleton)
            assert round_trip_error_m(clip, folder / "take.bvh") < 1e-5
    assert_t_pose(skeletons[0], tolerance_m=1e-3)
    assert all(skeleton.same_bones(skeletons[0], 1e-6) for skeleton in skeletons)
    error = np.concatenate(errors)
    arms = [LEFT_ARM, LEFT_FOREARM, LEFT_HAND, RIGHT_ARM, RIGHT_FOREARM, RIGHT_HAND]
    assert np.nanmax(np.delete(error, arms, axis=1)) < 1e-4
    assert np.nanmean(error) < BANDAI_NAMCO_FOLDING_MEAN_M
    assert np.nanmax(error) < BANDAI_NAMCO_FOLDING_MAX_M
    return len(members)


def test_xia_files(xia_folder: Path, tmp_path: Path) -> None:
    for file in sorted(xia_folder.glob("*.bvh")):
        source = read_bvh(file)
        clip = to_canonical(source, CMU_31, unit_m=CMU_UNIT_M)
        assert clip.fps == 120.0
        assert_t_pose(clip.skeleton, tolerance_m=5e-3)
        error = folding_error_m(source, clip, CMU_31, unit_m=CMU_UNIT_M)
        assert error.mean() < CMU_FOLDING_MEAN_M
        assert error.max() < CMU_FOLDING_MAX_M
        assert standing_height_m(clip) > 0.8
        assert round_trip_error_m(clip, tmp_path / file.name) < 1e-5


def standing_height_m(clip: Clip) -> float:
    """Median height of the hips over the lowest foot."""
    positions = world_positions(clip)
    return float(np.median(positions[:, 0, 1] - positions[:, :, 1].min(axis=1)))
