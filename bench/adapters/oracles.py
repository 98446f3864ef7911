"""Anchor rows that see what adapters never see: true labels, other parts, the generator behind the data."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from bench.adapters.anchors import Anchor
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.pose import random_start

TrueAnswer = Callable[[str, int, int, str], Clip]
"""``true_answer(content_take_id, start_frame, n_frames, target_style)``: known for procedural data only."""


PerformedBy = Callable[[str, str, str], Clip]
"""``performed_by(content_take_id, target_style, key)``: the take's task done by another actor; procedural data only."""

WINDOW_TRACKS = ("transfer", "transfer/self", "transfer/foreign", "latent")


@dataclass(frozen=True, eq=False)
class World:
    """What oracles see beyond their task.

    Attributes
    ----------
    fit : what methods are trained on.
    disjoint : takes that are neither sources nor in the Frechet reference, where the protocol has such.
    takes : every take by its id, under native labels.
    true_answer, performed_by : known for procedural data only.
    """

    fit: Sequence[Take]
    disjoint: Sequence[Take]
    takes: Mapping[str, Take] = field(default_factory=dict)
    true_answer: TrueAnswer | None = None
    performed_by: PerformedBy | None = None


class Oracle(Anchor):
    """An anchor that answers with full knowledge.

    The labels of the take that :meth:`answer` returns are those under which the row is scored. ``tracks`` names the
    tracks and conditions (``transfer/self``; Park's tables count as their tracks) in which the answer means something.
    """

    tracks: ClassVar[tuple[str, ...]] = WINDOW_TRACKS
    needs_truth: ClassVar[bool] = False

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        """Answer one task: ``content`` is the source window with all labels, cut at ``start_frame`` of its take."""
        raise self._cannot("transfers")


class RealTest(Oracle):
    """The source itself under its own labels: what judges say of real motion they never saw."""

    name = "real-test"
    title = "real motion (test)"
    description = "the source window under its own content and style"
    draws_from = "test"
    tracks = ("transfer", "transfer/self", "latent")

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        return content


class RealDisjoint(Oracle):
    """A random fit window under its own labels: the floor of every distance at the same n."""

    name = "real-disjoint"
    title = "real motion (disjoint)"
    description = "a random window of real motion that is no source, under its own content and style"
    draws_from = "fit"

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        return random_window(world.disjoint, content.clip.n_frames, rng)


class LabelOracle(Oracle):
    """A real fit window with the source's content and the target style: the ceiling of recognition."""

    name = "label-oracle"
    title = "label oracle"
    description = "a random window of the fit part with the right content and style"
    draws_from = "fit"

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        right = [take for take in world.fit if (take.content, take.style) == (content.content, style.style)]
        if not right:
            raise BadData(f"the fit part has no take of {content.content} in {style.style}")
        return random_window(right, content.clip.n_frames, rng)


class ProceduralTruth(Oracle):
    """The true answer: the same performance rendered in the target style. Exists for procedural data only."""

    name = "procedural-truth"
    title = "procedural truth"
    description = "the source's performance rendered in the target style by the generator"
    draws_from = "generator"
    tracks = ("transfer", "transfer/self", "latent")
    needs_truth = True

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        if world.true_answer is None:
            raise BadData("true answers exist for the procedural dataset only")
        clip = world.true_answer(content.take_id, start_frame, content.clip.n_frames, str(style.style))
        return Take(clip, content=content.content, style=style.style)


def random_window(takes: Sequence[Take], n_frames: int, rng: np.random.Generator) -> Take:
    """A random window of a randomly drawn take, with that take's labels."""
    take = takes[int(rng.integers(len(takes)))]
    return take.with_clip(window(take.clip, random_start(take.clip, n_frames, rng), n_frames))
