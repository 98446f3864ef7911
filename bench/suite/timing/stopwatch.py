"""Timing calls one by one, and knowing which part of a duration other processes took.

A call's duration is wall-clock time on a monotonic clock. On a busy machine a part of that is no work of the method but
waiting for a core; Linux counts it for each thread (``schedstat``, second number), so it is kept beside the duration.
"""

from __future__ import annotations

import gc
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

SCHEDULER_STATISTICS = "/proc/thread-self/schedstat"


class Stopwatch(Protocol):
    """Two clocks of the calling thread."""

    @property
    def knows_waiting(self) -> bool:
        """False where the second clock stands still."""
        ...

    def now_ns(self) -> int:
        """Monotonic wall clock."""
        ...

    def waited_ns(self) -> int:
        """Time so far in which the thread could have run but other processes had its core, from any start."""
        ...


class HostStopwatch:
    """The clocks of this machine, for the thread that makes it; waiting is 0 where the system does not count it."""

    def __init__(self) -> None:
        self.now_ns = time.perf_counter_ns
        try:
            self._statistics = os.open(SCHEDULER_STATISTICS, os.O_RDONLY | os.O_CLOEXEC)
            self.waited_ns()
        except (OSError, IndexError, ValueError):
            self._statistics = -1

    @property
    def knows_waiting(self) -> bool:
        return self._statistics >= 0

    def waited_ns(self) -> int:
        if self._statistics < 0:
            return 0
        # What other threads of this process computed may be what was waited for: that is the method's own doing.
        others_ns = time.process_time_ns() - time.thread_time_ns()
        return int(os.pread(self._statistics, 80, 0).split()[1]) - others_ns


@dataclass(frozen=True, eq=False)
class TimedCalls:
    """Calls in their order: wall-clock nanoseconds, those of them without a core, and the outputs."""

    durations_ns: list[int]
    waited_ns: list[int]
    outputs: list[Any]


def timed(call: Callable[..., Any], arguments: Sequence[tuple[Any, ...]], stopwatch: Stopwatch) -> TimedCalls:
    """Make the calls without garbage collection in between."""
    durations, waits, outputs = [0] * len(arguments), [0] * len(arguments), [None] * len(arguments)
    now_ns, waited_ns = stopwatch.now_ns, stopwatch.waited_ns
    gc.collect()
    gc.disable()
    try:
        for place, argument in enumerate(arguments):
            waited_before = waited_ns()
            start = now_ns()
            output = call(*argument)
            durations[place] = now_ns() - start
            waits[place] = waited_ns() - waited_before
            outputs[place] = output
    finally:
        gc.enable()
    # Waiting is read outside of the clock's span: more of it than the call lasted fell between the two.
    waits = [wait if 0 < wait < duration else 0 for wait, duration in zip(waits, durations, strict=True)]
    return TimedCalls(durations, waits, outputs)
