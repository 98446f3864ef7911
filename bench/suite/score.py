"""Scoring a cell: judge its motions, compute the metrics that the store lacks, collect the rest."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from bench.arrays import FloatArray
from bench.datasets.pack import Pack
from bench.motion.edit import window
from bench.protocols.base import Task
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet, load_judges
from bench.suite.judging import embed
from bench.suite.keys import embed_key, score_key
from bench.suite.motions import Motions
from bench.suite.reference import label_indices, load_reference
from bench.suite.scores import SCORES
from bench.suite.scores.base import Reference, Row, Scored
from bench.suite.store import Store
from reports.records import Measurement

ARRAYS_FILE = "arrays.npz"


@dataclass(frozen=True)
class ScoreSpec:
    """What a scoring process needs to know of the setting; hashable, so that a process opens it once."""

    store: str
    pack: str
    tasks_file: str
    tasks_digest: str
    judges_folder: str
    judges_digest: str
    reference_key: str
    protocol_id: str
    window_frames: int
    metrics: tuple[tuple[str, int], ...]
    """names with versions"""
    content_labels: tuple[str, ...]
    style_labels: tuple[str, ...]


@dataclass(frozen=True)
class CellScores:
    """All metrics of a cell, as stored."""

    motions_digest: str
    embedding: Embedding
    scored: dict[str, Scored]


class Scorer:
    """Opens a setting's judges and reference once and scores cells against them."""

    def __init__(self, spec: ScoreSpec) -> None:
        self.spec = spec
        self.store = Store(Path(spec.store))
        self.tasks = tuple(Task(**row) for row in json.loads(Path(spec.tasks_file).read_text()))

    @cached_property
    def judges(self) -> JudgeSet:
        return load_judges(Path(self.spec.judges_folder))

    @cached_property
    def reference(self) -> Reference:
        folder = self.store.folder("reference", self.spec.reference_key)
        return load_reference(
            folder,
            self.store.facts("reference", self.spec.reference_key),
            tasks=self.tasks,
            content_labels=self.spec.content_labels,
            style_labels=self.spec.style_labels,
            protocol_id=self.spec.protocol_id,
        )

    @cached_property
    def source(self) -> Motions:
        """The source windows of all tasks."""
        pack = Pack.open(Path(self.spec.pack))
        takes = [(pack.take(task.content_take_id), task.start_frame) for task in self.tasks]
        return Motions.of([take.with_clip(window(take.clip, start, self.spec.window_frames)) for take, start in takes])

    def keys(self, motions_digest: str, given: bool) -> dict[str, str]:
        """Metric name -> score key."""
        return {
            name: score_key(motions_digest, self.spec.reference_key, given, name, version)
            for name, version in self.spec.metrics
        }

    def missing(self, motions_digest: str, given: bool) -> list[str]:
        """Metrics that the store lacks for these motions."""
        return [name for name, key in self.keys(motions_digest, given).items() if not self.store.has("score", key)]

    def score(self, motions_key: str, *, given: bool) -> list[str]:
        """Compute what is missing for a cell; returns the names of the metrics that were computed."""
        digest = str(self.store.facts("motions", motions_key)["motions_digest"])
        missing = self.missing(digest, given)
        if missing:
            row = self._row(motions_key, digest, given)
            keys = self.keys(digest, given)
            for name in missing:
                scored = SCORES[name](row, self.reference)
                self.store.put("score", keys[name], partial(_write_scored, scored))
        return missing

    def collect(self, motions_key: str, *, given: bool) -> CellScores:
        """All stored metrics of a cell."""
        digest = str(self.store.facts("motions", motions_key)["motions_digest"])
        scored = {name: self._read(key) for name, key in self.keys(digest, given).items()}
        embedding = Embedding.load(self.store.folder("embed", embed_key(digest, self.spec.judges_digest)))
        return CellScores(digest, embedding, scored)

    def _row(self, motions_key: str, digest: str, given: bool) -> Row:
        motions = Motions.load(self.store.folder("motions", motions_key))
        key = embed_key(digest, self.spec.judges_digest)
        if not self.store.has("embed", key):
            self.store.put("embed", key, lambda folder: _write_embedding(folder, embed(self.judges, motions)))
        return Row(
            motions=motions,
            embedding=Embedding.load(self.store.folder("embed", key)),
            source=self.source,
            contents=label_indices(motions.contents, self.spec.content_labels),
            styles=label_indices(motions.styles, self.spec.style_labels),
            source_styles=label_indices([task.source_style for task in self.tasks], self.spec.style_labels),
            given=given,
        )

    def _read(self, key: str) -> Scored:
        folder = self.store.folder("score", key)
        rows = self.store.facts("score", key)["measurements"]
        with np.load(folder / ARRAYS_FILE, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        return Scored(
            tuple(Measurement.model_validate(row) for row in rows),
            _under("per_sample/", arrays),
            _under("replicates/", arrays),
        )


def _under(prefix: str, arrays: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    return {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}


def _write_scored(scored: Scored, folder: Path) -> dict[str, Any]:
    arrays = {f"per_sample/{name}": values for name, values in scored.per_sample.items()}
    arrays |= {f"replicates/{name}": values for name, values in scored.replicates.items()}
    np.savez(folder / ARRAYS_FILE, **arrays)  # type: ignore[arg-type]
    return {"measurements": [measurement.model_dump(mode="json") for measurement in scored.measurements]}


def _write_embedding(folder: Path, embedding: Embedding) -> dict[str, Any]:
    embedding.save(folder)
    return {"n": int(embedding.content_features.shape[1])}


@cache
def open_scorer(spec: ScoreSpec) -> Scorer:
    """One scorer per process and setting."""
    return Scorer(spec)


def pin_threads(threads: int) -> None:
    """Limit the linear algebra of this process: many small factorisations are far slower on contended threads."""
    threadpool_limits(limits=threads)


def score_in_process(spec: ScoreSpec, motions_key: str, given: bool) -> list[str]:
    """Entry point of pool processes: see :meth:`Scorer.score`."""
    return open_scorer(spec).score(motions_key, given=given)
