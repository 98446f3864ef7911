"""The runtime track of a run: methods are fitted where needed, then timed group after group, nothing beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from bench.metrics.runtime import DEADLINE_FPS
from bench.suite import assemble
from bench.suite.calls import CellCall, TimingCall, made_here
from bench.suite.cell import FIT_ONLY, GenerateJob, Job
from bench.suite.plan import Cell
from bench.suite.scores.runtime import runtime_measurements
from bench.suite.session import Session
from bench.suite.setting import Setting
from bench.suite.store import Store
from bench.suite.timing.harness import TimingJob, TimingPlan
from bench.suite.timing.results import Timings
from bench.suite.workers import Outcome
from reports.records import Provenance, Record

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
        device=cell.device,
    )


def time_cells(session: Session, setting: Setting, cells: Sequence[Cell], records_folder: Path) -> list[Record]:
    """Time every cell and store its record. Timings are never reused: they belong to this machine and hour."""
    keys = [assemble.record_key(setting, cell) for cell in cells]
    results: dict[str, Timings | Outcome] = {}
    if session.request.keep_failures:
        kept = {cell.motions_key: session.failures.recall(key) for key, cell in zip(keys, cells, strict=True)}
        results |= {key: outcome for key, outcome in kept.items() if outcome is not None}
    results |= {cell.motions_key: cell.settled for cell in cells if cell.settled is not None}
    results |= _unfitted(session, setting, [cell for cell in cells if cell.motions_key not in results])
    jobs = [_timing_job(setting, cell, session.store) for cell in cells if cell.motions_key not in results]
    made = made_here(session.request.command, session.request.limits.threads, {})
    if jobs:
        name = f"timing {len(jobs)} methods for {setting.protocol.label} on {setting.dataset.dataset_id}"
        [answer] = session.answers([_timing_call(session, setting, jobs)], name)
        results |= answer.results
        made = answer.made
    records = []
    for key, cell in zip(keys, cells, strict=True):
        result = results[cell.motions_key]
        session.failures.note(key, result if isinstance(result, Outcome) else Outcome("ok"))
        records.append(_record(setting, cell, result, made))
        assemble.write(records_folder, records[-1])
    return records


def _unfitted(session: Session, setting: Setting, cells: Sequence[Cell]) -> dict[str, Outcome]:
    """Train what the store lacks; the outcomes of cells whose training failed, by the key of their motions."""
    waiting = [cell for cell in cells if cell.fit_key and not session.store.has("fit", cell.fit_key)]
    calls = [
        CellCall(
            name=f"fit-{assemble.record_key(setting, cell)}",
            folder=str(session.folder),
            wanted=session.wanted,
            needs=(("takes", setting.pack_folder.name),),
            job=job_of(setting, cell, session.store, GenerateJob(cell.fit_key, "", FIT_ONLY, setting.protocol.fps)),
            spec=None,
            given=cell.given,
            limits=session.request.limits,
            logs=session.logs,
            command=session.request.command,
        )
        for cell in waiting
    ]
    answers = session.answers(calls, f"training for {setting.protocol.label}") if calls else []
    ended = {cell.motions_key: answer.outcome for cell, answer in zip(waiting, answers, strict=True)}
    return {key: outcome for key, outcome in ended.items() if outcome.status != "ok"}


def _timing_call(session: Session, setting: Setting, jobs: Sequence[TimingJob]) -> TimingCall:
    return TimingCall(
        name=f"timing-{jobs[0].key}",
        folder=str(session.folder),
        wanted=session.wanted,
        jobs=tuple(jobs),
        plan=replace(PLANS[session.request.profile], fps=setting.protocol.fps),
        limits=session.request.limits,
        logs=session.logs,
        command=session.request.command,
    )


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


def _record(setting: Setting, cell: Cell, result: Timings | Outcome, made: Provenance) -> Record:
    if isinstance(result, Outcome):
        return assemble.record_of(setting, cell, result, made)
    used = {
        "wall_s": round(float(sum(values.sum() for values in result.durations_s.values())), 3),
        "peak_rss_mb": round(result.facts.peak_memory_mb, 1),
    }
    measurements = runtime_measurements(result, DEADLINE_FPS)
    return assemble.record_of(setting, cell, Outcome("ok"), made.model_copy(update=used), measurements=measurements)
