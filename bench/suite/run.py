"""Running a benchmark: datasets in, records out. What the store has is not done again."""

from __future__ import annotations

import multiprocessing
import os
import shutil
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bench.adapters import ADAPTERS
from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.datasets.base import Dataset
from bench.datasets.table import load_dataset
from bench.errors import BadConfig
from bench.metrics import METRICS
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol
from bench.suite import assemble
from bench.suite.cell import GenerateJob, Job
from bench.suite.judging import JudgesOnDisk, embed, judges_for
from bench.suite.plan import Cell, Estimate, estimate, plan_cells
from bench.suite.provenance import provenance
from bench.suite.reference import build_reference, reference_key
from bench.suite.score import Scorer, ScoreSpec, pin_threads, score_in_process
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from bench.suite.workers import Limits, Outcome, run_job
from reports.records import Record

Progress = Callable[[str, str, int, int], None]
"""Called as ``progress(stage, what, done, total)``; stages are ``data``, ``judges``, ``reference``, ``cells``."""


@dataclass(frozen=True)
class RunRequest:
    """What to run.

    Attributes
    ----------
    data : dataset name -> path (None for generated data).
    methods : names; empty means all anchors and fast methods that fit the dataset.
    adapter_files : ``FILE.py[:Class]`` each, run beside the methods.
    tracks : protocols of these tracks.
    profile : ``quick`` or ``standard``.
    out, store : run folder and store folder.
    command : as typed, for the records.
    """

    data: dict[str, Path | None]
    out: Path
    store: Path
    methods: tuple[str, ...] = ()
    adapter_files: tuple[str, ...] = ()
    tracks: tuple[str, ...] = ("transfer",)
    profile: str = "quick"
    jobs: int = 2
    seed: int = 0
    budget: str = "small"
    split: str = "default"
    retrain_judges: bool = False
    limits: Limits = field(default_factory=Limits)
    command: str = ""


@dataclass(frozen=True)
class RunResult:
    """What a run left: its records, and how many cells were generated and metrics computed anew."""

    records: tuple[Record, ...]
    generated: int
    scored: int


def sources_of(request: RunRequest) -> list[AdapterSource]:
    """The adapters of a run, named ones first checked for existence.

    Raises
    ------
    BadConfig : an unknown name or file.
    """
    names = request.methods or tuple(ADAPTERS)
    sources = [AdapterSource(name) for name in names]
    for source in sources:
        find_adapter(source)
    sources += [source_from_option(option) for option in request.adapter_files]
    seen: set[str] = set()
    for source in sources:
        if source.name in seen:
            raise BadConfig(f"two adapters are called {source.name!r}", remedy="give yours another name")
        seen.add(source.name)
    return sources


def protocols_of(request: RunRequest) -> list[Protocol]:
    """Protocols of the tracks asked for.

    Raises
    ------
    BadConfig : an unknown track or profile.
    """
    known = {protocol.track for protocol in PROTOCOLS.values()}
    unknown = sorted(set(request.tracks) - known)
    if unknown:
        raise BadConfig(f"unknown track {', '.join(unknown)}", remedy=f"choose from {', '.join(sorted(known))}")
    found = [protocol for protocol in PROTOCOLS.values() if protocol.track in request.tracks]
    for protocol in found:
        if request.profile not in protocol.n_samples:
            raise BadConfig(
                f"unknown profile {request.profile!r}", remedy=f"choose from {', '.join(protocol.n_samples)}"
            )
    return found


def dry_run(request: RunRequest, progress: Progress) -> list[tuple[Setting, list[Cell], Estimate]]:
    """The cells of a run and what they would cost; loads the data, runs nothing."""
    datasets = _loaded(request, progress)
    store = Store(request.store)
    plans = []
    for setting in _settings(request, datasets, store):
        cells = _cells(request, setting)
        plans.append((setting, cells, estimate(setting, cells, store, request.jobs)))
    return plans


def run(request: RunRequest, progress: Progress) -> RunResult:
    """Run everything asked for and write one record per cell into ``out/records``.

    Raises
    ------
    BenchError : a request that cannot be run; a failing method is a record, not an error.
    """
    pin_threads(request.limits.threads)
    datasets = _loaded(request, progress)
    store = Store(request.store)
    store.sweep()
    records_folder = _fresh_records_folder(request.out)
    records: list[Record] = []
    generated = scored = 0
    for setting in _settings(request, datasets, store):
        part = _RunSetting(request, setting, store, progress).run(records_folder)
        records.extend(part.records)
        generated += part.generated
        scored += part.scored
    return RunResult(tuple(records), generated, scored)


def _fresh_records_folder(out: Path) -> Path:
    folder = out / "records"
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    return folder


def _loaded(request: RunRequest, progress: Progress) -> list[Dataset]:
    """The datasets, after everything that can be refused without reading them has been checked; writes nothing."""
    sources_of(request)
    protocols_of(request)
    for option, folder in (("--out", request.out), ("--store", request.store)):
        _check_writable(folder, option)
    return [
        load_dataset(name, path, lambda what, done, total: progress("data", what, done, total))
        for name, path in request.data.items()
    ]


def _check_writable(folder: Path, option: str) -> None:
    existing = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise BadConfig(
            f"{folder} cannot be written: {existing} is not a writable folder", remedy=f"choose another with {option}"
        )


def _settings(request: RunRequest, datasets: Sequence[Dataset], store: Store) -> list[Setting]:
    return [
        prepare(dataset, protocol, request.profile, store, split_kind=request.split)
        for dataset in datasets
        for protocol in protocols_of(request)
    ]


def _cells(request: RunRequest, setting: Setting) -> list[Cell]:
    cells = plan_cells(setting, sources_of(request), seed=request.seed, budget=request.budget, device="cpu")
    return [cell for cell in cells if not cell.unsupported or cell.facts.name in request.methods]


class _RunSetting:
    """One protocol on one dataset: judges, reference, then all cells, ``jobs`` at a time."""

    def __init__(self, request: RunRequest, setting: Setting, store: Store, progress: Progress) -> None:
        self.request = request
        self.setting = setting
        self.store = store
        self.progress = progress
        self.judges = self._judges()
        self.spec = self._spec()
        self.scorer = Scorer(self.spec)
        self.generated: list[str] = []
        self.scored: list[str] = []

    def run(self, records_folder: Path) -> RunResult:
        cells = _cells(self.request, self.setting)
        self._ensure_reference()
        self.progress("cells", self.setting.dataset.dataset_id, 0, len(cells))
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

    def _judges(self) -> JudgesOnDisk:
        return judges_for(
            self.setting.dataset,
            self.setting.split,
            self.store,
            retrain=self.request.retrain_judges,
            progress=lambda what, done, total: self.progress("judges", what, done, total),
        )

    def _spec(self) -> ScoreSpec:
        setting, judges = self.setting, self.judges.judges
        return ScoreSpec(
            store=str(self.store.root),
            pack=str(setting.pack_folder),
            tasks_file=str(setting.write_tasks(self.store)),
            tasks_digest=setting.tasks_digest,
            judges_folder=str(self.judges.folder),
            judges_digest=judges.digest,
            reference_key=reference_key(setting, judges.digest),
            protocol_id=setting.protocol.protocol_id,
            window_frames=setting.protocol.window_frames,
            metrics=tuple((name, METRICS[name].version) for name in setting.protocol.metrics),
            content_labels=setting.dataset.content_labels,
            style_labels=setting.dataset.style_labels,
        )

    def _ensure_reference(self) -> None:
        key = self.spec.reference_key
        if not self.store.has("reference", key):
            self.progress("reference", "judging real motion", 0, 1)
            judges = self.judges.judges
            self.store.put(
                "reference",
                key,
                lambda folder: build_reference(self.setting, lambda motions: embed(judges, motions), folder),
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
            self.scored.extend(pool.submit(score_in_process, self.spec, cell.motions_key, cell.given).result())
        return Outcome("ok")

    def _generate(self, cell: Cell) -> Outcome:
        setting = self.setting
        job = Job(
            source=cell.source,
            dataset=setting.dataset.name,
            pack=str(setting.pack_folder),
            store=str(self.store.root),
            fit_take_ids=tuple(take.take_id for take in setting.part("fit")),
            fit_key=cell.fit_key,
            budget=cell.budget,
            seed=cell.seed,
            cells=(
                GenerateJob(cell.motions_key, str(setting.write_tasks(self.store)), setting.protocol.window_frames),
            ),
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
            self.progress("cells", self.setting.dataset.dataset_id, done, len(futures))
        return outcomes

    def _record(self, cell: Cell, outcome: Outcome, folder: Path) -> Record:
        scores = self.scorer.collect(cell.motions_key, given=cell.given) if outcome.status == "ok" else None
        arrays = assemble.sample_arrays(self.setting, scores) if scores else {}
        facts: dict[str, Any] = self.store.facts("motions", cell.motions_key) if scores else {}
        made = provenance(
            self.request.command,
            threads=self.request.limits.threads,
            wall_s=float(facts.get("wall_s", 0.0)),
            peak_rss_mb=float(facts.get("peak_rss_mb", 0.0)),
        )
        record = assemble.record_of(self.setting, cell, outcome, scores, arrays, self.judges.judges.facts, made)
        assemble.write(folder, record, arrays)
        return record


def latest_link(out: Path) -> None:
    """Point ``latest`` beside a run folder at it."""
    link = out.parent / "latest"
    draft = out.parent / f".latest-{os.getpid()}"
    draft.unlink(missing_ok=True)
    draft.symlink_to(out.name)
    if link.is_dir() and not link.is_symlink():
        shutil.rmtree(link)
    draft.replace(link)


def default_out(runs: Path) -> Path:
    """``runs/<date>-<time>``, with a number behind it where that exists."""
    stamp = time.strftime("%Y%m%d-%H%M%S")
    names = [stamp, *(f"{stamp}-{number}" for number in range(2, 100))]
    return next(runs / name for name in names if not (runs / name).exists())
