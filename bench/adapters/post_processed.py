"""Any row with its answers cleaned by foot-skate removal: ``copy-content+park-ik`` is a row of its own.

The inner adapter is asked as ever, its answer is checked, then the legs are corrected (``bench.motion.cleanup``).
Contacts are those of the source, as the papers have it; the answers of oracles, which show other motion, keep their
own. A cleaned adapter looks at whole clips, so it neither streams nor predicts.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from bench.adapters.answers import checked_answer
from bench.adapters.base import Adapter, Description, ProgressCallback
from bench.adapters.oracles import Oracle, World
from bench.adapters.piecewise import in_windows
from bench.datasets.take import Take
from bench.motion.cleanup import IK_SETTINGS, IkSettings, planted_feet, remove_foot_skate
from bench.motion.clip import Clip

NOT_CLEANED = ("streams", "predicts")
"""Capabilities whose answers are single frames."""


def split_suffix(name: str) -> tuple[str, str]:
    """``copy-content+park-ik`` as ``copy-content`` and ``park-ik``; the second is empty where there is no suffix."""
    plain, _, suffix = name.rpartition("+")
    return (plain, suffix) if plain and suffix in IK_SETTINGS else (name, "")


def post_processed(inner: type[Adapter], suffix: str) -> type[Adapter]:
    """The class that answers as ``inner`` does and has its answers cleaned with the settings named ``suffix``."""
    settings = IK_SETTINGS[suffix]
    facts: dict[str, Any] = {
        "inner_class": inner,
        "settings": settings,
        "name": f"{inner.name}+{suffix}" if inner.name else "",
        "title": f"{inner.title or inner.name} + {settings.title}",
        "description": f"{inner.description or inner.title or inner.name}; planted feet held by IK",
        "kind": inner.kind,
        "draws_from": inner.draws_from,
        "traits": replace(inner.traits, look_ahead_frames=None, only_designed_input=False),
        "__module__": __name__,
        "__doc__": f"{inner.__name__} with {settings.title}.",
    }
    if issubclass(inner, Oracle):
        facts |= {"tracks": inner.tracks, "needs_truth": inner.needs_truth}
        return type("PostProcessedOracle", (PostProcessedOracle,), facts)
    return type("PostProcessed", (PostProcessed,), facts)


def plain(adapter: type[Adapter]) -> type[Adapter]:
    """The class whose answers are cleaned; the class itself where none are."""
    return adapter.inner_class if issubclass(adapter, _Cleaned) else adapter


def plain_instance(adapter: Adapter) -> Adapter:
    """As :func:`plain`, of an instance."""
    return adapter.inner if isinstance(adapter, _Cleaned) else adapter


class _Cleaned(Adapter):
    """What the classes made by :func:`post_processed` share: the inner adapter learns, is stored and is described."""

    inner_class: ClassVar[type[Adapter]]
    settings: ClassVar[IkSettings]

    def __init__(self) -> None:
        self.inner = self.inner_class()

    @classmethod
    def fits(cls) -> bool:
        return cls.inner_class.fits()

    @classmethod
    def capabilities(cls) -> tuple[str, ...]:
        return tuple(name for name in cls.inner_class.capabilities() if name not in NOT_CLEANED)

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self.inner.fit(takes, seed=seed, budget=budget, progress=progress)

    def save(self, folder: Path) -> None:
        self.inner.save(folder)

    def load(self, folder: Path) -> None:
        self.inner.load(folder)

    def describe(self) -> Description:
        return replace(self.inner.describe(), look_ahead_frames=None)


class PostProcessedOracle(_Cleaned, Oracle):
    """An oracle whose answers are cleaned by their own contacts."""

    def answer(self, content: Take, start_frame: int, style: Take, world: World, *, rng: np.random.Generator) -> Take:
        if not isinstance(self.inner, Oracle):
            raise self._cannot("transfers")
        take = self.inner.answer(content, start_frame, style, world, rng=rng)
        return take.with_clip(remove_foot_skate(take.clip, self.settings))


class PostProcessed(_Cleaned):
    """A method or anchor whose answers are cleaned by the contacts of the source."""

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self._cleaned(content, lambda part: self.inner.transfer(part, style, rng=rng))

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return self._cleaned(content, lambda part: self.inner.sample(part, style_label, rng=rng))

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        return self._cleaned(content, lambda part: self.inner.interpolate(part, styles, rng=rng))

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        return self._cleaned(content, lambda piece: self.inner.interpolate_parts(piece, part, styles, rng=rng))

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        return self._cleaned(content, lambda piece: self.inner.transfer_parts(piece, styles, rng=rng))

    def _cleaned(self, content: Take, call: Callable[[Take], Clip]) -> Clip:
        traits, n_frames = self.inner.traits, self.inner.traits.designed_input_frames
        if traits.only_designed_input and n_frames and content.clip.n_frames != n_frames:
            # Pieces are joined first: a foot may stand across a join.
            answer = in_windows(content.clip, n_frames, lambda clip: call(content.with_clip(clip)))
        else:
            answer = call(content)
        checked = checked_answer(answer, content.clip, self.name)
        return remove_foot_skate(checked, self.settings, planted_feet(content.clip, self.settings))
