"""Look-ahead, measured: how far into the future a method's answer for a frame reaches."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from bench.motion import quat
from bench.motion.clip import Clip

PROBED_FRAMES = (0, 15, 30, 45)
"""Output frames that are looked at: different phases of a network that halves the frame rate twice."""
TOLERANCE = 1e-6
"""Radians and metres by which an output may move without counting as changed."""
TURN_RAD, SHIFT_M = 1.5, 0.5
"""How far later frames are changed: a method that picks from stored motion does not notice a little."""
N_CHANGES = 2
"""Draws of changed motion; one that moves the output is enough."""


@dataclass(frozen=True)
class LookAhead:
    """Later input frames that an output frame depends on.

    Attributes
    ----------
    frames : the largest number found, None where it cannot be told.
    to_the_end : True where the answer depends on the last frame of the window: the window bounds the number.
    reason : why there is no number.
    """

    frames: int | None
    to_the_end: bool = False
    reason: str = ""


class _Refused(Exception):
    """The method did not answer changed motion."""


def measured_look_ahead(transfer: Callable[[Clip], Clip], clip: Clip, *, seed: int = 0) -> LookAhead:
    """Change the input from some frame on and see which outputs before it move.

    Parameters
    ----------
    transfer : one call of the method with everything but the source fixed, the generator's seed included.
    clip : the source window.
    seed : draws the changed motion.
    """
    plain, again = transfer(clip), transfer(clip)
    if any(_differs(plain, again, frame) for frame in range(clip.n_frames)):
        return LookAhead(None, reason="two equal calls gave different outputs")
    rng = np.random.default_rng(seed)
    changes = [_changed(clip, rng) for _ in range(N_CHANGES)]
    reach, to_the_end = 0, False
    try:
        for frame in PROBED_FRAMES:
            if frame + reach + 1 < clip.n_frames:
                reach = _reach(transfer, clip, changes, plain, frame, reach)
                to_the_end |= frame + reach == clip.n_frames - 1
    except _Refused as error:
        # Motion that nobody performs may be refused; that says nothing about the calls that are timed.
        return LookAhead(None, reason=f"a call on changed motion failed: {error}")
    return LookAhead(reach, to_the_end)


def _reach(
    transfer: Callable[[Clip], Clip], clip: Clip, changes: Sequence[Clip], plain: Clip, frame: int, at_least: int
) -> int:
    """Bisection over the first changed frame: a later change cannot be seen where an earlier one is not."""

    def answer(mixed: Clip) -> Clip:
        try:
            return transfer(mixed)
        except Exception as error:
            raise _Refused(f"{type(error).__name__}: {error}") from error

    def depends(ahead: int) -> bool:
        return any(_differs(answer(_spliced(clip, changed, frame + ahead)), plain, frame) for changed in changes)

    if not depends(at_least + 1):
        return at_least
    low, high = at_least + 1, clip.n_frames - 1 - frame
    while low < high:
        middle = (low + high + 1) // 2
        low, high = (middle, high) if depends(middle) else (low, middle - 1)
    return low


def _spliced(clip: Clip, changed: Clip, start: int) -> Clip:
    return clip.with_motion(
        np.concatenate([clip.rotations_wxyz[:start], changed.rotations_wxyz[start:]]),
        np.concatenate([clip.root_xyz_m[:start], changed.root_xyz_m[start:]]),
    )


def _changed(clip: Clip, rng: np.random.Generator) -> Clip:
    turns = quat.from_rotation_vector(rng.uniform(-TURN_RAD, TURN_RAD, (*clip.rotations_wxyz.shape[:2], 3)))
    shift = rng.uniform(-SHIFT_M, SHIFT_M, clip.root_xyz_m.shape)
    return clip.with_motion(quat.multiply(clip.rotations_wxyz, turns), clip.root_xyz_m + shift)


def _differs(one: Clip, other: Clip, frame: int) -> bool:
    a, b = one.rotations_wxyz[frame], other.rotations_wxyz[frame]
    # Twice the chord: the arc cosine of a dot product is blind below 1e-8.
    apart = np.minimum(np.linalg.norm(a - b, axis=-1), np.linalg.norm(a + b, axis=-1))
    moved = np.abs(one.root_xyz_m[frame] - other.root_xyz_m[frame]).max()
    return bool(2.0 * apart.max() > TOLERANCE or moved > TOLERANCE)
