"""Anchor rows of the gesture track that see what adapters never see. Their answers have a length of their own."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from bench.adapters.oracles import Oracle, TrueAnswer, World
from bench.datasets.joined import joined_clip, moved, piece_ids
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.clip import Clip

GESTURE_TRACKS = ("gesture",)


class WholeStyle(Oracle):
    """The whole style sequence: style error 0. ``copy-style`` is a part of it, as long as the source."""

    name = "copy-style-whole"
    title = "copy style (whole)"
    description = "the style sequence in its own length, on the source's bones"
    draws_from = "judge, test and real"
    tracks: ClassVar[tuple[str, ...]] = GESTURE_TRACKS

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        return style.with_clip(moved(style.clip, content.clip.skeleton, content.clip.fps))


class RealAnswer(Oracle):
    """The source's scenario in the target style, from other takes: a real answer, in the timing of its own takes."""

    name = "real-answer"
    title = "real answer"
    description = "the source's scenario in the target style, performed by takes of the fit part"
    draws_from = "fit"
    tracks: ClassVar[tuple[str, ...]] = GESTURE_TRACKS

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        return other_performance(content, str(style.style), world)


class TakeToTake(Oracle):
    """The source's scenario in its own style, from other takes: the floor of the content error."""

    name = "take-to-take"
    title = "take to take"
    description = "the source's scenario in its own style, performed by takes of the fit part"
    draws_from = "fit"
    tracks: ClassVar[tuple[str, ...]] = GESTURE_TRACKS

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        return other_performance(content, str(content.style), world)


class GestureTruth(Oracle):
    """The true answer: every piece of the source rendered in the target style. Exists for procedural data only."""

    name = "gesture-truth"
    title = "procedural truth"
    description = "the source's performances rendered in the target style by the generator, in the source's timing"
    draws_from = "generator"
    needs_truth: ClassVar[bool] = True
    tracks: ClassVar[tuple[str, ...]] = GESTURE_TRACKS

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        if world.true_answer is None:
            raise BadData("true answers exist for the procedural dataset only")
        clip = true_sequence(content, str(style.style), world.takes, world.true_answer)
        return Take(clip, content=content.content, style=style.style)


class GestureImitation(Oracle):
    """A performed imitation: another actor performs the source's scenario in the target style.

    Kuriyama et al. 2022, Table 1, where the actor imitates a transfer. A reference, never a bound.
    """

    name = "gesture-imitation"
    title = "performed imitation"
    description = "the source's scenario performed in the target style by an actor whom no take shows"
    draws_from = "generator"
    needs_truth: ClassVar[bool] = True
    tracks: ClassVar[tuple[str, ...]] = GESTURE_TRACKS

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        performed_by = world.performed_by
        if performed_by is None:
            raise BadData("imitations exist for the procedural dataset only")
        clips = [performed_by(take_id, str(style.style), "0") for take_id in piece_ids(content.take_id)]
        clip = joined_clip(clips, content.clip.skeleton, content.clip.fps)
        return Take(clip, content=content.content, style=style.style)


def other_performance(content: Take, style: str, world: World) -> Take:
    """The sequence of the fit part that performs the content's scenario in a style.

    Raises
    ------
    BadData : there is none.
    """
    found = [take for take in world.fit if (take.content, take.style) == (content.content, style)]
    if not found:
        raise BadData(f"the fit part has no sequence of {content.content} in {style}")
    return found[0]


def true_sequence(content: Take, style: str, takes: Mapping[str, Take], true_answer: TrueAnswer) -> Clip:
    """The pieces of a content sequence rendered in a style and joined as the content is: the same timing.

    ``takes`` holds the pieces by take id.
    """
    clips = [true_answer(i, 0, takes[i].clip.n_frames, style) for i in piece_ids(content.take_id)]
    return joined_clip(clips, content.clip.skeleton, content.clip.fps)


GESTURE_ORACLES: tuple[type[Oracle], ...] = (WholeStyle, RealAnswer, TakeToTake, GestureTruth, GestureImitation)
"""The anchor rows of this module."""
