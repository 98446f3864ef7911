"""Anchor rows without learning: rows whose meaning is known, so that every other row can be read against them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import ClassVar

import numpy as np

from bench.adapters.base import Adapter, Description, Stream
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.kinematics import yaw_aligned
from bench.motion.pose import (
    fitted_window,
    from_local_rotation_vectors,
    heading_removed,
    local_rotation_vectors,
    random_start,
)
from bench.motion.skeleton import PARTS

LEAST_DEVIATION = 1e-3
"""Floor of a channel's standard deviation in pose AdaIN (radians, statures): still channels stay still."""


class Anchor(Adapter):
    """An adapter that is a yardstick, not a contender: it stands apart in tables and carries no rank."""

    kind: ClassVar[str] = "anchor"


class CopyContent(Anchor):
    """Answers with the source itself: full content, no style."""

    name = "copy-content"
    title = "copy content"
    description = "the source, unchanged"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return content.clip

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return content.clip

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        return content.clip

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        return content.clip

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        return content.clip

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        return IdentityStream()

    def describe(self) -> Description:
        return Description(parameters=0, bytes_per_style=0, designed_input_frames=1, look_ahead_frames=0)


class IdentityStream:
    """The stream that answers every pose with itself."""

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        return rotations_wxyz, root_xyz_m


class CopyStyle(Anchor):
    """Answers with a window of the style reference: full style, no content."""

    name = "copy-style"
    title = "copy style"
    description = "a random window of the style reference, on the source's bones"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return fitted_window(style.clip, content.clip, random_start(style.clip, content.clip.n_frames, rng))

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        return self.transfer(content, max(styles, key=lambda pair: pair[1])[0], rng=rng)

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        return self.transfer(content, next(iter(styles.values())), rng=rng)


class Splice(Anchor):
    """The style reference's joints in the part, the source's everywhere else: locality without sense."""

    name = "splice"
    title = "splice"
    description = "joint rotations of a window of the style reference in the part, the source's elsewhere"
    draws_from = "test"

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        clip = content.clip
        for part, style in styles.items():
            clip = spliced(clip, CopyStyle().transfer(content, style, rng=rng), PARTS[part])
        return clip


class LinearBlend(Anchor):
    """Poses between windows of the styles, frame by frame: even, and without sense."""

    name = "linear-blend"
    title = "linear blend"
    description = "joint rotations between windows of the two styles, frame by frame"
    draws_from = "test"

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        (first, _), (second, weight) = styles
        start = rng.random()
        start_clip, end_clip = (_at_share(style.clip, content.clip, start) for style in (first, second))
        start_turned, start_yaw = heading_removed(start_clip)
        end_turned, _ = heading_removed(end_clip)
        mixed = quat.slerp(start_turned, end_turned, np.full(start_turned.shape[:2], weight))
        root = start_clip.root_xyz_m + weight * (end_clip.root_xyz_m - start_clip.root_xyz_m)
        rotations, _ = yaw_aligned(mixed, root, -start_yaw)
        return content.clip.with_motion(rotations, root)

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        return spliced(content.clip, self.interpolate(content, styles, rng=rng), PARTS[part])


class RepeatLast(Anchor):
    """The last pose again: hard to beat from one frame to the next."""

    name = "repeat-last"
    title = "repeat last frame"
    description = "the last frame of the past, unchanged"
    draws_from = "test"

    def predict(self, past: Clip, style: Take, trajectory_xz_m: FloatArray) -> Clip:
        return crop(past, past.n_frames - 1, 1)


def spliced(clip: Clip, other: Clip, joints: Sequence[int]) -> Clip:
    """``clip`` with the local rotations of some joints from ``other``; the root keeps its path and heading."""
    rotations = clip.rotations_wxyz.copy()
    turned, _ = heading_removed(other)
    _, yaw = heading_removed(clip)
    aligned, _ = yaw_aligned(turned, other.root_xyz_m, -yaw)
    rotations[:, list(joints)] = aligned[:, list(joints)]
    return clip.with_motion(rotations, clip.root_xyz_m)


def _at_share(clip: Clip, like: Clip, share: float) -> Clip:
    """The window that starts at a share of the possible starts: the same place for all weights of a mixture."""
    return fitted_window(clip, like, int(share * max(clip.n_frames - like.n_frames, 0)))


class CoinFlip(Anchor):
    """One of the two copies: marginal recognition of both kinds near a half, yet never both at once."""

    name = "coin-flip"
    title = "coin flip of the copies"
    description = "copy content or copy style, by a fair coin"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        row = CopyContent() if rng.random() < 0.5 else CopyStyle()
        return row.transfer(content, style, rng=rng)


class ConcatenatedHalves(Anchor):
    """First half source, second half style reference, the path continued without a jump."""

    name = "concatenated-halves"
    title = "concatenated halves"
    description = "first half of the source, then the style reference"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        source = content.clip
        half = source.n_frames // 2
        other = CopyStyle().transfer(content, style, rng=rng)
        rotations = np.concatenate([source.rotations_wxyz[:half], other.rotations_wxyz[half:]])
        jump = (source.root_xyz_m[half - 1] - other.root_xyz_m[half]) * np.array([1.0, 0.0, 1.0])
        root = np.concatenate([source.root_xyz_m[:half], other.root_xyz_m[half:] + jump])
        return source.with_motion(rotations, root)


class FrozenFrame(Anchor):
    """The source's middle pose, held: shows which metrics look at motion at all."""

    name = "frozen-frame"
    title = "frozen frame"
    description = "the source's middle pose, held still"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        source = content.clip
        frames = np.full(source.n_frames, source.n_frames // 2)
        return source.with_motion(source.rotations_wxyz[frames], source.root_xyz_m[frames])


class Noise(Anchor):
    """The source with independent rotation noise on every joint and frame."""

    draws_from = "test"
    level_rad: ClassVar[float] = 0.0

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        source = content.clip
        turns = quat.from_rotation_vector(rng.normal(0.0, self.level_rad, (*source.rotations_wxyz.shape[:2], 3)))
        return source.with_motion(quat.multiply(source.rotations_wxyz, turns), source.root_xyz_m)


class NoiseLow(Noise):
    """Barely visible jitter."""

    name = "noise-0.03"
    title = "noise 0.03 rad"
    description = "the source with rotation noise of 0.03 rad"
    level_rad = 0.03


class NoiseMiddle(Noise):
    """Clearly visible jitter."""

    name = "noise-0.1"
    title = "noise 0.1 rad"
    description = "the source with rotation noise of 0.1 rad"
    level_rad = 0.1


class NoiseHigh(Noise):
    """Jitter that destroys the motion."""

    name = "noise-0.3"
    title = "noise 0.3 rad"
    description = "the source with rotation noise of 0.3 rad"
    level_rad = 0.3


class PoseAdain(Anchor):
    """Adaptive instance normalisation on poses: each channel gets the style's mean and deviation over time.

    Huang and Belongie 2017, equation 8, applied to rotation vectors instead of features.
    """

    name = "pose-adain"
    title = "pose AdaIN"
    description = "per-channel mean and deviation over time taken from the style reference"
    draws_from = "test"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        source, other = content.clip, style.clip
        aligned_source, yaw = heading_removed(source)
        aligned_other, _ = heading_removed(other)
        reference = quat.mean(np.concatenate([aligned_source, aligned_other]))
        vectors = with_statistics_of(
            local_rotation_vectors(source, reference), local_rotation_vectors(other, reference)
        )
        scale = source.skeleton.stature_m / other.skeleton.stature_m
        root = source.root_xyz_m.copy()
        root[:, 1] = with_statistics_of(root[:, 1], other.root_xyz_m[:, 1] * scale)
        return from_local_rotation_vectors(vectors, reference, yaw, root, source)


def with_statistics_of(values: FloatArray, other: FloatArray) -> FloatArray:
    """``values`` ``[T, ...]`` shifted and scaled to the mean and deviation over time of ``other`` ``[T', ...]``."""
    deviation = np.maximum(values.std(axis=0), LEAST_DEVIATION)
    other_deviation = np.where(values.std(axis=0) > LEAST_DEVIATION, other.std(axis=0), 0.0)
    return np.asarray((values - values.mean(axis=0)) / deviation * other_deviation + other.mean(axis=0))
