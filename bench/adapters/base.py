"""The contract: how the suite talks to a method. Subclass ``Adapter`` and write the calls your method can answer.

The smallest adapter::

    from bench.adapters.base import Adapter

    class Mine(Adapter):
        name = "mine"

        def transfer(self, content, style, *, rng):
            return content.clip
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Protocol

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadConfig
from bench.motion.clip import Clip

ProgressCallback = Callable[[str, int, int], None]

CAPABILITIES: dict[str, str] = {
    "transfers": "transfer",
    "samples": "sample",
    "interpolates": "interpolate",
    "interpolates parts": "interpolate_parts",
    "transfers parts": "transfer_parts",
    "streams": "open_stream",
    "predicts": "predict",
    "describes": "describe",
}
"""Capability -> the method that provides it. An adapter has a capability when it overrides that method."""


@dataclass(frozen=True)
class Traits:
    """What an adapter declares about itself; shown in tables, never punished."""

    needs_content_label: bool = False
    """the content take's content label is passed instead of None"""
    needs_source_style_label: bool = False
    """the content take's style label is passed instead of None"""
    needs_style_label: bool = False
    """the style take's style label is passed instead of None"""
    designed_input_frames: int | None = None
    """window length the method was made for, at 30 fps"""
    only_designed_input: bool = False
    """answers windows of exactly that length only: longer contents are cut and joined again by the harness"""
    look_ahead_frames: int | None = None
    """future frames needed before a frame can be answered; None if the whole clip is"""
    trained_on: str = ""
    """for pretrained methods: which data; empty where ``fit`` does it"""
    uses_judge: bool = False
    """a judge of this harness was used in training or guidance"""


@dataclass(frozen=True)
class Description:
    """Facts for the runtime track."""

    parameters: int
    bytes_per_style: int
    designed_input_frames: int | None = None
    look_ahead_frames: int | None = None


class Stream(Protocol):
    """An open online transfer: one pose in, one pose out."""

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Answer one frame: ``[J, 4]`` and ``[3]`` in, the same out."""
        ...


class Adapter:
    """Base class of all adapters. Nothing but ``name`` and one capability is required.

    Labels of the takes passed in are None unless ``traits`` declares the need. Take ids and dataset names are never
    passed. An output has the content clip's skeleton, fps and number of frames.
    """

    name: ClassVar[str] = ""
    title: ClassVar[str] = ""
    description: ClassVar[str] = ""
    kind: ClassVar[str] = "method"
    draws_from: ClassVar[str] = ""
    traits: ClassVar[Traits] = Traits()

    device: str = "cpu"
    """where ``fit`` trains: ``cpu`` or ``cuda``; set by the harness"""
    checkpoints: Path | None = None
    """a folder that outlives an interrupted ``fit``; set by the harness, None where there is none"""

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        """Train on the fit part. Optional."""

    def save(self, folder: Path) -> None:
        """Store what ``fit`` learned into an existing, empty folder. Required where ``fit`` is overridden."""

    def load(self, folder: Path) -> None:
        """Restore what ``save`` stored."""

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        """The content's motion in the style's style."""
        raise self._cannot("transfers")

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        """The content's motion in a style given by its label."""
        raise self._cannot("samples")

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        """The content's motion in a mixture of styles; weights sum to 1, one style may be the source itself."""
        raise self._cannot("interpolates")

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        """As :meth:`interpolate`, for one body part; the rest of the body stays the content's."""
        raise self._cannot("interpolates parts")

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        """The content's motion with a style per body part (names in ``bench.motion.skeleton.PARTS``)."""
        raise self._cannot("transfers parts")

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        """Start an online transfer."""
        raise self._cannot("streams")

    def predict(self, past: Clip, style: Take, trajectory_xz_m: FloatArray) -> Clip:
        """The next frame after ``past``, one frame long.

        ``trajectory_xz_m`` ``[30, 2]`` is the root's path over the ground in the next second, the predicted frame
        first. A method that predicts positions answers with a skeleton whose bones fit them.
        """
        raise self._cannot("predicts")

    def describe(self) -> Description:
        """Parameter count and memory facts."""
        raise self._cannot("describes")

    @classmethod
    def capabilities(cls) -> tuple[str, ...]:
        """The capabilities this class overrides."""
        return tuple(c for c, call in CAPABILITIES.items() if getattr(cls, call) is not getattr(Adapter, call))

    @classmethod
    def fits(cls) -> bool:
        """True where the adapter learns from the fit part."""
        return cls.fit is not Adapter.fit

    @classmethod
    def digest_files(cls) -> tuple[Path, ...]:
        """For adapters of outside programs: the files that decide the answers; empty where the class's code does."""
        return ()

    def _cannot(self, capability: str) -> BadConfig:
        return BadConfig(
            f"adapter {self.name!r} does not declare that it {capability}",
            remedy=f"override {CAPABILITIES[capability]}() to take part in the tracks that need it",
        )
