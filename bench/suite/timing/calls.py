"""Calls prepared before the clock starts, and checked after it has stopped.

What is timed is the adapter's call from end to end: everything between motion in and motion out is the method's own.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.adapters.anchors import CopyContent, IdentityStream
from bench.adapters.answers import checked_answer
from bench.adapters.base import Adapter
from bench.adapters.piecewise import pad_end
from bench.datasets.joined import BLEND_S
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.errors import BadOutput
from bench.motion.clip import Clip
from bench.motion.edit import crop, join, resample, windows
from bench.suite.answering import content_for, style_for
from bench.suite.setting import read_tasks
from bench.suite.timing.plan import ONLINE, TimingJob, TimingPlan
from bench.suite.timing.stopwatch import Stopwatch


@dataclass(frozen=True, eq=False)
class TimedInput:
    """One source and style, with the labels that the adapter asked for; the source is as long as the plan needs."""

    content: Take
    style: Take

    def cut(self, start: int, n_frames: int) -> Take:
        """``n_frames`` of the source from ``start``, which counts on from the beginning where the source ends."""
        clip = self.content.clip
        return self.content.with_clip(crop(clip, start % (clip.n_frames - n_frames + 1), n_frames))


def timed_inputs(job: TimingJob, plan: TimingPlan, adapter: Adapter) -> tuple[TimedInput, ...]:
    """The first sources and styles of the task list, the same for every adapter but for the labels it may see."""
    pack = Pack.open(Path(job.pack))
    found = []
    for task in read_tasks(Path(job.tasks_file))[: plan.n_inputs]:
        content, style = pack.take(task.content_take_id), pack.take(task.style_take_id)
        source = content.with_clip(repeated(resample(content.clip, plan.fps), plan.input_frames))
        reference = style.with_clip(resample(style.clip, plan.fps))
        found.append(TimedInput(content_for(adapter, source), style_for(adapter, reference)))
    return tuple(found)


def repeated(clip: Clip, n_frames: int) -> Clip:
    """Exactly ``n_frames`` frames: the clip joined to itself as often as that takes, then cut."""
    copies = -(-n_frames // clip.n_frames)
    return crop(join([clip] * copies, BLEND_S), 0, n_frames)


@dataclass(frozen=True, eq=False)
class Block:
    """Calls that are ready to be timed.

    Attributes
    ----------
    call, empty : the adapter's call and one that does nothing, for the same arguments.
    arguments : of each call.
    check : raises where the outputs, in order, may not be scored.
    opening_ns : how long ``open_stream`` took; None where none was opened.
    """

    call: Callable[..., Any]
    empty: Callable[..., Any]
    arguments: Sequence[tuple[Any, ...]]
    check: Callable[[Sequence[Any]], None]
    opening_ns: int | None = None


class Calls:
    """Makes the blocks of one adapter."""

    def __init__(
        self, adapter: Adapter, inputs: Sequence[TimedInput], plan: TimingPlan, seed: int, stopwatch: Stopwatch
    ) -> None:
        self.adapter = adapter
        self.inputs = inputs
        self.plan = plan
        self.seed = seed
        self.stopwatch = stopwatch
        capabilities = adapter.capabilities()
        self.transfers = "transfers" in capabilities
        self.streams = "streams" in capabilities
        traits = adapter.traits
        self.only_frames = traits.designed_input_frames if traits.only_designed_input else None

    @property
    def slices(self) -> tuple[str, ...]:
        """What the adapter is timed on."""
        return tuple(self.plan.slices) if self.transfers else (ONLINE,)

    def block(self, slice_name: str, round_number: int, n: int) -> Block:
        """``n`` calls; those of one round are the same for all adapters, and no two of them have the same source."""
        first = round_number * self.plan.calls
        if slice_name != ONLINE:
            length = self.plan.slices[slice_name]
            cuts = [(self._input(call), call // len(self.inputs)) for call in range(first, first + n)]
            return self._transfers(cuts, length)
        source = self._input(round_number)
        if self.streams:
            return self._steps(source, first, self.plan.past_frames, n)
        return self._transfers([(source, first + call) for call in range(n)], self.plan.past_frames + 1)

    def first_block(self) -> tuple[str, Block]:
        """The call that comes first of all, with its slice; a stream has then seen nothing before."""
        slice_name = self.slices[0]
        return slice_name, self.block(slice_name, 0, 1) if self.transfers else self._steps(self._input(0), 0, 0, 1)

    def look_ahead_call(self) -> tuple[Callable[[Clip], Clip], Clip]:
        """A call as a function of the source alone, and the source window."""
        source = self._input(0)
        content = source.cut(0, self.only_frames or self.plan.look_ahead_window)

        def transfer(clip: Clip) -> Clip:
            output = self.adapter.transfer(content.with_clip(clip), source.style, rng=self._rng())
            return checked_answer(output, clip, "a call on changed motion")

        return transfer, content.clip

    def _input(self, place: int) -> TimedInput:
        return self.inputs[place % len(self.inputs)]

    def _rng(self) -> np.random.Generator:
        return np.random.default_rng(self.seed)

    def _transfers(self, cuts: Sequence[tuple[TimedInput, int]], length: int) -> Block:
        arguments = [(self._pieces(source.cut(start, length)), source.style) for source, start in cuts]

        def check(outputs: Sequence[Any]) -> None:
            for (pieces, _), answers in zip(arguments, outputs, strict=True):
                for (content, _), answer in zip(pieces, answers, strict=True):
                    checked_answer(answer, content.clip, f"a call on {content.clip.n_frames} frames")

        return Block(_answers_of(self.adapter), _answers_of(CopyContent()), arguments, check)

    def _pieces(self, content: Take) -> list[tuple[Take, np.random.Generator]]:
        """What is to be answered: the content, or windows of it for a method that knows one length only."""
        n_frames = self.only_frames or content.clip.n_frames
        padded = pad_end(content.clip, -(-content.clip.n_frames // n_frames) * n_frames)
        return [(content.with_clip(clip), self._rng()) for _, clip in windows(padded, n_frames, n_frames)]

    def _steps(self, source: TimedInput, first: int, past: int, n: int) -> Block:
        """``n`` steps of a stream that has been fed the ``past`` frames before them."""
        content = source.cut(first, past + n)
        frames = list(zip(content.clip.rotations_wxyz, content.clip.root_xyz_m, strict=True))
        rng = self._rng()
        start = self.stopwatch.now_ns()
        stream = self.adapter.open_stream(source.style, content_label=content.content, rng=rng)
        opening_ns = self.stopwatch.now_ns() - start
        before = [stream.step(*frame) for frame in frames[:past]]

        def check(outputs: Sequence[Any]) -> None:
            checked_answer(_clip_of([*before, *outputs], content.clip), content.clip, "a stream")

        return Block(stream.step, IdentityStream().step, frames[past:], check, opening_ns)


def _answers_of(adapter: Adapter) -> Callable[[Sequence[tuple[Take, np.random.Generator]], Take], list[Clip]]:
    return lambda pieces, style: [adapter.transfer(content, style, rng=rng) for content, rng in pieces]


def _clip_of(frames: Sequence[Any], like: Clip) -> Clip:
    try:
        rotations, roots = zip(*frames, strict=True)
        return like.with_motion(np.stack(rotations), np.stack(roots))
    except (TypeError, ValueError) as error:
        raise BadOutput(f"expected rotations [J, 4] and root [3] for each frame: {error}", where="a stream") from error
