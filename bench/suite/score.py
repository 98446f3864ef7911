"""Scoring a cell: judge its motions, compute the metrics that the store lacks, collect the rest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np
from threadpoolctl import threadpool_limits

from bench.arrays import FloatArray
from bench.datasets.pack import Pack
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol, Task, stable_seed
from bench.suite.answering import source_of
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet, load_judges
from bench.suite.judging import stored_embedding
from bench.suite.keys import embed_key, score_key
from bench.suite.motions import Motions
from bench.suite.reference import label_indices, load_reference, trials_of
from bench.suite.samples import are_cut, cut_motions, samples_of
from bench.suite.scores import SCORES
from bench.suite.scores.base import Basis, PlainRow, Reference, Row, Scored
from bench.suite.scores.conditions import SegmentRow
from bench.suite.setting import read_tasks
from bench.suite.store import Store
from reports.bootstrap import cluster_counts
from reports.records import Measurement

ARRAYS_FILE = "arrays.npz"


@dataclass(frozen=True)
class ScoreSpec:
    """What a scoring process needs to know of the setting; hashable, so that a process opens it once."""

    store: str
    pack: str
    tasks_file: str
    judges_folder: str
    """empty where no judge takes part"""
    judges_digest: str
    reference_key: str
    truth_key: str
    """empty where the true answers are not known or not asked for"""
    protocol: str
    """label in PROTOCOLS"""
    profile: str
    metrics: tuple[tuple[str, int], ...]
    """names with versions"""
    content_labels: tuple[str, ...]
    style_labels: tuple[str, ...]
    fit_take_ids: tuple[str, ...]


@dataclass(frozen=True)
class CellScores:
    """All metrics of a cell, as stored. ``embedding`` is None where no judge takes part."""

    motions_digest: str
    samples: tuple[Task, ...]
    slices: dict[str, Any]
    embedding: Embedding | None
    scored: dict[str, Scored]


class Scorer:
    """Opens a setting's judges and reference once and scores cells against them."""

    def __init__(self, spec: ScoreSpec) -> None:
        self.spec = spec
        self.store = Store(Path(spec.store))
        self.tasks = read_tasks(Path(spec.tasks_file))

    @cached_property
    def protocol(self) -> Protocol:
        return PROTOCOLS[self.spec.protocol]

    @cached_property
    def judges(self) -> JudgeSet:
        return load_judges(Path(self.spec.judges_folder))

    @cached_property
    def pack(self) -> Pack:
        return Pack.open(Path(self.spec.pack))

    @cached_property
    def samples(self) -> tuple[Task, ...]:
        """What is scored: the tasks, or what the track makes of them."""
        return samples_of(self.protocol, self.tasks, self.pack)

    @cached_property
    def basis(self) -> Basis:
        """What all rows share, without judges."""
        clusters = np.array([task.content_take_id for task in self.samples])
        return Basis(
            tasks=self.samples,
            content_labels=self.spec.content_labels,
            style_labels=self.spec.style_labels,
            counts=cluster_counts(clusters, seed=stable_seed("bootstrap", self.protocol.label)),
            pack=self.pack,
            fit_take_ids=self.spec.fit_take_ids,
            truth=Motions.load(self.store.folder("truth", self.spec.truth_key)) if self.spec.truth_key else None,
            trials=trials_of(self.protocol, self.spec.profile, clusters),
        )

    @cached_property
    def reference(self) -> Basis | Reference:
        """What rows are scored against."""
        if not self.spec.judges_folder:
            return self.basis
        key = self.spec.reference_key
        folder = self.store.folder("reference", key)
        return load_reference(folder, self.store.facts("reference", key), self.basis, self.judges)

    @cached_property
    def source(self) -> Motions:
        """The contents of all tasks."""
        return Motions.of([source_of(task, self.pack, self.protocol.fps) for task in self.tasks])

    @cached_property
    def cut_source(self) -> Motions:
        """What the outputs' windows are compared with."""
        return cut_motions(self.source, self.tasks, self.samples)

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
            row = self._row(Motions.load(self.store.folder("motions", motions_key)), given)
            keys = self.keys(digest, given)
            for name in missing:
                scored = SCORES[name](row, self.reference)
                self.store.put("score", keys[name], partial(_write_scored, scored))
        return missing

    def collect(self, motions_key: str, *, given: bool) -> CellScores:
        """All stored metrics of a cell."""
        digest = str(self.store.facts("motions", motions_key)["motions_digest"])
        scored = {name: self._read(key) for name, key in self.keys(digest, given).items()}
        embedding = self._known_embedding(motions_key, digest) if self.spec.judges_folder else None
        return CellScores(digest, self.samples, dict(self.basis.slices), embedding, scored)

    def _known_embedding(self, motions_key: str, digest: str) -> Embedding:
        """What the judges said; the motions themselves are read only where they were cut before they were judged."""
        key = embed_key(digest, self.spec.judges_digest)
        if not are_cut(self.tasks) and self.store.has("embed", key):
            return Embedding.load(self.store.folder("embed", key))
        motions = Motions.load(self.store.folder("motions", motions_key))
        return self._judged(cut_motions(motions, self.tasks, self.samples))

    def _row(self, uncut: Motions, given: bool) -> PlainRow:
        motions = cut_motions(uncut, self.tasks, self.samples)
        if not self.spec.judges_folder:
            return PlainRow(motions, self.cut_source)
        judged = Row(
            motions=motions,
            source=self.cut_source,
            embedding=self._judged(motions),
            contents=label_indices(motions.contents, self.spec.content_labels),
            styles=label_indices(motions.styles, self.spec.style_labels),
            source_styles=label_indices([task.source_style for task in self.samples], self.spec.style_labels),
            given=given,
        )
        if motions is uncut:
            return judged
        return SegmentRow(**vars(judged), uncut=uncut, uncut_source=self.source, sequences=self.tasks)

    def _judged(self, motions: Motions) -> Embedding:
        return stored_embedding(self.judges, motions, self.store)

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


@lru_cache(maxsize=2)
def open_scorer(spec: ScoreSpec) -> Scorer:
    """One scorer per process and setting; few are kept, for a process may live through many settings."""
    return Scorer(spec)


def pin_threads(threads: int) -> None:
    """Limit the linear algebra of this process: many small factorisations are far slower on contended threads."""
    threadpool_limits(limits=threads)


def score_in_process(spec: ScoreSpec, motions_key: str, given: bool) -> list[str]:
    """Entry point of pool processes: see :meth:`Scorer.score`."""
    return open_scorer(spec).score(motions_key, given=given)
