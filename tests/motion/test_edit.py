from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput
from bench.motion import edit, quat
from bench.motion.kinematics import floor_height, world_positions
from bench.motion.skeleton import MIRROR_JOINTS
from tests.motion.factory import person, random_clip


def test_resample_keeps_shared_frames_and_duration() -> None:
    clip = random_clip(61, 60.0)
    halved = edit.resample(clip, 30.0)
    assert halved.n_frames == 31
    assert quat.angle_between(halved.rotations_wxyz, clip.rotations_wxyz[::2]).max() < 1e-9
    np.testing.assert_allclose(halved.root_xyz_m, clip.root_xyz_m[::2], atol=1e-12)


def test_resample_to_the_same_rate_is_the_clip() -> None:
    clip = random_clip()
    assert edit.resample(clip, clip.fps) is clip


def test_up_and_down_again_is_close() -> None:
    clip = random_clip(31, 30.0)
    back = edit.resample(edit.resample(clip, 120.0), 30.0)
    assert quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz).max() < 1e-9


def test_crop_outside_is_refused() -> None:
    with pytest.raises(BadInput, match="frames 30 to 50 must lie inside the clip of 40"):
        edit.crop(random_clip(40), 30, 20)


def test_short_clips_are_padded_with_first_and_last_pose() -> None:
    clip = random_clip(10)
    padded = edit.window(clip, 0, 15)
    assert padded.n_frames == 15
    np.testing.assert_array_equal(padded.root_xyz_m[:2], clip.root_xyz_m[[0, 0]])
    np.testing.assert_array_equal(padded.root_xyz_m[2:12], clip.root_xyz_m)
    np.testing.assert_array_equal(padded.root_xyz_m[12:], clip.root_xyz_m[[-1] * 3])


@pytest.mark.parametrize(
    ("n_frames", "starts"), [(63, (0,)), (64, (0,)), (95, (0,)), (96, (0, 32)), (130, (0, 32, 64))]
)
def test_window_starts(n_frames: int, starts: tuple[int, ...]) -> None:
    assert edit.window_starts(n_frames, 64, 32) == starts


def test_mirror_twice_is_the_clip() -> None:
    clip = random_clip()
    twice = edit.mirror(edit.mirror(clip))
    np.testing.assert_allclose(twice.rotations_wxyz, clip.rotations_wxyz, atol=1e-12)
    assert twice.skeleton.same_bones(clip.skeleton)


def test_mirror_reflects_positions_across_x() -> None:
    clip = random_clip()
    expected = world_positions(clip)[:, list(MIRROR_JOINTS)] * np.array([-1.0, 1.0, 1.0])
    np.testing.assert_allclose(world_positions(edit.mirror(clip)), expected, atol=1e-9)


def test_mirror_swaps_virtual_joints() -> None:
    skeleton = person(virtual=frozenset({"LeftHandIndex1"}))
    assert edit.mirror_skeleton(skeleton).virtual == frozenset({"RightHandIndex1"})


def test_on_floor_puts_the_lowest_foot_at_zero() -> None:
    assert floor_height(world_positions(edit.on_floor(random_clip()))) == pytest.approx(0.0, abs=1e-12)


def test_joined_clips_do_not_jump() -> None:
    clip = random_clip(40, amount_rad=0.2)
    other = random_clip(30, seed=5, amount_rad=0.2)
    joined = edit.join([clip, other, clip], blend_s=0.3)
    assert joined.n_frames == 110
    steps = np.linalg.norm(np.diff(world_positions(joined), axis=0), axis=-1)
    assert steps[[39, 69]].max() < 0.12


def test_joining_different_people_is_refused() -> None:
    with pytest.raises(BadInput, match="must share skeleton and fps"):
        edit.join([random_clip(), random_clip(skeleton=person(1.2))])
    with pytest.raises(BadInput, match="at least one clip"):
        edit.join([])
