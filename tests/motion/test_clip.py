from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput, BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.skeleton import CANONICAL_NAMES, MIRROR_JOINTS, PARTS, Skeleton, canonical_skeleton
from tests.motion.factory import person, random_clip, rest_offsets


def test_arrays_cannot_be_written() -> None:
    clip = random_clip()
    with pytest.raises(ValueError, match="read-only"):
        clip.rotations_wxyz[0, 0, 0] = 1.0
    with pytest.raises(ValueError, match="read-only"):
        clip.root_xyz_m[0] = 0.0


def test_callers_array_is_copied() -> None:
    root = np.zeros((4, 3))
    clip = Clip(person(), np.tile(quat.IDENTITY, (4, 21, 1)), root, 30.0)
    root[:] = 7.0
    assert clip.root_xyz_m.max() == 0.0


def test_nan_is_refused() -> None:
    clip = random_clip()
    root = clip.root_xyz_m.copy()
    root[3, 1] = np.nan
    with pytest.raises(BadMotion, match="root_xyz_m must be finite, got 1 NaN"):
        clip.with_motion(clip.rotations_wxyz, root)


def test_wrong_shapes_are_refused() -> None:
    clip = random_clip()
    with pytest.raises(BadMotion, match=r"root_xyz_m must have shape \[40, 3\]"):
        clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m[:-1])
    with pytest.raises(BadMotion, match="rotations_wxyz must have shape"):
        clip.with_motion(clip.rotations_wxyz[:, :20], clip.root_xyz_m)


def test_rotations_that_are_not_unit_are_refused_with_frame_and_joint() -> None:
    clip = random_clip()
    rotations = clip.rotations_wxyz.copy()
    rotations[5, 9] *= 1.1
    with pytest.raises(BadMotion, match=r"frame 5, joint Spine: .*unit quaternions, got length 1\.1"):
        clip.with_motion(rotations, clip.root_xyz_m)


@pytest.mark.parametrize("fps", [0.0, -30.0, 1e6, float("nan")])
def test_absurd_fps_is_refused(fps: float) -> None:
    clip = random_clip()
    with pytest.raises(BadMotion, match="fps must be in"):
        Clip(clip.skeleton, clip.rotations_wxyz, clip.root_xyz_m, fps)


def test_parts_cover_every_joint_once() -> None:
    five = [joint for part in ("left_leg", "right_leg", "spine", "left_arm", "right_arm") for joint in PARTS[part]]
    assert sorted(five) == list(range(21)) == sorted(PARTS["all"])
    assert set(PARTS["legs"]) == set(PARTS["left_leg"]) | set(PARTS["right_leg"])


def test_mirror_map_is_its_own_inverse_and_swaps_names() -> None:
    assert [MIRROR_JOINTS[MIRROR_JOINTS[j]] for j in range(21)] == list(range(21))
    for joint, other in enumerate(MIRROR_JOINTS):
        swapped = CANONICAL_NAMES[joint].replace("Left", "*").replace("Right", "Left").replace("*", "Right")
        assert CANONICAL_NAMES[other] == swapped


def test_stature_is_the_height_of_head_over_toes() -> None:
    assert person().stature_m == pytest.approx(0.62 + 0.95)
    assert person(1.1).stature_m == pytest.approx(1.1 * person().stature_m)


def test_stature_of_a_skeleton_upside_down_is_refused() -> None:
    with pytest.raises(BadMotion, match="must be positive"):
        _ = canonical_skeleton(-rest_offsets()).stature_m


def test_skeletons_that_are_no_tree_are_refused() -> None:
    with pytest.raises(BadMotion, match="parents must come before"):
        Skeleton(("a", "b", "c"), (-1, 2, 0), np.zeros((3, 3)))
    with pytest.raises(BadMotion, match="unique names"):
        Skeleton(("a", "a"), (-1, 0), np.zeros((2, 3)))
    with pytest.raises(BadMotion, match="virtual joints"):
        Skeleton(("a",), (-1,), np.zeros((1, 3)), frozenset({"b"}))
    with pytest.raises(BadInput, match="offsets_m must have shape"):
        Skeleton(("a", "b"), (-1, 0), np.zeros((3, 3)))
