"""Starting and watching worker processes: limits, process groups, messages."""

from __future__ import annotations

import json
import os
import select
import signal
import subprocess
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import psutil

from bench.adapters.guarded import GuardedModule
from bench.suite.cell import Job
from reports.records import Status, write_text_atomically

Listener = Callable[[str, str, int, int], None]
"""Called as ``listener(cell key or 'fit', what, done, total)``."""

POLL_S = 0.25
GARBLED = "the method wrote into the line between worker and harness"
TRAIN_FIRST = ", in training; `stylebench fit` takes as long as it takes and goes on where this stopped"


@dataclass(frozen=True)
class Limits:
    """What one cell may use."""

    wall_s: float = 1800.0
    rss_mb: float = 8192.0
    threads: int = 1


@dataclass(frozen=True)
class Outcome:
    """How one cell of a job ended; ``log`` names the file beside the job that tells more, where it did not end well."""

    status: Status
    reason: str = ""
    log: str = ""


def run_job(job: Job, scratch: Path, *, limits: Limits, listener: Listener) -> dict[str, Outcome]:
    """Run a job in worker processes until each of its cells has an outcome.

    A worker that dies, hangs or outgrows its limits costs the cell it was at; a fresh worker takes the rest.
    """
    scratch.mkdir(parents=True, exist_ok=True)
    outcomes: dict[str, Outcome] = {}
    attempt = 0
    while waiting := tuple(cell for cell in job.cells if cell.key not in outcomes):
        log = scratch / f"{job.source.name}-seed{job.seed}-{attempt}.log"
        before = len(outcomes)
        outcomes.update(_run_worker(replace(job, cells=waiting), scratch, log, limits, listener))
        if len(outcomes) == before:
            outcomes[waiting[0].key] = Outcome("failed", "the worker ended without a word", log.name)
        attempt += 1
    return outcomes


def _run_worker(job: Job, scratch: Path, log: Path, limits: Limits, listener: Listener) -> dict[str, Outcome]:
    job_file = scratch / f"{log.stem}.job.json"
    write_text_atomically(job_file, json.dumps(asdict(job)))
    environment = worker_environment(limits.threads)
    with GuardedModule("bench.suite.cell", str(job_file), environment=environment, log=log) as worker:
        worker.hang_up()
        return _Watch(job, worker.process, log.name, limits, listener).until_end(worker.answers)


def worker_environment(threads: int) -> dict[str, str]:
    """This process's environment with the threads of all numerical libraries pinned."""
    pinned = {
        name: str(threads)
        for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
    }
    return {**os.environ, **pinned, "PYTHONUNBUFFERED": "1"}


class _Watch:
    """State while one worker runs: which cell it is at, since when, and what has ended."""

    def __init__(
        self, job: Job, process: subprocess.Popen[bytes], log: str, limits: Limits, listener: Listener
    ) -> None:
        self.job = job
        self.process = process
        self.log = log
        self.limits = limits
        self.listener = listener
        self.current = job.cells[0].key
        self.since = time.monotonic()
        self.training = False
        self.outcomes: dict[str, Outcome] = {}

    def until_end(self, read_end: int) -> dict[str, Outcome]:
        buffer = b""
        while True:
            ready, _, _ = select.select([read_end], [], [], POLL_S)
            if ready:
                data = os.read(read_end, 65536)
                if not data:
                    break
                *lines, buffer = (buffer + data).split(b"\n")
                for line in lines:
                    if not self._heard(line):
                        self.outcomes[self.current] = Outcome("failed", GARBLED, self.log)
                        return self.outcomes
                if all(cell.key in self.outcomes for cell in self.job.cells):
                    return self.outcomes
            verdict = self._over_limit()
            if verdict:
                self.outcomes[self.current] = verdict
                return self.outcomes
        code = self.process.wait()
        if code != 0 and self.current not in self.outcomes:
            self.outcomes[self.current] = Outcome("failed", cause_of_death(code), self.log)
        return self.outcomes

    def _heard(self, line: bytes) -> bool:
        """Take in one message; False where it is none of the worker's own."""
        try:
            self._hear(json.loads(line))
        except (ValueError, KeyError, TypeError, RecursionError):
            return False
        return True

    def _hear(self, message: dict[str, Any]) -> None:
        key = str(message["cell"])
        if key not in {"fit", *(cell.key for cell in self.job.cells)}:
            raise KeyError(key)
        match message["event"]:
            case "begin":
                self.current, self.since, self.training = key, time.monotonic(), False
            case "ok":
                self.outcomes[key] = Outcome("ok")
            case "failed":
                self.outcomes[key] = Outcome(message["status"], message["reason"], self.log)
            case "progress":
                self.training = key == "fit"
                self.listener(key, message["what"], message["done"], message["total"])

    def _over_limit(self) -> Outcome | None:
        seconds = time.monotonic() - self.since
        if seconds > self.limits.wall_s:
            said = f"no answer within {self.limits.wall_s:.0f} s{TRAIN_FIRST if self.training else ''}"
            return Outcome("timeout", said, self.log)
        used = tree_rss_mb(self.process.pid)
        if used > self.limits.rss_mb:
            return Outcome("oom", f"used {used:.0f} MB, the limit is {self.limits.rss_mb:.0f} MB", self.log)
        return None


def tree_rss_mb(pid: int) -> float:
    """Resident memory of a process and all its descendants, MB; 0 where it is gone."""
    try:
        root = psutil.Process(pid)
        members = [root, *root.children(recursive=True)]
    except psutil.NoSuchProcess:
        return 0.0
    total = 0.0
    for member in members:
        try:
            total += member.memory_info().rss / 2**20
        except psutil.NoSuchProcess:
            continue
    return total


def cause_of_death(code: int) -> str:
    """What an exit code says, as a guard passes it on: 128 + n where signal n ended the worker."""
    number = -code if code < 0 else code - 128
    if number in set(signal.Signals):
        return f"the worker was killed by {signal.Signals(number).name}"
    return f"the worker ended with exit code {code}"
