"""What runs on any machine: one cell, or the timing of one setting, as one picklable call of plain data.

A call names what it needs by stage and key in the store and carries no data. Another machine may see the store, and
have this project, at paths of its own: see :meth:`bench.suite.machines.Home.here`. What a call makes it leaves in the
store.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import os
import platform
import time
import traceback
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar

from bench.suite.cell import FIT_ONLY, Job
from bench.suite.machines import Wanted, problem_here
from bench.suite.provenance import provenance
from bench.suite.score import ScoreSpec, open_scorer, pin_threads
from bench.suite.store import Store
from bench.suite.timing.harness import TimingJob, TimingPlan, time_adapters
from bench.suite.timing.results import Timings
from bench.suite.workers import Limits, Outcome, run_job
from reports.records import Provenance, write_text_atomically

MOST_ATTEMPTS = 2
VISIBLE_WITHIN_S = 60.0
"""Shared folders show what another machine wrote only after a while."""
REPORT_EVERY_S = 0.5

Answered = TypeVar("Answered", covariant=True)


class Call(Protocol[Answered]):
    """Something to be done on some machine."""

    def run(self) -> Answered:
        """Do it, here."""
        ...

    def lost(self, reason: str) -> Answered:
        """The answer where no machine lived through it."""
        ...


class Attempt:
    """One try at a call, claimed in the run's folder, so that a second one knows that the first was lost."""

    def __init__(self, folder: Path, name: str) -> None:
        self.progress_file = folder / f"{name}.progress"
        self.lost: list[str] = []
        self.last_report = 0.0
        for number in itertools.count(1):
            claim = folder / f"{name}.attempt-{number}"
            try:
                with claim.open("x") as file:
                    file.write(worker_name())
                return
            except FileExistsError:
                self.lost.append(claim.read_text() or "a worker")

    @property
    def too_many(self) -> bool:
        return len(self.lost) >= MOST_ATTEMPTS

    @property
    def retried(self) -> str:
        """Why this is not the first attempt; empty where it is."""
        return f"the worker {', '.join(self.lost)} was lost; done again by {worker_name()}" if self.lost else ""

    def report(self, what: str, done: int, total: int) -> None:
        """Leave word of how far the call is; where that fails, the work still counts."""
        if time.monotonic() - self.last_report >= REPORT_EVERY_S:
            self.last_report = time.monotonic()
            draft = self.progress_file.with_suffix(f".{os.getpid()}")
            with contextlib.suppress(OSError):
                draft.write_text(json.dumps([what, done, total]))
                draft.replace(self.progress_file)


def worker_name() -> str:
    """This process, as records and messages name it."""
    return f"{platform.node()}:{os.getpid()}"


@dataclass(frozen=True)
class CellAnswer:
    """How a cell ended, what was made for it, and with what."""

    outcome: Outcome
    made: Provenance
    generated: bool = False
    scored: tuple[str, ...] = ()


@dataclass(frozen=True)
class CellCall:
    """One cell: fit where needed, generate, score.

    Attributes
    ----------
    name : unique among the calls of a run.
    folder : of the run, in the store.
    wanted : what is asked of another machine; None where the call stays on this one.
    needs : what of the store it reads, as (stage, key).
    job : with one cell.
    spec : None where the method is only fitted.
    given : see :class:`bench.suite.plan.Cell`.
    logs : folder of logs.
    """

    name: str
    folder: str
    wanted: Wanted | None
    needs: tuple[tuple[str, str], ...]
    job: Job
    spec: ScoreSpec | None
    given: bool
    limits: Limits
    logs: str
    command: str

    @property
    def key(self) -> str:
        return self.job.cells[0].key

    def run(self) -> CellAnswer:
        """Do what the store lacks; whatever goes wrong is the cell's outcome."""
        problem = problem_here(self.wanted)
        if problem:
            return self.lost(problem)
        return (self.wanted.home.here(self) if self.wanted else self)._run_here()

    def lost(self, reason: str) -> CellAnswer:
        return self._answer(Outcome("failed", reason))

    def _run_here(self) -> CellAnswer:
        pin_threads(self.limits.threads)
        attempt = Attempt(Path(self.folder), self.name)
        if attempt.too_many:
            return self.lost(_lost_too_often(attempt.lost))
        try:
            answer = self._attempted(attempt)
        except Exception as error:
            answer = self._answer(_raised(error, Path(self.logs), f"{self.job.source.name}-scoring", "scoring"))
        return replace(answer, made=answer.made.model_copy(update={"retried": attempt.retried}))

    def _attempted(self, attempt: Attempt) -> CellAnswer:
        store = Store(Path(self.job.store))
        problem = lacks(store, self.needs, _patience_s(self.wanted))
        if problem:
            return self.lost(problem)
        stage = "fit" if self.job.cells[0].track == FIT_ONLY else "motions"
        generated = not store.has(stage, self.key)
        if generated:
            outcome = self._worked(attempt)
            if outcome.status != "ok":
                return self._answer(outcome)
        scored = open_scorer(self.spec).score(self.key, given=self.given) if self.spec else []
        answer = self._answer(Outcome("ok"), store.facts(stage, self.key))
        return replace(answer, generated=generated, scored=tuple(scored))

    def _worked(self, attempt: Attempt) -> Outcome:
        def listener(key: str, what: str, done: int, total: int) -> None:
            attempt.report(f"{self.job.source.name}: {what}", done, total)

        return _in_logs(run_job(self.job, Path(self.logs), limits=self.limits, listener=listener)[self.key])

    def _answer(self, outcome: Outcome, facts: Mapping[str, Any] | None = None) -> CellAnswer:
        return CellAnswer(outcome, made_here(self.command, self.limits.threads, facts or {}))


@dataclass(frozen=True)
class TimingAnswer:
    """Timings or outcome by cell, and with what they were made."""

    results: dict[str, Timings | Outcome]
    made: Provenance


@dataclass(frozen=True)
class TimingCall:
    """The timing of all cells of a setting: they take turns on one machine, or the comparison would not be fair."""

    name: str
    folder: str
    wanted: Wanted | None
    jobs: tuple[TimingJob, ...]
    plan: TimingPlan
    limits: Limits
    logs: str
    command: str

    def run(self) -> TimingAnswer:
        """Time them, here and now; timings are never reused."""
        problem = problem_here(self.wanted)
        if problem:
            return self.lost(problem)
        return (self.wanted.home.here(self) if self.wanted else self)._run_here()

    def lost(self, reason: str) -> TimingAnswer:
        made = made_here(self.command, self.limits.threads, {})
        return TimingAnswer({job.key: Outcome("failed", reason) for job in self.jobs}, made)

    def _run_here(self) -> TimingAnswer:
        attempt = Attempt(Path(self.folder), self.name)
        if attempt.too_many:
            return self.lost(_lost_too_often(attempt.lost))
        store = Store(Path(self.jobs[0].store))
        fits = [("fit", job.fit_key) for job in self.jobs if job.fit_key]
        packs = [("takes", Path(job.pack).name) for job in self.jobs]
        problem = lacks(store, [*dict.fromkeys(packs), *fits], _patience_s(self.wanted))
        if problem:
            return self.lost(problem)
        results = time_adapters(self.jobs, self.plan, Path(self.logs), limits=self.limits, progress=attempt.report)
        results = {key: _in_logs(found) if isinstance(found, Outcome) else found for key, found in results.items()}
        made = made_here(self.command, self.limits.threads, {})
        return TimingAnswer(results, made.model_copy(update={"retried": attempt.retried}))


def run_call(call: Call[Answered]) -> Answered:
    """Entry point of worker processes."""
    return call.run()


def made_here(command: str, threads: int, facts: Mapping[str, Any]) -> Provenance:
    """The provenance of what this process made; ``facts`` are those stored with it."""
    return provenance(
        command,
        threads=threads,
        wall_s=float(facts.get("wall_s", 0.0)),
        peak_rss_mb=float(facts.get("peak_rss_mb", 0.0)),
    )


def lacks(store: Store, wanted: Sequence[tuple[str, str]], wait_s: float) -> str:
    """Which of some results, as (stage, key), the store does not have, in one line; empty where it has all."""
    lacking = ", ".join(f"{stage}/{key}" for stage, key in store.missing(wanted, wait_s))
    return f"the store of {worker_name()} at {store.root} lacks {lacking}" if lacking else ""


def _patience_s(wanted: Wanted | None) -> float:
    return VISIBLE_WITHIN_S if wanted else 0.0


def _lost_too_often(lost: list[str]) -> str:
    return f"its workers were lost: {', '.join(lost)}"


def _in_logs(outcome: Outcome) -> Outcome:
    return replace(outcome, log=f"logs/{outcome.log}") if outcome.log else outcome


def _raised(error: Exception, logs: Path, name: str, what: str) -> Outcome:
    """A row that cannot be scored is a record like any other failure: every other row goes on."""
    log = logs / f"{name}.log"
    write_text_atomically(log, "".join(traceback.format_exception(error)))
    reason = f"{what} raised {type(error).__name__}: {error}"
    return Outcome("failed", " ".join(reason.split())[:300], f"logs/{log.name}")
