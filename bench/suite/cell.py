"""The worker process: fits one adapter and generates the motions of its cells.

Started as ``python -m bench.suite.cell JOB.json PIPE_FD``. Everything the method prints goes to the log that the parent
made stdout and stderr; messages travel as JSON lines on their own pipe.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import threading
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.adapters.base import Adapter
from bench.adapters.loading import AdapterSource, find_adapter
from bench.adapters.oracles import Oracle, World
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.errors import BadMotion, BadOutput, BenchError
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.protocols.base import Task
from bench.suite.motions import Motions
from bench.suite.store import Store

Send = Callable[[dict[str, Any]], None]


@dataclass(frozen=True)
class GenerateJob:
    """One cell's part of a job: which tasks to answer, and the key under which the motions go into the store."""

    key: str
    tasks_file: str
    window_frames: int


@dataclass(frozen=True)
class Job:
    """Everything a worker needs, as JSON."""

    source: AdapterSource
    dataset: str
    pack: str
    store: str
    fit_take_ids: tuple[str, ...]
    fit_key: str
    budget: str
    seed: int
    cells: tuple[GenerateJob, ...]

    @classmethod
    def read(cls, path: Path) -> Job:
        """Restore a job from the file the parent wrote."""
        data = json.loads(path.read_text())
        return cls(
            **{
                **data,
                "source": AdapterSource(**data["source"]),
                "fit_take_ids": tuple(data["fit_take_ids"]),
                "cells": tuple(GenerateJob(**cell) for cell in data["cells"]),
            }
        )


def main(arguments: list[str]) -> int:
    """Run a job; every outcome is a message, the exit code only says whether the worker itself lived."""
    threading.Thread(target=_leave_with_parent, args=(os.getppid(),), daemon=True).start()
    pipe = os.fdopen(int(arguments[1]), "w", buffering=1)

    def send(message: dict[str, Any]) -> None:
        pipe.write(json.dumps(message) + "\n")

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
            _generate(job, cell, adapter, pack, send)
        except Exception as error:
            send(_failure(cell.key, error))
        else:
            send({"event": "ok", "cell": cell.key})
    return 0


def _leave_with_parent(parent: int) -> None:
    """End this process soon after the one that started it is gone, also in the middle of a long fit."""
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


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
        adapter.fit(takes, seed=job.seed, budget=job.budget, progress=progress)
        adapter.save(folder)
        return {"wall_s": time.perf_counter() - started, "budget": job.budget, "seed": job.seed}

    store.put("fit", job.fit_key, write)


def _fit_view(take: Take) -> Take:
    return take.hidden(content=True, style=True)


def _generate(job: Job, cell: GenerateJob, adapter: Adapter, pack: Pack, send: Send) -> None:
    tasks = [Task(**row) for row in json.loads(Path(cell.tasks_file).read_text())]
    answer = _answering(job, adapter, pack, cell.window_frames)

    def write(folder: Path) -> dict[str, Any]:
        started, last_report = time.perf_counter(), 0.0
        answers: list[Take] = []
        for index, task in enumerate(tasks):
            answers.append(answer(task))
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


def _answering(job: Job, adapter: Adapter, pack: Pack, n_frames: int) -> Callable[[Task], Take]:
    """A function from task to answer, with the labels under which the answer is scored."""
    if isinstance(adapter, Oracle):
        oracle = adapter
        world = _world(job, pack)

        def answer_oracle(task: Task) -> Take:
            content, style = _take_pair(task, pack, n_frames)
            rng = np.random.default_rng(task.seed)
            take = oracle.answer(content, task.start_frame, style, world, rng=rng)
            return take.with_clip(checked(take.clip, content.clip, task.sample_id, own_bones=True))

        return answer_oracle

    traits = adapter.traits

    def answer(task: Task) -> Take:
        content, style = _take_pair(task, pack, n_frames)
        clip = adapter.transfer(
            content.hidden(content=traits.needs_content_label, style=traits.needs_source_style_label),
            style.hidden(content=False, style=traits.needs_style_label),
            rng=np.random.default_rng(task.seed),
        )
        checked_clip = checked(clip, content.clip, task.sample_id, own_bones=False)
        return Take(checked_clip, content=task.content, style=task.target_style)

    return answer


def _take_pair(task: Task, pack: Pack, n_frames: int) -> tuple[Take, Take]:
    content = pack.take(task.content_take_id)
    return content.with_clip(window(content.clip, task.start_frame, n_frames)), pack.take(task.style_take_id)


def _world(job: Job, pack: Pack) -> World:
    fit = [pack.take(take_id) for take_id in job.fit_take_ids]
    if job.dataset != "procedural":
        return World(fit)
    from bench.datasets.procedural import true_answer

    return World(fit, true_answer)


def checked(clip: object, source: Clip, sample_id: str, *, own_bones: bool) -> Clip:
    """An answer that may be scored: a Clip with the source's frames, fps and bones.

    Raises
    ------
    BadOutput : naming the sample, what was expected and what came.
    """
    if not isinstance(clip, Clip):
        raise BadOutput(f"expected a Clip, got {type(clip).__name__}", where=sample_id)
    if clip.n_frames != source.n_frames:
        raise BadOutput(f"expected {source.n_frames} frames, got {clip.n_frames}", where=sample_id)
    if abs(clip.fps - source.fps) > 1e-6:
        raise BadOutput(f"expected {source.fps} fps, got {clip.fps}", where=sample_id)
    if not clip.skeleton.is_canonical:
        raise BadOutput("expected the canonical 21 joints", where=sample_id)
    if not own_bones and not clip.skeleton.same_bones(source.skeleton):
        raise BadOutput(
            "the output's bones differ from the content clip's",
            where=sample_id,
            cause="the style reference's skeleton was returned",
            remedy="answer with content.clip.with_motion(...) or bench.motion.pose.onto_skeleton(...)",
        )
    return clip


def _failure(key: str, error: Exception) -> dict[str, Any]:
    traceback.print_exc()
    status = "invalid" if isinstance(error, BadOutput | BadMotion) else "failed"
    if isinstance(error, MemoryError):
        status = "oom"
    text = str(error) if isinstance(error, BenchError) else f"{type(error).__name__}: {error}"
    return {"event": "failed", "cell": key, "status": status, "reason": " ".join(text.split())}


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
