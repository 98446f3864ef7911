"""Adapters, takes and tasks for tests of the runtime track."""

from __future__ import annotations

import json
from pathlib import Path

from bench.adapters.base import Adapter
from bench.adapters.loading import AdapterSource
from bench.datasets.pack import write_pack
from bench.datasets.take import Take
from bench.protocols.base import Task
from bench.suite.timing.calls import Calls, timed_inputs
from bench.suite.timing.plan import TimingJob, TimingPlan
from tests.motion.factory import random_clip

HEAD = """
import os, sys, time
import numpy as np
from bench.adapters.base import Adapter, Description, Traits
from bench.motion.clip import Clip

"""
SMALL = TimingPlan(lengths=(20, 30), past_frames=8, n_inputs=2, warm_up_calls=3, rounds=3, calls=2, block_s=60.0)


def world(folder: Path) -> None:
    """Four short takes and four tasks."""
    takes = [
        Take(random_clip(50, seed=place), f"{content}_{style}", "toy", content, style)
        for place, (content, style) in enumerate((c, s) for c in ("run", "walk") for s in ("angry", "old"))
    ]
    (folder / "pack").mkdir(exist_ok=True)
    write_pack(folder / "pack", takes)
    tasks = [
        Task(f"s{i:04d}", take.take_id, 0, takes[i - 1].take_id, str(take.content), str(take.style),
             str(takes[i - 1].style), str(takes[i - 1].content), i)
        for i, take in enumerate(takes)
    ]  # fmt: skip
    (folder / "tasks.json").write_text(json.dumps([task.as_dict() for task in tasks]))


def job_of(folder: Path, source: AdapterSource, key: str = "job") -> TimingJob:
    """A job on the takes that :func:`world` left in the folder."""
    return TimingJob(key, source, str(folder / "pack"), str(folder / "store"), "", str(folder / "tasks.json"), 7)


def written(folder: Path, name: str, transfer: str, rest: str = "") -> AdapterSource:
    """An adapter file whose ``transfer`` has this body."""
    body = "\n".join(f"        {line}" for line in transfer.splitlines())
    text = (
        f'class Mine(Adapter):\n    name = "{name}"\n{rest}\n    def transfer(self, content, style, *, rng):\n{body}\n'
    )
    path = folder / f"{name}.py"
    path.write_text(HEAD + text)
    return AdapterSource(name, str(path))


class Ticker:
    """Clocks that stand still unless they are moved."""

    knows_waiting = True

    def __init__(self) -> None:
        self.ns = self.waited = 0

    def now_ns(self) -> int:
        return self.ns

    def waited_ns(self) -> int:
        return self.waited


def calls_of(folder: Path, adapter: Adapter, clock: Ticker, plan: TimingPlan = SMALL) -> Calls:
    """The calls of an adapter on the small plan."""
    world(folder)
    job = job_of(folder, AdapterSource("mine"))
    return Calls(adapter, timed_inputs(job, plan, adapter), plan, job.seed, clock)
