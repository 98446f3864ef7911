"""Scoring every rung of every ladder with the judges and scores of the transfer track."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.base import Dataset
from bench.datasets.pack import Pack
from bench.datasets.split import deal
from bench.datasets.take import Take
from bench.errors import BadData
from bench.metrics import METRICS
from bench.motion.edit import window
from bench.motion.pose import random_start
from bench.protocols.base import Task, stable_seed
from bench.protocols.transfer import TRANSFER, WINDOW_FRAMES
from bench.suite.answering import source_of
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet
from bench.suite.judging import judges_for, stored_embedding
from bench.suite.ladder.rungs import LADDERS, Ladder, Material
from bench.suite.motions import Motions
from bench.suite.reference import build_reference, label_indices, load_reference, reference_key
from bench.suite.scores import SCORES
from bench.suite.scores.base import PRIMARY_SLICE, Basis, Reference, Row, Scored
from bench.suite.session import Progress
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from reports.bootstrap import cluster_counts
from reports.ladder import Rung

N_REPLICATES = 30
GIVEN = ("neighbour_ratio",)
"""Metrics under which the samples' own takes count as motion that was given: all of them are test motion."""


@dataclass(frozen=True, eq=False)
class Climber:
    """A dataset ready for its ladders: its material, and the reference that all rungs are scored against."""

    setting: Setting
    material: Material
    judges: JudgeSet
    reference: Reference
    base: Motions
    store: Store

    @property
    def metrics(self) -> tuple[str, ...]:
        """The transfer track's metrics, those against the true answer included: here the untouched window."""
        return (*TRANSFER.metrics, *TRANSFER.truth_metrics)

    def scored(self, takes: Sequence[Take]) -> dict[str, Scored]:
        """All metrics of one rung."""
        row = self._row(takes)
        rows = {True: replace(row, given=True), False: row}
        return {name: SCORES[name](rows[name in GIVEN], self.reference) for name in self.metrics}

    def _row(self, takes: Sequence[Take]) -> Row:
        motions, dataset = Motions.of(takes), self.setting.dataset
        return Row(
            motions=motions,
            source=self.base,
            embedding=stored_embedding(self.judges, motions, self.store),
            contents=label_indices(motions.contents, dataset.content_labels),
            styles=label_indices(motions.styles, dataset.style_labels),
            source_styles=label_indices([str(other.style) for other in self.material.others], dataset.style_labels),
            given=False,
        )


def measured(
    dataset: Dataset, n: int, store: Store, progress: Progress, ladders: Mapping[str, Ladder] = LADDERS
) -> list[Rung]:
    """Every metric on every rung of every ladder, on ``n`` windows of a dataset, by its judges.

    Raises
    ------
    BadData : as :func:`ready`.
    """

    def judging(what: str, done: int, total: int) -> None:
        progress("judges", what, done, total)

    found = judges_for(dataset, deal(dataset.takes), store, retrain=False, progress=judging)
    return climb(ready(dataset, n, store, found.judges, progress), progress, ladders)


def ready(dataset: Dataset, n: int, store: Store, judges: JudgeSet, progress: Progress) -> Climber:
    """Choose ``n`` windows, build the reference.

    Raises
    ------
    BadData : the dataset cannot serve the transfer track, or lacks what windows are mixed with.
    """
    setting = prepare(dataset, replace(TRANSFER, n_samples={"ladder": n}), "ladder", store)
    pack = Pack.open(setting.pack_folder)
    material, tasks = _material(setting, pack)
    setting = replace(setting, tasks=tasks)
    base = Motions.of(material.samples)
    clusters = np.array([task.content_take_id for task in tasks])
    basis = Basis(
        tasks=tasks,
        content_labels=dataset.content_labels,
        style_labels=dataset.style_labels,
        counts=cluster_counts(clusters, N_REPLICATES, seed=stable_seed("ladder")),
        pack=pack,
        fit_take_ids=setting.fit_take_ids,
        truth=base,
    )
    return Climber(setting, material, judges, _reference(setting, judges, basis, store, progress), base, store)


def climb(climber: Climber, progress: Progress, ladders: Mapping[str, Ladder] = LADDERS) -> list[Rung]:
    """Every metric on every rung; level 0 comes once a ladder, so that each ladder can be read alone."""
    n_rungs = 1 + sum(len(ladder.levels) for ladder in ladders.values())
    progress("ladder", "level 0", 0, n_rungs)
    start, done, found = climber.scored(climber.material.samples), 1, []
    for ladder in ladders.values():
        found += [_rung(climber, ladder, name, 0.0, [start]) for name in climber.metrics]
        seen = [start]
        for level in ladder.levels:
            progress("ladder", f"{ladder.name} {level:g}", done, n_rungs)
            seen.append(climber.scored(ladder.rung(climber.material, level)))
            found += [_rung(climber, ladder, name, level, seen) for name in climber.metrics]
            done += 1
    progress("ladder", "done", n_rungs, n_rungs)
    return found


def _rung(climber: Climber, ladder: Ladder, metric: str, level: float, seen: Sequence[dict[str, Scored]]) -> Rung:
    """The last of the levels seen so far, with how uncertain its distance from the first and the one before are."""
    value, draws = _value(seen[-1][metric])
    _, first = _value(seen[0][metric])
    _, before = _value(seen[max(len(seen) - 2, 0)][metric])
    return Rung(
        dataset=climber.setting.dataset.dataset_id,
        samples=len(climber.setting.tasks),
        judges=climber.judges.digest,
        metric=metric,
        version=METRICS[metric].version,
        ladder=ladder.name,
        level=level,
        value=value,
        change_sd=_spread(draws, first),
        step_sd=_spread(draws, before),
    )


def _value(scored: Scored) -> tuple[float, FloatArray]:
    """Value and replicates over all samples."""
    found = {measurement.slice: measurement for measurement in scored.measurements}
    chosen = found.get("all") or found[PRIMARY_SLICE]
    draws = scored.replicates.get(f"{chosen.name}|{chosen.slice}", np.array([]))
    return float("nan") if chosen.value is None else chosen.value, draws


def _spread(draws: FloatArray, others: FloatArray) -> float:
    if draws.size == 0 or draws.shape != others.shape:
        return float("nan")
    differences = draws - others
    known = differences[np.isfinite(differences)]
    return float(known.std()) if known.size else float("nan")


def _material(setting: Setting, pack: Pack) -> tuple[Material, tuple[Task, ...]]:
    """The windows, and the tasks whose answers they are: own style from the style of the other take."""
    rng = np.random.default_rng(stable_seed("ladder", setting.dataset.digest))
    test, fit = setting.part("test"), setting.part("fit")
    samples, others, lookups, tasks = [], [], [], []
    for task in setting.tasks:
        sample = source_of(task, pack, setting.protocol.fps)
        other = _drawn((t for t in test if t.content == sample.content and t.style != sample.style), rng)
        lookup = _drawn((t for t in fit if (t.content, t.style) == (sample.content, sample.style)), rng)
        if other is None or lookup is None:
            continue
        samples.append(sample)
        others.append(other)
        lookups.append(lookup)
        tasks.append(
            replace(task, style_take_id=other.take_id, source_style=str(other.style), target_style=str(sample.style),
                    reference_content="")
        )  # fmt: skip
    if not samples:
        raise BadData("no content is in the test part in two styles and in the fit part in one of them")
    return Material(tuple(samples), tuple(others), tuple(lookups)), tuple(tasks)


def _drawn(takes: Iterator[Take], rng: np.random.Generator) -> Take | None:
    """A random window of a random one of the takes."""
    choice = list(takes)
    if not choice:
        return None
    take = choice[int(rng.integers(len(choice)))]
    return take.with_clip(window(take.clip, random_start(take.clip, WINDOW_FRAMES, rng), WINDOW_FRAMES))


def _reference(setting: Setting, judges: JudgeSet, basis: Basis, store: Store, progress: Progress) -> Reference:
    key = reference_key(setting, judges.digest)
    if not store.has("reference", key):
        progress("reference", "judging real motion", 0, 1)

        def embedded(motions: Motions) -> Embedding:
            return stored_embedding(judges, motions, store)

        def write(folder: Path) -> dict[str, Any]:
            return build_reference(setting, judges, embedded, basis, folder)

        store.put("reference", key, write)
    return load_reference(store.folder("reference", key), store.facts("reference", key), basis, judges)
