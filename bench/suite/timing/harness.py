"""Timing adapters: fresh processes that take turns, so that a busy or warm machine is shared by all alike."""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from bench.adapters.base import ProgressCallback
from bench.adapters.guarded import GuardedModule
from bench.arrays import FloatArray
from bench.suite.timing.plan import ONLINE, TimingJob, TimingPlan, Turns, write_job
from bench.suite.timing.results import TimingFacts, Timings
from bench.suite.workers import POLL_S, Limits, Outcome, cause_of_death, tree_rss_mb, worker_environment

__all__ = ["TimingJob", "TimingPlan", "time_adapters"]

LEAVE_S = 2.0
"""How long a process may take to leave once nothing more is asked of it."""


def time_adapters(
    jobs: Sequence[TimingJob], plan: TimingPlan, scratch: Path, *, limits: Limits, progress: ProgressCallback
) -> dict[str, Timings | Outcome]:
    """Time adapters, a few at a time taking turns; what fails is an outcome and disturbs nothing else.

    Nothing else should compute on the machine meanwhile. ``limits.wall_s`` bounds the time that one adapter's turns
    take together, ``limits.rss_mb`` the memory of its process and those it starts.

    Parameters
    ----------
    jobs : their keys must differ.
    scratch : folder for job files and logs.
    progress : called as ``progress(what, done, total)``.
    """
    scratch.mkdir(parents=True, exist_ok=True)
    results: dict[str, Timings | Outcome] = {}
    for start in range(0, len(jobs), plan.group_size):
        group = jobs[start : start + plan.group_size]

        def report(what: str, start: int = start) -> None:
            progress(what, start, len(jobs))

        with contextlib.ExitStack() as stack:
            members = []
            for place, job in enumerate(group, start=start):
                report(f"loading {job.source.name}")
                member = _Member(job, plan, scratch, place, limits)
                stack.callback(member.stop)
                members.append(member)
                member.start()
            _Group(members, plan).run(report)
            results |= {member.job.key: member.result(len(group) - 1) for member in members}
    progress("timed", len(jobs), len(jobs))
    return results


class _Lost(Exception):
    """A member can go on no more."""

    def __init__(self, outcome: Outcome) -> None:
        super().__init__(outcome.reason)
        self.outcome = outcome


@dataclass
class _Collected:
    """What a member's process has answered so far."""

    loaded: dict[str, float] = field(default_factory=dict)
    ready: dict[str, Any] = field(default_factory=dict)
    first: dict[str, Any] = field(default_factory=dict)
    warm_up_calls: int = 0
    durations_ns: dict[str, list[int]] = field(default_factory=dict)
    waited_ns: dict[str, list[int]] = field(default_factory=dict)
    overhead_ns: dict[str, list[int]] = field(default_factory=dict)
    opening_ns: list[int] = field(default_factory=list)
    look_ahead: dict[str, Any] = field(default_factory=dict)
    facts: dict[str, Any] = field(default_factory=dict)


class _Member:
    """One adapter of a group: its process, and what came from it."""

    def __init__(self, job: TimingJob, plan: TimingPlan, scratch: Path, place: int, limits: Limits) -> None:
        self.job = job
        self.plan = plan
        self.limits = limits
        self.file = scratch / f"timing-{place}-{job.source.name}-seed{job.seed}.job.json"
        self.log = self.file.with_name(self.file.name.replace(".job.json", ".log"))
        self.outcome: Outcome | None = None
        self.collected = _Collected()
        self.turns: dict[str, Turns] = {}
        self.busy_s = 0.0
        self.peak_tree_mb = 0.0
        self.worker: GuardedModule | None = None
        self.buffer = b""

    def start(self) -> None:
        """Start the process and wait until the adapter is loaded."""
        write_job(self.file, self.job, self.plan, self.limits.threads)
        begin = time.perf_counter()
        # A fixed hash seed lays out the dictionaries of all processes alike.
        environment = worker_environment(self.limits.threads) | {"PYTHONHASHSEED": "0"}
        self.worker = GuardedModule("bench.suite.timing.worker", str(self.file), environment=environment, log=self.log)
        with self.watched():
            memory_mb = self._heard()["memory_mb"]
            harness_load_s = time.perf_counter() - begin
            self._heard()
            load_s = time.perf_counter() - begin
            self.collected.loaded = {"load_s": load_s, "harness_load_s": harness_load_s, "memory_mb": memory_mb}

    @contextlib.contextmanager
    def watched(self) -> Iterator[None]:
        """A loss inside becomes this member's outcome and ends its process."""
        try:
            yield
        except _Lost as lost:
            self.outcome = lost.outcome
            self.stop()

    def ask(self, **request: Any) -> dict[str, Any]:
        """Have the process compute, and wait for its answer.

        Raises
        ------
        _Lost : it failed, died, hung or grew too big.
        """
        if self.worker is not None:
            with contextlib.suppress(OSError):
                os.write(self.worker.requests, json.dumps(request).encode() + b"\n")
        return self._heard()

    def stop(self) -> None:
        """End the process and all it started; one that did not fail may first clear up after itself."""
        if self.worker is None:
            return
        worker, self.worker = self.worker, None
        worker.hang_up()
        if self.outcome is None:
            with contextlib.suppress(subprocess.TimeoutExpired):
                worker.process.wait(LEAVE_S)
        worker.end()

    def result(self, companions: int) -> Timings | Outcome:
        """What the member came to."""
        if self.outcome is not None:
            return self.outcome
        got = self.collected
        facts = TimingFacts(
            fps=self.plan.fps,
            frames_per_call=self.plan.slices,
            transfers=got.ready["transfers"],
            streams=got.ready["streams"],
            outside_program=got.facts["outside_program"],
            past_frames=self.plan.past_frames,
            load_s=got.loaded["load_s"],
            harness_load_s=got.loaded["harness_load_s"],
            first_call_s=got.first["ns"] * 1e-9,
            first_call_slice=got.first["slice"],
            warm_up_calls=got.warm_up_calls,
            threads=got.facts["threads"],
            waiting_known=got.facts["waiting_known"],
            companions=companions,
            start_memory_mb=got.loaded["memory_mb"],
            peak_memory_mb=max(got.facts["peak_memory_mb"], self.peak_tree_mb),
            parameters=got.facts["parameters"],
            bytes_per_style=got.facts["bytes_per_style"],
            designed_input_frames=got.facts["designed_input_frames"],
            look_ahead_frames=got.look_ahead["frames"],
            look_ahead_window=got.look_ahead["window"],
            look_ahead_to_the_end=got.look_ahead["to_the_end"],
            look_ahead_reason=got.look_ahead["reason"],
        )
        return Timings(
            _seconds(got.durations_ns),
            _seconds(got.waited_ns),
            _seconds(got.overhead_ns),
            np.array(got.opening_ns) * 1e-9,
            facts,
        )

    def _heard(self) -> dict[str, Any]:
        begin = time.monotonic()
        try:
            while b"\n" not in self.buffer:
                self._listen(begin)
        finally:
            self.busy_s += time.monotonic() - begin
        self._watch_memory()
        line, self.buffer = self.buffer.split(b"\n", 1)
        try:
            message: dict[str, Any] = json.loads(line)
        except ValueError:
            raise _Lost(Outcome("failed", "the method wrote into the harness's own pipe", self.log.name)) from None
        if "failed" in message:
            raise _Lost(Outcome(message["failed"], message["reason"], self.log.name))
        return message

    def _listen(self, begin: float) -> None:
        if self.worker is None:
            raise _Lost(Outcome("failed", "the worker is gone", self.log.name))
        ready, _, _ = select.select([self.worker.answers], [], [], POLL_S)
        if ready:
            data = os.read(self.worker.answers, 65536)
            if not data:
                raise self._died(self.worker)
            self.buffer += data
            return
        if self.worker.process.poll() is not None:
            raise self._died(self.worker)
        if self.busy_s + time.monotonic() - begin > self.limits.wall_s:
            raise _Lost(Outcome("timeout", f"no answer within {self.limits.wall_s:.0f} s", self.log.name))
        self._watch_memory()

    def _watch_memory(self) -> None:
        used = tree_rss_mb(self.worker.process.pid) if self.worker else 0.0
        self.peak_tree_mb = max(self.peak_tree_mb, used)
        if used > self.limits.rss_mb:
            reason = f"used {used:.0f} MB, the limit is {self.limits.rss_mb:.0f} MB"
            raise _Lost(Outcome("oom", reason, self.log.name))

    def _died(self, worker: GuardedModule) -> _Lost:
        try:
            code = worker.process.wait(POLL_S * 20)
        except subprocess.TimeoutExpired:
            return _Lost(Outcome("failed", "the worker closed its pipe", self.log.name))
        return _Lost(Outcome("failed", cause_of_death(code), self.log.name))


class _Group:
    """Members that take turns; only the one that is asked computes."""

    def __init__(self, members: Sequence[_Member], plan: TimingPlan) -> None:
        self.members = members
        self.plan = plan
        self.rng = np.random.default_rng(plan.seed)

    @property
    def alive(self) -> list[_Member]:
        return [member for member in self.members if member.outcome is None]

    def run(self, report: Callable[[str], None]) -> None:
        """Everything that is asked of loaded members, one at a time."""
        names = ", ".join(member.job.source.name for member in self.alive)
        report(f"first calls of {names}")
        for member in self.alive:
            with member.watched():
                member.collected.ready = member.ask(do="prepare")
                member.collected.first = member.ask(do="first")
        slices = {name: None for member in self.alive for name in member.collected.ready["slices"]}
        for slice_name in slices:
            report(f"{slice_name} of {names}")
            self._time(slice_name)
        report(f"look-ahead of {names}")
        for member in self.alive:
            with member.watched():
                member.collected.look_ahead = member.ask(do="look_ahead")
                member.collected.facts = member.ask(do="facts")

    def _time(self, slice_name: str) -> None:
        taking_part = [member for member in self.alive if slice_name in member.collected.ready["slices"]]
        for member in taking_part:
            with member.watched():
                self._warm_up(member, slice_name)
        for round_number in range(self.plan.rounds):
            for place in self.rng.permutation(len(taking_part)):
                member = taking_part[place]
                if member.outcome is None and member.turns[slice_name].takes_part(round_number, self.plan.rounds):
                    with member.watched():
                        self._block(member, slice_name, round_number)

    def _warm_up(self, member: _Member, slice_name: str) -> None:
        got = member.collected
        warm = member.ask(do="warm_up", slice=slice_name)
        got.warm_up_calls = max(got.warm_up_calls, warm["calls"])
        fed = self.plan.past_frames if slice_name == ONLINE and got.ready["streams"] else 0
        member.turns[slice_name] = self.plan.turns(warm["ns"] * 1e-9, fed)

    @staticmethod
    def _block(member: _Member, slice_name: str, round_number: int) -> None:
        got = member.collected
        calls = member.turns[slice_name].calls
        answer = member.ask(do="block", slice=slice_name, round=round_number, calls=calls)
        got.durations_ns.setdefault(slice_name, []).extend(answer["ns"])
        got.waited_ns.setdefault(slice_name, []).extend(answer["waited_ns"])
        got.overhead_ns.setdefault(slice_name, []).extend(answer["overhead_ns"])
        if answer["opening_ns"] is not None:
            got.opening_ns.append(answer["opening_ns"])


def _seconds(durations_ns: Mapping[str, Sequence[int]]) -> dict[str, FloatArray]:
    return {name: np.array(values) * 1e-9 for name, values in durations_ns.items()}
