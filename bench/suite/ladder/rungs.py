"""The ladders: each corrupts a set of real windows under their own labels, level by level."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.datasets.take import Take
from bench.motion import corrupt
from bench.motion.clip import Clip
from bench.motion.edit import mirror
from bench.protocols.base import stable_seed


@dataclass(frozen=True, eq=False)
class Material:
    """What ladders are made of, one entry a sample.

    Attributes
    ----------
    samples : real windows of the test part.
    others : windows of the test part with the same content in another style.
    lookups : windows of the fit part with the same content and style.
    """

    samples: tuple[Take, ...]
    others: tuple[Take, ...]
    lookups: tuple[Take, ...]


Corruption = Callable[[Material, float, np.random.Generator], list[Take]]


@dataclass(frozen=True)
class Ladder:
    """One corruption with its levels, the least first; level 0, the real windows, is common to all ladders.

    Attributes
    ----------
    name : as in tables and stored numbers.
    summary : what is done to a window.
    unit : of the levels.
    """

    name: str
    summary: str
    unit: str
    levels: tuple[float, ...]
    corrupted: Corruption

    def rung(self, material: Material, level: float) -> list[Take]:
        """The samples at one level, with the labels they are scored under. All levels draw the same random numbers."""
        return self.corrupted(material, level, np.random.default_rng(stable_seed("ladder", self.name)))


def _clip_by_clip(change: Callable[[Clip, float], Clip]) -> Corruption:
    return lambda material, level, rng: [take.with_clip(change(take.clip, level)) for take in material.samples]


def _at_random(change: Callable[[Clip, float, np.random.Generator], Clip]) -> Corruption:
    def corrupted(material: Material, level: float, rng: np.random.Generator) -> list[Take]:
        own = rng.spawn(len(material.samples))
        return [take.with_clip(change(take.clip, level, r)) for take, r in zip(material.samples, own, strict=True)]

    return corrupted


def _blended(material: Material, alpha: float, rng: np.random.Generator) -> list[Take]:
    pairs = zip(material.samples, material.others, strict=True)
    return [take.with_clip(corrupt.blended(take.clip, other.clip, alpha)) for take, other in pairs]


def _labels_shuffled(material: Material, share: float, rng: np.random.Generator) -> list[Take]:
    """Labels handed round among a share of the samples."""
    takes = list(material.samples)
    chosen = _chosen(takes, share, rng)
    for place, giver in zip(chosen, np.roll(chosen, 1), strict=True):
        labels = material.samples[giver]
        takes[place] = replace(takes[place], content=labels.content, style=labels.style)
    return takes


def _looked_up(material: Material, share: float, rng: np.random.Generator) -> list[Take]:
    """A share of the samples replaced by training motion with the right labels."""
    takes = list(material.samples)
    for place in _chosen(takes, share, rng):
        takes[place] = takes[place].with_clip(material.lookups[place].clip)
    return takes


def _chosen(takes: Sequence[Take], share: float, rng: np.random.Generator) -> NDArray[np.intp]:
    return np.asarray(rng.permutation(len(takes))[: round(share * len(takes))], dtype=np.intp)


LADDERS: dict[str, Ladder] = {
    ladder.name: ladder
    for ladder in (
        Ladder("noise", "rotation noise on every joint and frame", "rad", (0.03, 0.1, 0.2, 0.3),
               _at_random(corrupt.noisy)),
        Ladder("jitter", "noise on the root's position in every frame", "m", (0.005, 0.01, 0.02, 0.05),
               _at_random(corrupt.jittered)),
        Ladder("time warp", "one half slower, one faster", "share", (0.3, 0.6, 0.9),
               _clip_by_clip(corrupt.time_warped)),
        Ladder("foot slide", "the root drifts, and the feet with it", "m/s", (0.1, 0.3, 1.0),
               _clip_by_clip(corrupt.foot_slid)),
        Ladder("mirror", "left and right exchanged", "", (1.0,), _clip_by_clip(lambda clip, level: mirror(clip))),
        Ladder("joint swap", "rotations exchanged between joints of arm and leg", "pairs", (1.0, 2.0, 4.0),
               _clip_by_clip(lambda clip, level: corrupt.joints_swapped(clip, int(level)))),
        Ladder("blend", "towards real motion of the same content in another style: a transfer that stops half-way",
               "alpha", (0.25, 0.5, 0.75, 1.0), _blended),
        Ladder("label shuffle", "labels handed round among the samples, motion untouched", "share", (0.25, 0.5, 1.0),
               _labels_shuffled),
        Ladder("frozen frames", "the pose held before and after the middle of the window", "share",
               (0.5, 0.75, 1.0), _clip_by_clip(corrupt.frozen)),
        Ladder("dropped frames", "frames lost, the one before shown instead", "share", (0.1, 0.3, 0.6),
               _at_random(corrupt.frames_dropped)),
        Ladder("look-up", "replaced by training motion with the right labels", "share", (0.25, 0.5, 1.0), _looked_up),
        Ladder("global yaw", "turned about the up axis", "rad", (1.0, 3.0), _clip_by_clip(corrupt.turned)),
        Ladder("translation", "moved over the floor", "m", (1.0, 10.0), _clip_by_clip(corrupt.moved)),
        Ladder("resampling", "to a higher frame rate and back", "fps", (60.0, 120.0),
               _clip_by_clip(corrupt.resampled_and_back)),
    )
}  # fmt: skip
"""Every ladder, in the order of tables. The last three must be ignored."""
