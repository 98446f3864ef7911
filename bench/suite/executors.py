"""Where calls run: processes on this machine, or the workers of a Dask scheduler; a lost worker costs one more try."""

from __future__ import annotations

import multiprocessing
import os
import queue
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    ThreadPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

from bench.errors import BadConfig, BenchError
from bench.suite.calls import MOST_ATTEMPTS, Call, run_call
from bench.suite.child import leave_with_parent
from bench.suite.machines import Wanted, problems_here

POLL_S = 0.5
CONNECT_S = 20
WORKERS_WITHIN_S = 60

Answered = TypeVar("Answered")


@dataclass(frozen=True)
class Workers:
    """An executor, and which of its errors say that a worker went while it was at a call.

    ``check`` raises where a worker cannot do what a run wants.
    """

    executor: Executor
    losses: tuple[type[BaseException], ...]
    check: Callable[[Wanted], None]

    def run(
        self,
        calls: Sequence[Call[Answered]],
        *,
        done: Callable[[int], None] = lambda number: None,
        waiting: Callable[[], None] = lambda: None,
    ) -> list[Answered]:
        """The answers to some calls, in their order.

        ``done`` hears how many have ended, ``waiting`` is called every half second.

        Raises
        ------
        BenchError : the scheduler went away.
        """
        futures: dict[Future[Answered], int] = {self._submit(call): place for place, call in enumerate(calls)}
        losses = [0] * len(calls)
        answers: dict[int, Answered] = {}
        while futures:
            for future in wait(futures, timeout=POLL_S, return_when=FIRST_COMPLETED).done:
                place = futures.pop(future)
                try:
                    answers[place] = future.result()
                except CancelledError:
                    raise BenchError(
                        "the scheduler was lost",
                        where="--scheduler",
                        remedy="start it and its workers again, then the same command: finished work is kept",
                    ) from None
                except self.losses as loss:
                    losses[place] += 1
                    if losses[place] < MOST_ATTEMPTS:
                        futures[self._submit(calls[place])] = place
                        continue
                    answers[place] = calls[place].lost(f"its worker was lost twice: {' '.join(str(loss).split())}")
                done(len(answers))
            waiting()
        return [answers[place] for place in range(len(calls))]

    def _submit(self, call: Call[Answered]) -> Future[Answered]:
        return self.executor.submit(run_call, call)


@contextmanager
def workers_of(scheduler: str, jobs: int) -> Iterator[Workers]:
    """``jobs`` processes of this machine, or with ``scheduler`` the workers behind that address.

    Raises
    ------
    BadConfig : no Dask here, or nothing answers at the address.
    """
    if scheduler:
        with _cluster(scheduler) as workers:
            yield workers
        return
    executor = LocalProcesses(jobs)
    try:
        yield Workers(executor, (BrokenProcessPool,), lambda wanted: None)
    finally:
        executor.shutdown(cancel_futures=True)


class LocalProcesses(Executor):
    """Processes of this machine. One that is killed costs the call it was at and no other, and is replaced."""

    def __init__(self, jobs: int) -> None:
        self._threads = ThreadPoolExecutor(jobs)
        self._idle: queue.SimpleQueue[ProcessPoolExecutor] = queue.SimpleQueue()
        for _ in range(jobs):
            self._idle.put(_one_process())

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        return self._threads.submit(self._in_a_process, fn, args, kwargs)

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        self._threads.shutdown(wait=wait, cancel_futures=cancel_futures)
        while not self._idle.empty():
            self._idle.get().shutdown(wait=wait)

    def _in_a_process(self, fn: Callable[..., Any], args: tuple[Any, ...], kwargs: dict[str, Any]) -> Any:
        process = self._idle.get()
        try:
            return process.submit(fn, *args, **kwargs).result()
        except BrokenProcessPool:
            process.shutdown()
            process = _one_process()
            raise
        finally:
            self._idle.put(process)


def _one_process() -> ProcessPoolExecutor:
    context = multiprocessing.get_context("spawn")
    return ProcessPoolExecutor(1, mp_context=context, initializer=_watch_parent, initargs=(os.getpid(),))


def _watch_parent(parent: int) -> None:
    """A pool's process waits for work for ever, also when nobody lives to send any."""
    leave_with_parent(parent)


@contextmanager
def _cluster(scheduler: str) -> Iterator[Workers]:
    try:
        import distributed
    except ImportError:
        raise BadConfig(
            "dask.distributed is not installed", where="--scheduler", remedy="pip install 'stylebench[cluster]'"
        ) from None
    connect: Any = distributed.Client
    place = {"scheduler_file": scheduler} if scheduler.endswith(".json") else {"address": scheduler}
    if "scheduler_file" in place and not Path(scheduler).is_file():
        raise BadConfig(
            f"no file {scheduler}", where="--scheduler", remedy="'dask scheduler --scheduler-file' writes it"
        )
    try:
        client = connect(**place, timeout=CONNECT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        raise BadConfig(
            f"no Dask scheduler answers at {scheduler}: {' '.join(str(error).split())}",
            where="--scheduler",
            remedy="start one with 'dask scheduler' and give the address that it prints",
        ) from error
    with client:

        def check(wanted: Wanted) -> None:
            _check_cluster(client, scheduler, wanted)

        yield Workers(client.get_executor(pure=False, retries=0), (distributed.KilledWorker,), check)


def _check_cluster(client: Any, scheduler: str, wanted: Wanted) -> None:
    try:
        client.wait_for_workers(1, timeout=WORKERS_WITHIN_S)
    except TimeoutError:
        raise BadConfig(
            f"the scheduler at {scheduler} has no workers",
            where="--scheduler",
            remedy=f"start some with 'dask worker {scheduler} --nthreads 1'",
        ) from None
    problems = {
        address: f"runs {threads} cells beside each other: start it with --nthreads 1"
        for address, threads in client.nthreads().items()
        if threads != 1
    }
    for address, found in client.run(problems_here, wanted, on_error="return").items():
        if isinstance(found, BaseException):
            found = f"cannot run this project ({type(found).__name__}: {found}): install it there too"
        if found:
            problems.setdefault(address, found)
    if problems:
        raise BadConfig(
            f"{len(problems)} of {len(client.nthreads())} workers cannot take part: "
            + "; ".join(f"{address} {problem}" for address, problem in sorted(problems.items())),
            where="--scheduler",
            remedy="docs/many-machines.md says what a worker needs",
        )
