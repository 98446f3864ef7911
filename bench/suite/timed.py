"""The runtime track of a run: methods are fitted where needed, then timed group after group, nothing beside them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from bench.metrics.runtime import DEADLINE_FPS
from bench.suite import assemble
from bench.suite.cell import FIT_ONLY, GenerateJob, Job
from bench.suite.plan import Cell
from bench.suite.provenance import provenance
from bench.suite.request import RunRequest
from bench.suite.scores.runtime import runtime_measurements
from bench.suite.setting import Setting
from bench.suite.store import Store
from bench.suite.timing import TimingJob, TimingPlan, time_adapters
from bench.suite.timings import Timings
from bench.suite.workers import Outcome, run_job
from reports.records import Record

Progress = Callable[[str, str, int, int], None]
"""Called as ``progress(stage, what, done, total)``; stages are ``data``, ``judges``, ``reference``, ``cells``."""

PLANS = {
    "smoke": TimingPlan(rounds=5, calls=4, warm_up_calls=2, bound_s=2.0),
    "quick": TimingPlan(rounds=20, calls=10, bound_s=5.0),
    "standard": TimingPlan(rounds=60, calls=20, bound_s=30.0),
}
"""Profile -> how long methods are timed."""


def job_of(setting: Setting, cell: Cell, store: Store, work: GenerateJob) -> Job:
    """One cell's job for a worker process."""
    return Job(
        source=cell.source,
        dataset=setting.dataset.name,
        pack=str(setting.pack_folder),
        store=str(store.root),
        fit_take_ids=setting.fit_take_ids,
        disjoint_take_ids=tuple(take.take_id for take in setting.part(*setting.protocol.floor_parts)),
        fit_key=cell.fit_key,
        budget=cell.budget,
        seed=cell.seed,
        cells=(work,),
    )


def fit_cell(request: RunRequest, setting: Setting, cell: Cell, store: Store, progress: Progress) -> Outcome:
    """Train a cell's method unless the store has it."""
    if not cell.fit_key or store.has("fit", cell.fit_key):
        return Outcome("ok")

    def listener(key: str, what: str, done: int, total: int) -> None:
        progress("cells", f"{cell.facts.title}: {what} {done}/{total}", -1, -1)

    job = job_of(setting, cell, store, GenerateJob(cell.fit_key, "", FIT_ONLY, setting.protocol.fps))
    outcome = run_job(job, request.out / "logs", limits=request.limits, listener=listener)[cell.fit_key]
    return replace(outcome, log=f"logs/{outcome.log}") if outcome.log else outcome


def time_cells(
    request: RunRequest,
    setting: Setting,
    cells: Sequence[Cell],
    store: Store,
    progress: Progress,
    records_folder: Path,
) -> list[Record]:
    """Time every cell and store its record. Timings are never reused: they belong to this machine and hour."""
    results: dict[str, Timings | Outcome] = {}
    jobs = []
    for cell in cells:
        outcome = (
            Outcome("unsupported", cell.unsupported)
            if cell.unsupported
            else fit_cell(request, setting, cell, store, progress)
        )
        if outcome.status == "ok":
            jobs.append(_timing_job(setting, cell, store))
        else:
            results[cell.motions_key] = outcome
    results |= time_adapters(
        jobs,
        PLANS[request.profile],
        request.out / "logs",
        limits=request.limits,
        progress=lambda what, done, total: progress("cells", what, done, total),
    )
    records = [_record(request, setting, cell, results[cell.motions_key]) for cell in cells]
    for record in records:
        assemble.write(records_folder, record)
    return records


def _timing_job(setting: Setting, cell: Cell, store: Store) -> TimingJob:
    return TimingJob(
        key=cell.motions_key,
        source=cell.source,
        pack=str(setting.pack_folder),
        store=str(store.root),
        fit_key=cell.fit_key,
        tasks_file=str(setting.write_tasks(store)),
        seed=cell.seed,
    )


def _record(request: RunRequest, setting: Setting, cell: Cell, result: Timings | Outcome) -> Record:
    if isinstance(result, Outcome):
        made = provenance(request.command, threads=request.limits.threads, wall_s=0.0, peak_rss_mb=0.0)
        return assemble.record_of(setting, cell, result, made)
    made = provenance(
        request.command,
        threads=request.limits.threads,
        wall_s=float(sum(values.sum() for values in result.durations_s.values())),
        peak_rss_mb=result.facts.peak_memory_mb,
    )
    measurements = runtime_measurements(result, DEADLINE_FPS)
    return assemble.record_of(setting, cell, Outcome("ok"), made, measurements=measurements)
