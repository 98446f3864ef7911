"""Protocols: named, versioned recipes; and the task, one request to a method."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from bench.datasets.take import Take


@dataclass(frozen=True)
class Task:
    """One request: a window of a content take in the style of another take.

    Attributes
    ----------
    sample_id : ``s0000``, position in the protocol's fixed list.
    content_take_id, start_frame : where the source window is cut.
    style_take_id : the style reference, handed over whole.
    content, source_style, target_style : judged labels; the source's and the wanted ones.
    seed : seeds the generator that the method is given.
    part : body part to be changed, in tracks that change parts; empty elsewhere.
    weight : share of the target style, in the interpolation track; 1 elsewhere.
    start_take_id : the style that interpolation starts from; empty is the source itself.
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
    part: str = ""
    weight: float = 1.0
    start_take_id: str = ""

    @property
    def same_content(self) -> bool:
        """True where the style reference shows the source's content too."""
        return self.content == self.reference_content

    def as_dict(self) -> dict[str, Any]:
        return dict(vars(self))


MakeTasks = Callable[[Sequence[Take], int, int], list[Task]]
"""``make_tasks(test_takes, n, seed)``: the first n tasks of the fixed list."""


@dataclass(frozen=True)
class Protocol:
    """A row of the PROTOCOLS table. Its version fixes data, split, samples, windows and judges.

    Attributes
    ----------
    name, version, track, summary : ``stylebench-transfer``, 1, ``transfer``, one sentence.
    needs : the capability an adapter must have.
    window_frames, fps : one sample.
    n_samples : profile -> number of samples.
    metrics : names of METRICS computed in it.
    primary : the metric and slice rows are ordered by.
    make_tasks : the fixed list.
    facts : switches and choices that a reader needs beside the numbers.
    """

    name: str
    version: int
    track: str
    summary: str
    needs: str
    window_frames: int
    fps: float
    n_samples: Mapping[str, int]
    metrics: tuple[str, ...]
    primary: tuple[str, str]
    make_tasks: MakeTasks
    facts: Mapping[str, str] = field(default_factory=dict)

    @property
    def protocol_id(self) -> str:
        return f"{self.name}@{self.version}"


def stable_seed(*parts: str) -> int:
    """A 63-bit seed from strings: the same on every machine."""
    digest = hashlib.blake2b("|".join(parts).encode(), digest_size=8).digest()
    return int.from_bytes(digest, "big") >> 1
