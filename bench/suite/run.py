"""Running a benchmark: datasets in, records out. What the store has is not done again."""

from __future__ import annotations

import multiprocessing
import traceback
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bench.datasets.base import Dataset
from bench.datasets.table import load_dataset
from bench.errors import BadData
from bench.metrics import METRICS
from bench.suite import assemble
from bench.suite.cell import GenerateJob
from bench.suite.embedding import Embedding
from bench.suite.judging import JudgesOnDisk, judges_for, stored_embedding
from bench.suite.motions import Motions
from bench.suite.plan import Cell, Estimate, estimate, plan_cells
from bench.suite.provenance import provenance
from bench.suite.reference import build_reference, reference_key
from bench.suite.request import RunRequest, check_request, protocols_of, sources_of
from bench.suite.score import Scorer, ScoreSpec, pin_threads, score_in_process
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from bench.suite.timed import Progress, job_of, time_cells
from bench.suite.truth import true_answers, truth_key
from bench.suite.workers import Outcome, run_job
from reports.records import Provenance, Record


@dataclass(frozen=True)
class RunResult:
    """What a run left: its records, and how many cells were generated and metrics computed anew.

    ``left_out`` names protocols that a dataset cannot serve, with the reason.
    """

    records: tuple[Record, ...]
    generated: int
    scored: int
    left_out: tuple[str, ...] = ()


@dataclass(frozen=True)
class Planned:
    """The settings of a run, and what could not be set up."""

    settings: tuple[Setting, ...]
    left_out: tuple[str, ...]


def dry_run(request: RunRequest, progress: Progress) -> list[tuple[Setting, list[Cell], Estimate]]:
    """The cells of a run and what they would cost; loads the data, runs nothing."""
    check_request(request)
    store = Store(request.store)
    plans = []
    for setting in _settings(request, _loaded(request, progress), store).settings:
        cells = _cells(request, setting)
        plans.append((setting, cells, estimate(setting, cells, store, request.jobs)))
    return plans


def run(request: RunRequest, progress: Progress) -> RunResult:
    """Run everything asked for and write one record per cell into ``out/records``.

    Raises
    ------
    BenchError : a request that cannot be run; a failing method is a record, not an error.
    """
    check_request(request)
    pin_threads(request.limits.threads)
    datasets = _loaded(request, progress)
    store = Store(request.store)
    store.sweep()
    records_folder = fresh_records_folder(request.out)
    planned = _settings(request, datasets, store)
    records: list[Record] = []
    generated = scored = 0
    for setting in planned.settings:
        cells = _cells(request, setting)
        if setting.protocol.track == "runtime":
            records.extend(time_cells(request, setting, cells, store, progress, records_folder))
            continue
        part = SettingRun(request, setting, store, progress).run(cells, records_folder)
        records.extend(part.records)
        generated += part.generated
        scored += part.scored
    return RunResult(tuple(records), generated, scored, planned.left_out)


def fresh_records_folder(out: Path) -> Path:
    """The records folder of a run, emptied."""
    folder = out / "records"
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    return folder


def _loaded(request: RunRequest, progress: Progress) -> list[Dataset]:
    return [
        load_dataset(name, path, lambda what, done, total: progress("data", what, done, total))
        for name, path in request.data.items()
    ]


def _settings(request: RunRequest, datasets: Sequence[Dataset], store: Store) -> Planned:
    """Every protocol on every dataset that can serve it; a run with one protocol refuses what it cannot serve."""
    protocols = protocols_of(request)
    settings, left_out = [], []
    for dataset in datasets:
        others = [other for other in datasets if other is not dataset]
        for protocol in protocols:
            try:
                setting = prepare(
                    dataset, protocol, request.profile, store, split_kind=request.split,
                    foreign=others[0] if others else None,
                )  # fmt: skip
            except BadData as error:
                if len(protocols) == 1:
                    raise
                left_out.append(f"{protocol.label} on {dataset.dataset_id}: {error.problem}")
            else:
                settings.append(setting)
    return Planned(tuple(settings), tuple(left_out))


def _cells(request: RunRequest, setting: Setting) -> list[Cell]:
    cells = plan_cells(setting, sources_of(request), seed=request.seed, budget=request.budget, device="cpu")
    return [cell for cell in cells if not cell.unsupported or cell.facts.name in request.methods]


class SettingRun:
    """One protocol on one dataset: judges, reference, then all cells, ``jobs`` at a time."""

    def __init__(self, request: RunRequest, setting: Setting, store: Store, progress: Progress) -> None:
        self.request = request
        self.setting = setting
        self.store = store
        self.progress = progress
        self.judges = self._judges() if setting.protocol.judged else None
        self.spec = self._spec()
        self.scorer = Scorer(self.spec)
        self.generated: list[str] = []
        self.scored: list[str] = []

    def run(self, cells: Sequence[Cell], records_folder: Path) -> RunResult:
        self._ensure_reference()
        self.progress("cells", self._name, 0, len(cells))
        context = multiprocessing.get_context("spawn")
        with (
            ProcessPoolExecutor(
                self.request.jobs,
                mp_context=context,
                initializer=pin_threads,
                initargs=(self.request.limits.threads,),
            ) as pool,
            ThreadPoolExecutor(self.request.jobs) as threads,
        ):
            futures = [threads.submit(self._run_cell, cell, pool) for cell in cells]
            outcomes = self._gather(futures)
        records = [self._record(cell, outcome, records_folder) for cell, outcome in zip(cells, outcomes, strict=True)]
        return RunResult(tuple(records), len(self.generated), len(self.scored))

    @property
    def _name(self) -> str:
        return f"{self.setting.protocol.label} on {self.setting.dataset.dataset_id}"

    def _judges(self) -> JudgesOnDisk:
        return judges_for(
            self.setting.dataset,
            self.setting.split,
            self.store,
            retrain=self.request.retrain_judges,
            progress=lambda what, done, total: self.progress("judges", what, done, total),
        )

    def _spec(self) -> ScoreSpec:
        setting, judges = self.setting, self.judges
        judges_digest = judges.judges.digest if judges else ""
        names = setting.protocol.metrics
        known = truth_key(setting) if setting.protocol.truth_metrics else ""
        if known:
            names = (*names, *setting.protocol.truth_metrics)
        return ScoreSpec(
            store=str(self.store.root),
            pack=str(setting.pack_folder),
            tasks_file=str(setting.write_tasks(self.store)),
            judges_folder=str(judges.folder) if judges else "",
            judges_digest=judges_digest,
            reference_key=reference_key(setting, judges_digest),
            truth_key=known,
            protocol=setting.protocol.label,
            profile=setting.profile,
            metrics=tuple((name, METRICS[name].version) for name in names),
            content_labels=setting.content_labels,
            style_labels=setting.dataset.style_labels,
            fit_take_ids=setting.fit_take_ids,
        )

    def _ensure_reference(self) -> None:
        if self.spec.truth_key and not self.store.has("truth", self.spec.truth_key):
            self.progress("reference", "rendering true answers", 0, 1)
            self.store.put("truth", self.spec.truth_key, lambda folder: true_answers(self.setting, folder))
        key = self.spec.reference_key
        if self.judges and not self.store.has("reference", key):
            self.progress("reference", "judging real motion", 0, 1)
            judges, basis = self.judges.judges, self.scorer.basis

            def embedded(motions: Motions) -> Embedding:
                return stored_embedding(judges, motions, self.store)

            self.store.put(
                "reference", key, lambda folder: build_reference(self.setting, judges, embedded, basis, folder)
            )
        self.progress("reference", "judging real motion", 1, 1)

    def _run_cell(self, cell: Cell, pool: ProcessPoolExecutor) -> Outcome:
        if cell.unsupported:
            return Outcome("unsupported", cell.unsupported)
        if not self.store.has("motions", cell.motions_key):
            outcome = self._generate(cell)
            if outcome.status != "ok":
                return outcome
            self.generated.append(cell.motions_key)
        digest = str(self.store.facts("motions", cell.motions_key)["motions_digest"])
        if self.scorer.missing(digest, cell.given):
            try:
                self.scored.extend(pool.submit(score_in_process, self.spec, cell.motions_key, cell.given).result())
            except Exception as error:
                return self._failed_scoring(cell, error)
        return Outcome("ok")

    def _failed_scoring(self, cell: Cell, error: Exception) -> Outcome:
        """A row that cannot be scored is a record like any other failure: every other row goes on."""
        logs = self.request.out / "logs"
        logs.mkdir(parents=True, exist_ok=True)
        log = logs / f"{cell.facts.name}-scoring.log"
        log.write_text("".join(traceback.format_exception(error)))
        reason = f"scoring raised {type(error).__name__}: {error}"
        return Outcome("failed", " ".join(reason.split())[:300], f"{logs.name}/{log.name}")

    def _generate(self, cell: Cell) -> Outcome:
        protocol = self.setting.protocol
        tasks_file = str(self.setting.write_tasks(self.store))
        job = job_of(
            self.setting, cell, self.store, GenerateJob(cell.motions_key, tasks_file, protocol.track, protocol.fps)
        )

        def listener(key: str, what: str, done: int, total: int) -> None:
            self.progress("cells", f"{cell.facts.title}: {what} {done}/{total}", -1, -1)

        scratch = self.request.out / "logs"
        outcome = run_job(job, scratch, limits=self.request.limits, listener=listener)[cell.motions_key]
        return replace(outcome, log=f"{scratch.name}/{outcome.log}") if outcome.log else outcome

    def _gather(self, futures: Sequence[Future[Outcome]]) -> list[Outcome]:
        outcomes: list[Outcome] = []
        for done, future in enumerate(futures, start=1):
            outcomes.append(future.result())
            self.progress("cells", self._name, done, len(futures))
        return outcomes

    def _record(self, cell: Cell, outcome: Outcome, folder: Path) -> Record:
        if outcome.status != "ok":
            record = assemble.record_of(self.setting, cell, outcome, self._made({}))
            assemble.write(folder, record)
            return record
        scores = self.scorer.collect(cell.motions_key, given=cell.given)
        arrays = assemble.sample_arrays(scores)
        record = assemble.record_of(
            self.setting,
            cell,
            outcome,
            self._made(self.store.facts("motions", cell.motions_key)),
            measurements=tuple(m for scored in scores.scored.values() for m in scored.measurements),
            arrays=arrays,
            motions_digest=scores.motions_digest,
            judges=self.judges.judges.facts if self.judges else (),
        )
        assemble.write(folder, record, arrays)
        return record

    def _made(self, facts: Mapping[str, Any]) -> Provenance:
        return provenance(
            self.request.command,
            threads=self.request.limits.threads,
            wall_s=float(facts.get("wall_s", 0.0)),
            peak_rss_mb=float(facts.get("peak_rss_mb", 0.0)),
        )
