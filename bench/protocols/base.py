"""Protocols: named, versioned recipes; and the task, one request to a method."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np

from bench.datasets.base import Dataset
from bench.datasets.take import Take
from bench.errors import BadData

NEUTRAL_STYLES = ("neutral", "normal")
"""Names of the style without style, in the datasets there are."""


@dataclass(frozen=True)
class Task:
    """One request: a window of a content take in the style of another take.

    Attributes
    ----------
    sample_id : ``s0000``, position in the protocol's fixed list.
    content_take_id, start_frame : where the source window is cut.
    style_take_id : the style reference, handed over whole.
    content, source_style, target_style : judged labels; the source's and the wanted ones.
    reference_content : content of the style reference.
    seed : seeds the generator that the method is given.
    n_frames : frames of the window; 0 is the whole take.
    part : body part to be changed, in tracks that change parts; empty elsewhere.
    weight : share of the target style, in the interpolation track; 1 elsewhere.
    start_take_id : the style that interpolation starts from; empty is the source itself.
    group : tasks that are scored together, in the tracks that compare several answers; empty elsewhere.
    segments : first frame and content of each piece of a joined sequence; empty elsewhere.
    """

    sample_id: str
    content_take_id: str
    start_frame: int
    style_take_id: str
    content: str
    source_style: str
    target_style: str
    reference_content: str
    seed: int
    n_frames: int = 64
    part: str = ""
    weight: float = 1.0
    start_take_id: str = ""
    group: str = ""
    segments: tuple[tuple[int, str], ...] = ()

    @property
    def same_content(self) -> bool:
        """True where the style reference shows the source's content too."""
        return self.content == self.reference_content

    def as_dict(self) -> dict[str, Any]:
        """The fields that say more than their default does, as JSON values."""
        return {
            field.name: getattr(self, field.name)
            for field in fields(self)
            if getattr(self, field.name) != field.default
        }

    @classmethod
    def from_dict(cls, row: Mapping[str, Any]) -> Task:
        """Inverse of :meth:`as_dict`, after a passage through JSON."""
        return cls(**{**row, "segments": tuple((int(s), str(c)) for s, c in row.get("segments", ()))})


@dataclass(frozen=True, eq=False)
class TaskPool:
    """What a task list is drawn from.

    Attributes
    ----------
    takes : takes of the protocol's source parts under judged labels.
    extra : what the protocol's ``extra_takes`` made: joined sequences, or takes of another dataset.
    """

    takes: Sequence[Take]
    extra: Sequence[Take] = ()


MakeTasks = Callable[[TaskPool, int, int], list[Task]]
"""``make_tasks(pool, n, seed)``: the first n tasks of the fixed list."""

ExtraTakes = Callable[[Mapping[str, Sequence[Take]], Dataset | None, int], list[Take]]
"""``extra_takes(takes by part under native labels, another dataset, seed)``: takes that the protocol makes itself."""


@dataclass(frozen=True)
class Trials:
    """Draws of ``samples`` out of a protocol's pool; where the pool is no larger, clusters are drawn with repeats."""

    n: int
    samples: int


@dataclass(frozen=True)
class Protocol:
    """A row of the PROTOCOLS table. Its version fixes data, split, samples, windows and judges.

    Attributes
    ----------
    name, version, track, summary : ``stylebench-transfer``, 1, ``transfer``, one sentence.
    condition : a tagged slice of a track, or a table of a paper; each has a task list and rows of its own.
    needs : the capability an adapter must have.
    judged : whether judges take part; contents then go by their judged labels, else by their native ones.
    fps : of contents and answers.
    n_samples : profile -> number of tasks.
    metrics : names of METRICS computed in it.
    truth_metrics : metrics added where the dataset knows the true answer of every task.
    primary : the metric and slice rows are ordered by.
    make_tasks : the fixed list.
    extra_takes : makes sequences that no dataset has; None where tasks use the dataset's own takes.
    extra_fit : makes the sequences that methods are trained on; None where that is the fit part itself.
    source_parts, real_parts, floor_parts : where sources and style references, the Frechet reference, and the real
        motion that is compared with it come from.
    trials : profile -> draws for metrics that are means over trials.
    facts : switches and choices that a reader needs beside the numbers.
    """

    name: str
    version: int
    track: str
    summary: str
    needs: str
    fps: float
    n_samples: Mapping[str, int]
    metrics: tuple[str, ...]
    primary: tuple[str, str]
    make_tasks: MakeTasks
    condition: str = "standard"
    judged: bool = True
    truth_metrics: tuple[str, ...] = ()
    extra_takes: ExtraTakes | None = None
    extra_fit: ExtraTakes | None = None
    source_parts: tuple[str, ...] = ("test",)
    real_parts: tuple[str, ...] = ("real",)
    floor_parts: tuple[str, ...] = ("fit",)
    trials: Mapping[str, Trials] = field(default_factory=dict)
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def protocol_id(self) -> str:
        return f"{self.name}@{self.version}"

    @property
    def label(self) -> str:
        """``park2021@1/table2``; without the condition where it is the standard one."""
        return self.protocol_id if self.condition == "standard" else f"{self.protocol_id}/{self.condition}"


def neutral_style(styles: Iterable[str]) -> str:
    """The style without style among some labels.

    Raises
    ------
    BadData : none of the known names is there.
    """
    there = set(styles)
    known = [style for style in NEUTRAL_STYLES if style in there]
    if not known:
        raise BadData(f"no neutral style among {', '.join(sorted(there))}", remedy="name it neutral or normal")
    return known[0]


def pick(takes: Sequence[Take], rng: np.random.Generator) -> Take:
    """A uniformly drawn take."""
    return takes[int(rng.integers(len(takes)))]


def stable_seed(*parts: str) -> int:
    """A 63-bit seed from strings: the same on every machine."""
    digest = hashlib.blake2b("|".join(parts).encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") >> 1
