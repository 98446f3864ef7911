"""How a worker has one task answered, by track: what the adapter is given, and what its answer is checked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from bench.adapters.answers import checked_answer
from bench.adapters.base import Adapter
from bench.adapters.oracles import Oracle, World
from bench.adapters.piecewise import in_windows
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.motion.clip import Clip
from bench.motion.edit import crop, resample, window
from bench.protocols.base import Task
from bench.protocols.prediction import PAST_S

Answer = Callable[[Task], Take]
"""From a task to the answer, with the labels under which it is scored."""


def answering(adapter: Adapter, track: str, fps: float, pack: Pack, world: Callable[[], World]) -> Answer:
    """The function that has ``adapter`` answer the tasks of a track whose contents come at ``fps``."""
    if isinstance(adapter, Oracle):
        return _OracleAnswers(adapter, fps, pack, world())
    return ANSWERS[track](adapter, fps, pack)


@dataclass(frozen=True)
class _OracleAnswers:
    oracle: Oracle
    fps: float
    pack: Pack
    world: World

    def __call__(self, task: Task) -> Take:
        content = source_of(task, self.pack, self.fps)
        style = self.pack.take(task.style_take_id)
        take = self.oracle.answer(content, task.start_frame, style, self.world, rng=np.random.default_rng(task.seed))
        n_frames = task.n_frames or take.clip.n_frames
        clip = checked_answer(take.clip, content.clip, task.sample_id, n_frames=n_frames, own_bones=True)
        return take.with_clip(clip)


def content_for(adapter: Adapter, take: Take) -> Take:
    """A content take with the labels that the adapter asked for, and no other."""
    traits = adapter.traits
    return take.hidden(content=traits.needs_content_label, style=traits.needs_source_style_label)


def style_for(adapter: Adapter, take: Take) -> Take:
    """A style reference with the label that the adapter asked for, and no other."""
    return take.hidden(content=False, style=adapter.traits.needs_style_label)


@dataclass(frozen=True)
class _Asked:
    """An adapter with the labels it declared to need, and nothing else."""

    adapter: Adapter
    fps: float
    pack: Pack

    def _style(self, take_id: str) -> Take:
        return style_for(self.adapter, self.pack.take(take_id))


class _FromContent(_Asked, ABC):
    """One content in, the same frames out."""

    def __call__(self, task: Task) -> Take:
        content = source_of(task, self.pack, self.fps)
        clip = self._answer(task, content_for(self.adapter, content))
        return Take(checked_answer(clip, content.clip, task.sample_id), content=task.content, style=task.target_style)

    def _answer(self, task: Task, content: Take) -> Clip:
        traits = self.adapter.traits
        n_frames = traits.designed_input_frames
        if not (traits.only_designed_input and n_frames) or content.clip.n_frames == n_frames:
            return self._call(task, content)
        return in_windows(content.clip, n_frames, lambda clip: self._call(task, content.with_clip(clip)))

    @abstractmethod
    def _call(self, task: Task, content: Take) -> Clip:
        """The adapter's answer for a content of a length that it takes."""


class _Transfer(_FromContent):
    def _call(self, task: Task, content: Take) -> Clip:
        style = self._style(task.style_take_id)
        if "transfers" not in self.adapter.capabilities():
            return _streamed(self.adapter, content, style, rng=_rng(task))
        return self.adapter.transfer(content, style, rng=_rng(task))


class _Sample(_FromContent):
    def _call(self, task: Task, content: Take) -> Clip:
        return self.adapter.sample(content, task.target_style, rng=_rng(task))


class _Parts(_FromContent):
    def _call(self, task: Task, content: Take) -> Clip:
        styles = {task.part: self._style(task.style_take_id)}
        return self.adapter.transfer_parts(content, styles, rng=_rng(task))


class _Interpolate(_FromContent):
    def _call(self, task: Task, content: Take) -> Clip:
        named = task.source_style if self.adapter.traits.needs_style_label else None
        start = self._style(task.start_take_id) if task.start_take_id else Take(content.clip, style=named)
        styles = [(start, 1.0 - task.weight), (self._style(task.style_take_id), task.weight)]
        if task.part:
            return self.adapter.interpolate_parts(content, task.part, styles, rng=_rng(task))
        return self.adapter.interpolate(content, styles, rng=_rng(task))


class _Predict(_Asked):
    """Single frames from the true past; the answer's bones are its own."""

    def __call__(self, task: Task) -> Take:
        take = self.pack.take(task.content_take_id)
        n_past = round(PAST_S * take.clip.fps)
        past = crop(take.clip, task.start_frame - n_past, n_past)
        path = take.clip.root_xyz_m[task.start_frame : task.start_frame + n_past, [0, 2]]
        clip = self.adapter.predict(past, self._style(task.style_take_id), path)
        frame = crop(take.clip, task.start_frame, 1)
        answer = checked_answer(clip, frame, task.sample_id, own_bones=True)
        return Take(answer, content=task.content, style=task.target_style)


ANSWERS: dict[str, Callable[[Adapter, float, Pack], Answer]] = {
    "transfer": _Transfer,
    "latent": _Sample,
    "parts": _Parts,
    "interpolation": _Interpolate,
    "gesture": _Transfer,
    "prediction": _Predict,
}
"""Track -> how its tasks are answered. The runtime track generates nothing."""


def source_of(task: Task, pack: Pack, fps: float) -> Take:
    """The content of a task with all its labels: a window of its take, or the whole take, at ``fps``."""
    take = pack.take(task.content_take_id)
    if task.n_frames:
        return take.with_clip(window(take.clip, task.start_frame, task.n_frames))
    return take.with_clip(resample(take.clip, fps))


def _streamed(adapter: Adapter, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
    """The answer of an adapter that only streams: the content's frames one after the other."""
    at_rate = style.with_clip(resample(style.clip, content.clip.fps))
    stream = adapter.open_stream(at_rate, content_label=content.content, rng=rng)
    frames = [stream.step(*frame) for frame in zip(content.clip.rotations_wxyz, content.clip.root_xyz_m, strict=True)]
    return content.clip.with_motion(np.stack([f[0] for f in frames]), np.stack([f[1] for f in frames]))


def _rng(task: Task) -> np.random.Generator:
    return np.random.default_rng(task.seed)
