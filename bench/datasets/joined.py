"""Sequences joined from takes: longer motion than a dataset has. Their ids say what they are joined from."""

from __future__ import annotations

from collections.abc import Sequence

from bench.datasets.take import Take
from bench.motion.clip import Clip
from bench.motion.edit import join, resample
from bench.motion.pose import onto_skeleton
from bench.motion.skeleton import Skeleton

BLEND_S = 0.3
"""Seconds over which motion is blended wherever pieces are joined."""


def joined_take(name: str, pieces: Sequence[Take], skeleton: Skeleton, fps: float, *, content: str) -> Take:
    """Takes of one style one after the other, as a take with id ``name:piece+piece+...``.

    Raises
    ------
    BadInput : no piece.
    """
    clip = joined_clip([piece.clip for piece in pieces], skeleton, fps)
    take_id = f"{name}:{'+'.join(piece.take_id for piece in pieces)}"
    return Take(clip, take_id, pieces[0].dataset, content=content, style=pieces[0].style)


def joined_clip(clips: Sequence[Clip], skeleton: Skeleton, fps: float) -> Clip:
    """Clips resampled, moved onto one skeleton, and joined with blends of ``BLEND_S``.

    Raises
    ------
    BadInput : no clip.
    """
    return join([moved(clip, skeleton, fps) for clip in clips], BLEND_S)


def moved(clip: Clip, skeleton: Skeleton, fps: float) -> Clip:
    """A clip on another skeleton and at another frame rate; the clip itself where it has both already."""
    resampled = resample(clip, fps)
    return resampled if resampled.skeleton.same_bones(skeleton) else onto_skeleton(resampled, skeleton)


def piece_ids(take_id: str) -> tuple[str, ...]:
    """Ids of the takes that a sequence is joined from."""
    return tuple(take_id.partition(":")[2].split("+"))
