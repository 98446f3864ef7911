"""The process in which one adapter is timed, started as ``python -m bench.suite.timing.worker JOB.json``.

It loads the adapter, says so, and then answers one request at a time: while it waits, others compute. Requests and
answers travel as JSON lines on what were stdin and stdout at the start; what the method prints goes to stderr, the log.
"""

from __future__ import annotations

import gc
import json
import os
import resource
import statistics
import sys
import traceback
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_info

from bench.adapters.base import Adapter, Description
from bench.adapters.external import External
from bench.adapters.loading import find_adapter
from bench.adapters.oracles import Oracle
from bench.adapters.post_processed import plain_instance
from bench.errors import BadConfig, BadOutput, BenchError
from bench.suite.child import leave_if_forked, leave_with_parent, reason_of, status_of
from bench.suite.store import Store
from bench.suite.timing.calls import Calls, timed_inputs
from bench.suite.timing.look_ahead import LookAhead, measured_look_ahead
from bench.suite.timing.plan import TimingJob, TimingPlan, read_job
from bench.suite.timing.stopwatch import HostStopwatch, Stopwatch, timed


class Unsupported(BenchError):
    """An adapter that the runtime track has no use for."""


def main(arguments: list[str]) -> int:
    """Answer requests until the parent closes the pipe; a failure is the last answer."""
    job, plan, threads = read_job(Path(arguments[0]))
    leave_with_parent(os.getppid())
    own = os.getpid()
    # What the method prints goes to the log, and what it reads is empty: the line is not its own.
    requests, answers = os.fdopen(os.dup(0), "r"), os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.dup2(2, 1)

    def send(message: dict[str, Any]) -> None:
        leave_if_forked(own)
        answers.write(json.dumps(message) + "\n")

    send({"memory_mb": memory_mb("VmRSS")})
    try:
        worker = TimingWorker(job, plan, threads, loaded_adapter(job), HostStopwatch())
        send({"loaded": True})
        for line in requests:
            send(worker.answer(json.loads(line)))
    except Exception as error:
        traceback.print_exc()
        send(failure(error))
    return 0


def loaded_adapter(job: TimingJob) -> Adapter:
    """The adapter, ready to answer.

    Raises
    ------
    Unsupported : it cannot be timed at all.
    """
    adapter_class = find_adapter(job.source)
    if issubclass(adapter_class, Oracle):
        raise Unsupported("it looks its answers up: there is nothing to time")
    if not {"transfers", "streams"} & set(adapter_class.capabilities()):
        raise Unsupported("the runtime track needs an adapter that transfers or streams")
    adapter = adapter_class()
    if job.fit_key:
        adapter.load(Store(Path(job.store)).folder("fit", job.fit_key))
    program = plain_instance(adapter)
    if isinstance(program, External):
        program.session()
    return adapter


class TimingWorker:
    """Answers the parent's requests for one loaded adapter."""

    def __init__(self, job: TimingJob, plan: TimingPlan, threads: int, adapter: Adapter, stopwatch: Stopwatch) -> None:
        self.job = job
        self.plan = plan
        self.threads = threads
        self.adapter = adapter
        self.stopwatch = stopwatch
        self.calls: Calls | None = None

    def answer(self, request: dict[str, Any]) -> dict[str, Any]:
        """One request, by its ``do``: ``prepare``, ``first``, ``warm_up``, ``block``, ``look_ahead``, ``facts``."""
        match request["do"]:
            case "prepare":
                return self._prepare()
            case "first":
                return self._first()
            case "warm_up":
                return self._warm_up(str(request["slice"]))
            case "block":
                return self._block(str(request["slice"]), int(request["round"]), int(request["calls"]))
            case "look_ahead":
                return self._look_ahead()
            case "facts":
                return self._facts()
        raise BadConfig(f"unknown request {request['do']!r}")

    @property
    def ready(self) -> Calls:
        if self.calls is None:
            raise BadConfig("a call was asked for before 'prepare'")
        return self.calls

    def _prepare(self) -> dict[str, Any]:
        self._limit_torch()
        inputs = timed_inputs(self.job, self.plan, self.adapter)
        self.calls = Calls(self.adapter, inputs, self.plan, self.job.seed, self.stopwatch)
        return {"slices": self.calls.slices, "transfers": self.calls.transfers, "streams": self.calls.streams}

    def _first(self) -> dict[str, Any]:
        """The first call of all; for a stream, opening it belongs to that."""
        slice_name, block = self.ready.first_block()
        calls = timed(block.call, block.arguments, self.stopwatch)
        block.check(calls.outputs)
        self._limit_torch()
        return {"slice": slice_name, "ns": calls.durations_ns[0] + (block.opening_ns or 0)}

    def _warm_up(self, slice_name: str) -> dict[str, Any]:
        """Calls of one slice until they are enough, or take too much of the time there is; the usual one's duration."""
        durations: list[int] = []
        calls = 1
        while len(durations) < self.plan.warm_up_calls and sum(durations) < 1e9 * self.plan.bound_s / 4:
            block = self.ready.block(slice_name, 0, min(calls, self.plan.warm_up_calls - len(durations)))
            made = timed(block.call, block.arguments, self.stopwatch)
            block.check(made.outputs)
            durations += made.durations_ns
            calls *= 2
        gc.collect()
        gc.freeze()
        return {"calls": len(durations), "ns": statistics.median(durations[len(durations) // 2 :])}

    def _block(self, slice_name: str, round_number: int, calls: int) -> dict[str, Any]:
        """Timed calls; of more than one the first, which finds the caches as another process left them, is not kept."""
        settling = int(calls > 1)
        block = self.ready.block(slice_name, round_number, calls + settling)
        made = timed(block.call, block.arguments, self.stopwatch)
        empty = timed(block.empty, block.arguments, self.stopwatch)
        block.check(made.outputs)
        return {
            "ns": made.durations_ns[settling:],
            "waited_ns": made.waited_ns[settling:],
            "overhead_ns": empty.durations_ns[settling:],
            "opening_ns": block.opening_ns,
        }

    def _look_ahead(self) -> dict[str, Any]:
        """Later frames that an answer waits for; a stream has answered before they come."""
        transfer, clip = self.ready.look_ahead_call()
        found = LookAhead(0) if self.ready.streams else measured_look_ahead(transfer, clip)
        return {
            "frames": found.frames,
            "window": clip.n_frames,
            "to_the_end": found.to_the_end,
            "reason": found.reason,
        }

    def _facts(self) -> dict[str, Any]:
        traits = self.adapter.traits
        described = self.adapter.describe() if "describes" in self.adapter.capabilities() else None
        if described is not None and not isinstance(described, Description):
            raise BadOutput(f"expected a Description, got {type(described).__name__}", where="describe()")
        declared = described.designed_input_frames if described else None
        return {
            "outside_program": isinstance(plain_instance(self.adapter), External),
            "parameters": described.parameters if described else None,
            "bytes_per_style": described.bytes_per_style if described else None,
            "designed_input_frames": traits.designed_input_frames if declared is None else declared,
            "threads": self._thread_counts(),
            "waiting_known": self.stopwatch.knows_waiting,
            "peak_memory_mb": memory_mb("VmHWM"),
        }

    def _limit_torch(self) -> None:
        """Pin torch where the adapter brought it: environment variables alone do not bind all of its pools."""
        torch = sys.modules.get("torch")
        if torch is not None:
            torch.set_num_threads(self.threads)

    def _thread_counts(self) -> dict[str, int]:
        counts = {"limit": self.threads}
        for pool in threadpool_info():
            kind = str(pool["user_api"])
            counts[kind] = max(counts.get(kind, 0), int(pool["num_threads"]))
        torch = sys.modules.get("torch")
        if torch is not None:
            counts["torch"] = int(torch.get_num_threads())
        return counts


def failure(error: Exception) -> dict[str, Any]:
    """The last message of a worker: a status and one line."""
    status = "unsupported" if isinstance(error, Unsupported) else status_of(error)
    return {"failed": status, "reason": reason_of(error)}


def memory_mb(field: str) -> float:
    """``VmRSS`` or ``VmHWM`` (its peak) of this process, MB.

    Not ``ru_maxrss``, which starts at what the parent had when it forked.
    """
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith(f"{field}:")) / 1024
    except (OSError, StopIteration):
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
