from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bench.adapters.anchors import CopyContent, CopyStyle, FrozenFrame, NoiseMiddle, PoseAdain
from bench.adapters.base import Adapter
from bench.datasets.take import Take
from bench.errors import MethodFailed
from bench.motion.clip import Clip
from bench.suite.timing.look_ahead import measured_look_ahead
from tests.motion.factory import random_clip

CLIP = random_clip(64, seed=3)
STYLE = Take(random_clip(90, seed=4))


def of_frames(choose: Callable[[int, int], int]) -> Callable[[Clip], Clip]:
    """A method that answers frame t with input frame ``choose(t, n_frames)``."""

    def transfer(clip: Clip) -> Clip:
        frames = [choose(frame, clip.n_frames) for frame in range(clip.n_frames)]
        return clip.with_motion(clip.rotations_wxyz[frames], clip.root_xyz_m[frames])

    return transfer


@pytest.mark.parametrize("ahead", [0, 1, 5, 17, 40])
def test_a_known_look_ahead_is_found(ahead: int) -> None:
    found = measured_look_ahead(of_frames(lambda t, n: min(t + ahead, n - 1)), CLIP)
    assert found.frames == ahead


def test_a_delay_is_no_look_ahead() -> None:
    assert measured_look_ahead(of_frames(lambda t, n: max(t - 9, 0)), CLIP).frames == 0


def test_blocks_of_eight_frames_look_seven_ahead() -> None:
    """Only the first frame of a block waits for its end, so frames of different phase must be probed."""
    found = measured_look_ahead(of_frames(lambda t, n: t // 8 * 8 + 7), CLIP)
    assert (found.frames, found.to_the_end) == (7, False)


def test_the_root_alone_is_seen() -> None:
    def transfer(clip: Clip) -> Clip:
        ahead = np.minimum(np.arange(clip.n_frames) + 3, clip.n_frames - 1)
        return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m[ahead])

    assert measured_look_ahead(transfer, CLIP).frames == 3


def test_a_dependence_below_the_tolerance_is_none() -> None:
    def transfer(clip: Clip) -> Clip:
        return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + 1e-8 * clip.root_xyz_m.mean())

    assert measured_look_ahead(transfer, CLIP).frames == 0


@pytest.mark.parametrize(
    ("adapter", "frames", "to_the_end"),
    [
        (CopyContent(), 0, False),
        (CopyStyle(), 0, False),
        (NoiseMiddle(), 0, False),
        (FrozenFrame(), 32, False),
        (PoseAdain(), 63, True),
    ],
)
def test_anchors(adapter: Adapter, frames: int, to_the_end: bool) -> None:
    def transfer(clip: Clip) -> Clip:
        return adapter.transfer(Take(clip), STYLE, rng=np.random.default_rng(0))

    found = measured_look_ahead(transfer, CLIP)
    assert (found.frames, found.to_the_end, found.reason) == (frames, to_the_end, "")


def test_random_answers_have_no_look_ahead() -> None:
    rng = np.random.default_rng(0)

    def transfer(clip: Clip) -> Clip:
        return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + rng.normal(size=3))

    found = measured_look_ahead(transfer, CLIP)
    assert (found.frames, found.reason) == (None, "two equal calls gave different outputs")


def test_a_method_that_picks_by_the_whole_clip_is_found_out() -> None:
    """One of two stored answers, by the mean height of the root: most small changes leave the choice as it is."""
    low, high = random_clip(64, seed=8), random_clip(64, seed=9)

    def transfer(clip: Clip) -> Clip:
        return low if clip.root_xyz_m[:, 1].mean() < CLIP.root_xyz_m[:, 1].mean() - 0.002 else high

    found = measured_look_ahead(transfer, CLIP)
    assert found.frames is not None and found.frames > 16


def test_a_fault_on_the_motion_itself_is_no_matter_of_look_ahead() -> None:
    def transfer(clip: Clip) -> Clip:
        raise MethodFailed("always")

    with pytest.raises(MethodFailed, match="always"):
        measured_look_ahead(transfer, CLIP)


def test_a_method_that_refuses_changed_motion_has_none() -> None:
    def transfer(clip: Clip) -> Clip:
        if not np.array_equal(clip.root_xyz_m, CLIP.root_xyz_m):
            raise MethodFailed("I know this motion only")
        return clip

    found = measured_look_ahead(transfer, CLIP)
    assert found.frames is None
    assert "a call on changed motion failed: MethodFailed: I know this motion only" in found.reason
