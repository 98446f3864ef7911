"""Long contents for methods that answer windows of one length only: cut, answered window by window, joined again."""

from __future__ import annotations

from collections.abc import Callable

from bench.datasets.joined import BLEND_S
from bench.motion.clip import Clip
from bench.motion.edit import crop, join, pad_to, resample, window_starts

WINDOW_FPS = 30.0


def in_windows(content: Clip, n_frames: int, answer: Callable[[Clip], Clip]) -> Clip:
    """Answer consecutive windows of ``n_frames`` at 30 fps and join the answers, blended over ``BLEND_S``.

    The result has the content's frames and fps; the last window is padded where the content ends within it.
    """
    slow = resample(content, WINDOW_FPS)
    padded = pad_end(slow, -(-slow.n_frames // n_frames) * n_frames)
    starts = window_starts(padded.n_frames, n_frames, n_frames)
    joined = join([answer(crop(padded, start, n_frames)) for start in starts], BLEND_S)
    result = resample(crop(joined, 0, slow.n_frames), content.fps)
    return crop(pad_to(result, content.n_frames), 0, content.n_frames)


def pad_end(clip: Clip, n_frames: int) -> Clip:
    """Repeat the last pose up to ``n_frames``."""
    last = [min(frame, clip.n_frames - 1) for frame in range(n_frames)]
    return clip.with_motion(clip.rotations_wxyz[last], clip.root_xyz_m[last])
