from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bench.datasets import bandai_namco
from bench.errors import BadInput
from bench.motion import corrupt
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.kinematics import world_positions
from bench.motion.representation import window_frame
from tests.motion.factory import random_clip

CLIP, OTHER = random_clip(64, seed=1), random_clip(64, seed=2)
BY_LEVEL: dict[str, tuple[Callable[[Clip, float], Clip], float]] = {
    "noisy": (lambda clip, level: corrupt.noisy(clip, level, np.random.default_rng(0)), 0.1),
    "jittered": (lambda clip, level: corrupt.jittered(clip, level, np.random.default_rng(0)), 0.02),
    "time_warped": (corrupt.time_warped, 0.8),
    "foot_slid": (corrupt.foot_slid, 0.5),
    "joints_swapped": (lambda clip, level: corrupt.joints_swapped(clip, round(4 * level)), 1.0),
    "blended": (lambda clip, level: corrupt.blended(clip, OTHER, level), 1.0),
    "frozen": (corrupt.frozen, 1.0),
    "frames_dropped": (lambda clip, level: corrupt.frames_dropped(clip, level, np.random.default_rng(0)), 0.5),
    "turned": (corrupt.turned, 1.5),
    "moved": (corrupt.moved, 3.0),
}
EVERY = pytest.mark.parametrize("name", BY_LEVEL)


def distance_m(left: Clip, right: Clip) -> float:
    return float(np.linalg.norm(world_positions(left) - world_positions(right), axis=-1).mean())


def features(clip: Clip) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return np.concatenate(window_frame(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton), axis=-1)


@EVERY
def test_level_0_is_the_clip_itself(name: str) -> None:
    function, _ = BY_LEVEL[name]
    assert distance_m(function(CLIP, 0.0), CLIP) < 1e-9


@EVERY
def test_more_is_farther(name: str) -> None:
    function, top = BY_LEVEL[name]
    farther = [distance_m(function(CLIP, share * top), CLIP) for share in (0.0, 0.5, 1.0)]
    assert farther == sorted(farther) and farther[0] < farther[1] < farther[2] + 1e-12


@EVERY
def test_frames_fps_and_bones_stay(name: str) -> None:
    function, top = BY_LEVEL[name]
    found = function(CLIP, top)
    assert (found.n_frames, found.fps) == (64, 30.0) and found.skeleton is CLIP.skeleton


def test_judges_do_not_see_where_a_motion_goes() -> None:
    for unseen in (corrupt.turned(CLIP, 1.5), corrupt.moved(CLIP, 3.0), corrupt.foot_slid(CLIP, 0.5)):
        np.testing.assert_allclose(np.abs(features(unseen)), np.abs(features(CLIP)), atol=1e-9)


def test_resampling_up_and_back_is_no_change() -> None:
    for fps in (0.0, 60.0, 120.0):
        assert distance_m(corrupt.resampled_and_back(CLIP, fps), CLIP) < 1e-9
    assert distance_m(corrupt.resampled_and_back(CLIP, 10.0), CLIP) > 1e-4


def test_a_blend_ends_as_the_other_motion_in_the_same_place() -> None:
    placed = corrupt.turned(corrupt.moved(OTHER, 5.0), 2.0)
    end = corrupt.blended(CLIP, placed, 1.0)
    np.testing.assert_allclose(np.abs(features(end)), np.abs(features(OTHER)), atol=1e-9)
    np.testing.assert_allclose(end.root_xyz_m.mean(axis=0)[[0, 2]], CLIP.root_xyz_m.mean(axis=0)[[0, 2]])


def test_a_warped_clip_keeps_its_ends_and_its_poses() -> None:
    found = corrupt.time_warped(CLIP, 0.9)
    np.testing.assert_allclose(found.root_xyz_m[[0, -1]], CLIP.root_xyz_m[[0, -1]], atol=1e-9)
    assert np.diff(found.root_xyz_m[:, 2]).max() > 1.5 * np.diff(CLIP.root_xyz_m[:, 2]).max()


def test_a_frozen_clip_stands_still_and_a_half_frozen_one_half() -> None:
    assert np.ptp(corrupt.frozen(CLIP, 1.0).root_xyz_m, axis=0).max() == 0.0
    still = (np.diff(corrupt.frozen(CLIP, 0.5).root_xyz_m[:, 2]) == 0.0).mean()
    assert still == pytest.approx(0.5, abs=0.05)


def test_dropped_frames_show_the_frame_before() -> None:
    found = corrupt.frames_dropped(CLIP, 0.5, np.random.default_rng(1))
    repeated = np.diff(found.root_xyz_m[:, 2]) == 0.0
    assert 0.3 < repeated.mean() < 0.7
    assert set(found.root_xyz_m[:, 2]) <= set(CLIP.root_xyz_m[:, 2])


def test_real_motion_takes_it_too(bandai_namco_zip: Path) -> None:
    takes = bandai_namco.load(bandai_namco_zip).takes
    clip = window(takes[0].clip, 0, 64)
    for function, top in BY_LEVEL.values():
        if function is not BY_LEVEL["blended"][0]:
            assert 0.0 < distance_m(function(clip, top), clip) < 10.0


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: corrupt.frozen(CLIP, 1.2), r"share must be in 0..1, got 1.2"),
        (lambda: corrupt.time_warped(CLIP, -0.1), r"share must be in 0..1"),
        (lambda: corrupt.joints_swapped(CLIP, 5), r"n_pairs must be in 0..4, got 5"),
        (lambda: corrupt.blended(CLIP, random_clip(30), 0.5), r"other must have 64 frames, got 30"),
    ],
)
def test_levels_that_make_no_sense_are_refused(call: Callable[[], Clip], message: str) -> None:
    with pytest.raises(BadInput, match=message):
        call()
