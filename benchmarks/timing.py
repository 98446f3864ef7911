"""How well the runtime track measures: ``python benchmarks/timing.py [--method pose-adain] [--rounds 30]``.

Timed in turns on procedural takes, as in a run: a method twice, which must come out alike; an adapter that copies the
content after a sleep of 5 ms, which must be found to last 5 ms; and beside each call the harness's own part of it.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import json
import sys
import tempfile
from itertools import pairwise
from pathlib import Path

import numpy as np

from bench.adapters.loading import AdapterSource
from bench.datasets.pack import write_pack
from bench.datasets.procedural import load
from bench.protocols.base import Task
from bench.suite.timing.harness import time_adapters
from bench.suite.timing.plan import TimingJob, TimingPlan
from bench.suite.timing.results import Timings
from bench.suite.workers import Limits

APART_TARGET_PERCENT, SLEEP_TARGET_PERCENT, OVERHEAD_TARGET_US = 3.0, 5.0, 20.0
SLEEP_MS = 5.0
SLEEPING = f"""
import time
from bench.adapters.base import Adapter

class Sleeping(Adapter):
    name = "sleeping"

    def transfer(self, content, style, *, rng):
        time.sleep({SLEEP_MS / 1e3})
        return content.clip
"""


def jobs_in(folder: Path, method: str) -> list[TimingJob]:
    """Two of the method and one that sleeps, on every 29th procedural take in the style of the one after it."""
    takes = load(None).takes[::29]
    (folder / "pack").mkdir()
    write_pack(folder / "pack", takes)
    tasks = [
        Task(f"s{i:04d}", content.take_id, 0, style.take_id, str(content.content), str(content.style),
             str(style.style), str(style.content), i)
        for i, (content, style) in enumerate(pairwise(takes))
    ]  # fmt: skip
    (folder / "tasks.json").write_text(json.dumps([task.as_dict() for task in tasks]))
    (folder / "sleeping.py").write_text(SLEEPING)
    sources = {
        f"{method}, one": AdapterSource(method),
        f"{method}, other": AdapterSource(method),
        "sleeping": AdapterSource("sleeping", str(folder / "sleeping.py")),
    }
    return [
        TimingJob(key, source, str(folder / "pack"), str(folder / "store"), "", str(folder / "tasks.json"), 0)
        for key, source in sources.items()
    ]


def verdict(what: str, got: float, target: float, unit: str) -> bool:
    ok = got < target
    print(f"{what:52s} {got:8.2f} {unit} (below {target:g}: {'yes' if ok else 'NO'})")
    return ok


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--method", default="pose-adain")
    parser.add_argument("--rounds", type=int, default=30)
    arguments = parser.parse_args()
    plan = TimingPlan(rounds=arguments.rounds)
    found: dict[str, Timings] = {}
    with tempfile.TemporaryDirectory() as folder:
        jobs = jobs_in(Path(folder), arguments.method)
        results = time_adapters(jobs, plan, Path(folder) / "scratch", limits=Limits(), progress=lambda *_: None)
    for key, result in results.items():
        if not isinstance(result, Timings):
            print(f"{key}: {result.status}: {result.reason}")
            return 1
        found[key] = result
    one, other, sleeping = found.values()
    waited = 100.0 * float(
        1.0
        - sum(one.own_s(name).sum() for name in plan.slices) / sum(one.durations_s[name].sum() for name in plan.slices)
    )
    threads = ", ".join(f"{kind} {count}" for kind, count in one.facts.threads.items())
    print(
        f"blocks of up to {plan.calls} calls, {plan.rounds} rounds; threads: {threads}; "
        f"loaded in {one.facts.load_s:.2f} s; {waited:.0f} % of the timed seconds were spent waiting for a core"
    )
    print(f"{'median call':24s}" + "".join(f"{name:>16s}" for name in plan.slices))
    for key, timings in found.items():
        print(f"{key:24s}" + "".join(f"{1e3 * np.median(timings.own_s(name)):13.4f} ms" for name in plan.slices))
    apart = [
        100.0 * abs(float(np.median(one.own_s(name)) / np.median(other.own_s(name))) - 1.0) for name in plan.slices
    ]
    off = [100.0 * abs(1e3 * float(np.median(sleeping.own_s(name))) / SLEEP_MS - 1.0) for name in plan.slices]
    overhead = [1e6 * float(np.median(timings.overhead_s[name])) for timings in found.values() for name in plan.slices]
    ok = [
        verdict("two identical adapters, medians apart by at most", max(apart), APART_TARGET_PERCENT, "%"),
        verdict(f"a sleep of {SLEEP_MS:g} ms, median off by at most", max(off), SLEEP_TARGET_PERCENT, "%"),
        verdict("the harness's own part of a call, at most", max(overhead), OVERHEAD_TARGET_US, "us"),
    ]
    return 0 if all(ok) else 1


if __name__ == "__main__":
    sys.exit(main())
