"""The worker process: fits one adapter and generates the motions of its cells.

Started as ``python -m bench.suite.cell JOB.json``. Messages travel as JSON lines on what was stdout at the start;
everything the method prints goes to stderr, which is the log.
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.adapters.base import Adapter
from bench.adapters.loading import AdapterSource, find_adapter
from bench.adapters.oracles import World
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.suite.answering import answering
from bench.suite.child import leave_if_forked, leave_with_parent, reason_of, status_of
from bench.suite.motions import Motions
from bench.suite.setting import read_tasks
from bench.suite.store import Store
from bench.suite.truth import KNOWN_FOR

Send = Callable[[dict[str, Any]], None]

FIT_ONLY = "fit"
"""In place of a track: the adapter is fitted and nothing is generated."""


@dataclass(frozen=True)
class GenerateJob:
    """One cell's part of a job: which tasks to answer, and the key under which the motions go into the store."""

    key: str
    tasks_file: str
    track: str
    fps: float


@dataclass(frozen=True)
class Job:
    """Everything a worker needs, as JSON."""

    source: AdapterSource
    dataset: str
    pack: str
    store: str
    fit_take_ids: tuple[str, ...]
    disjoint_take_ids: tuple[str, ...]
    fit_key: str
    budget: str
    seed: int
    cells: tuple[GenerateJob, ...]
    device: str = "cpu"

    @classmethod
    def read(cls, path: Path) -> Job:
        """Restore a job from the file the parent wrote."""
        data = json.loads(path.read_text())
        return cls(
            **{
                **data,
                "source": AdapterSource(**data["source"]),
                "fit_take_ids": tuple(data["fit_take_ids"]),
                "disjoint_take_ids": tuple(data["disjoint_take_ids"]),
                "cells": tuple(GenerateJob(**cell) for cell in data["cells"]),
            }
        )


def main(arguments: list[str]) -> int:
    """Run a job; every outcome is a message, the exit code only says whether the worker itself lived."""
    leave_with_parent(os.getppid())
    own = os.getpid()
    line = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)

    def send(message: dict[str, Any]) -> None:
        leave_if_forked(own)
        line.write(json.dumps(message) + "\n")

    job = Job.read(Path(arguments[0]))
    try:
        adapter, pack = _ready_adapter(job, send)
    except Exception as error:
        for cell in job.cells:
            send(_failure(cell.key, error))
        return 0
    for cell in job.cells:
        send({"event": "begin", "cell": cell.key})
        try:
            if cell.track != FIT_ONLY:
                _generate(job, cell, adapter, pack, send)
        except Exception as error:
            send(_failure(cell.key, error))
        else:
            send({"event": "ok", "cell": cell.key})
    return 0


def _ready_adapter(job: Job, send: Send) -> tuple[Adapter, Pack]:
    adapter_class = find_adapter(job.source)
    adapter = adapter_class()
    pack = Pack.open(Path(job.pack))
    store = Store(Path(job.store))
    if adapter_class.fits():
        if not store.has("fit", job.fit_key):
            _fit(job, adapter, pack, store, send)
        adapter = adapter_class()
        adapter.load(store.folder("fit", job.fit_key))
    return adapter, pack


def _fit(job: Job, adapter: Adapter, pack: Pack, store: Store, send: Send) -> None:
    def progress(what: str, done: int, total: int) -> None:
        send({"event": "progress", "cell": "fit", "what": what, "done": done, "total": total})

    def write(folder: Path) -> dict[str, Any]:
        started = time.perf_counter()
        takes = [_fit_view(pack.take(take_id)) for take_id in job.fit_take_ids]
        adapter.device, adapter.checkpoints = job.device, checkpoints
        adapter.fit(takes, seed=job.seed, budget=job.budget, progress=progress)
        adapter.save(folder)
        return {"wall_s": time.perf_counter() - started, "budget": job.budget, "seed": job.seed}

    checkpoints = store.folder("checkpoints", job.fit_key)
    store.put("fit", job.fit_key, write)
    shutil.rmtree(checkpoints, ignore_errors=True)


def _fit_view(take: Take) -> Take:
    return take.hidden(content=True, style=True)


def _generate(job: Job, cell: GenerateJob, adapter: Adapter, pack: Pack, send: Send) -> None:
    tasks = read_tasks(Path(cell.tasks_file))
    answer = answering(
        adapter, cell.track, cell.fps, pack,
        lambda: world_of(job.dataset, pack, job.fit_take_ids, job.disjoint_take_ids),
    )  # fmt: skip

    def write(folder: Path) -> dict[str, Any]:
        started, last_report, own = time.perf_counter(), 0.0, os.getpid()
        answers: list[Take] = []
        for index, task in enumerate(tasks):
            answers.append(answer(task))
            leave_if_forked(own)
            if time.perf_counter() - last_report > 0.5:
                last_report = time.perf_counter()
                send({"event": "progress", "cell": cell.key, "what": "generate", "done": index, "total": len(tasks)})
        motions = Motions.of(answers)
        motions.save(folder)
        return {
            "motions_digest": motions.digest,
            "n": motions.n,
            "wall_s": time.perf_counter() - started,
            "peak_rss_mb": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024,
        }

    Store(Path(job.store)).put("motions", cell.key, write)


def world_of(dataset: str, pack: Pack, fit_take_ids: Sequence[str], disjoint_take_ids: Sequence[str]) -> World:
    """What oracles know."""
    fit, disjoint = ([pack.take(take_id) for take_id in ids] for ids in (fit_take_ids, disjoint_take_ids))
    if dataset != KNOWN_FOR:
        return World(fit, disjoint, pack.by_id)
    from bench.datasets.procedural import imitated, true_answer

    return World(fit, disjoint, pack.by_id, true_answer, imitated)


def _failure(key: str, error: Exception) -> dict[str, Any]:
    traceback.print_exc()
    return {"event": "failed", "cell": key, "status": status_of(error), "reason": reason_of(error)}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
