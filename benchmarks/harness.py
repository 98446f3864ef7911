"""What the harness adds to a method: ``python benchmarks/harness.py``.

A thousand tasks of the transfer track answered by an adapter that does nothing, in this process as in a warm worker:
reading takes, cutting windows, hiding labels, checking answers; then collecting, digesting and storing them. Then the
same thousand in a hundred cells of one worker process: what a cell costs once the worker is warm, and what its start
costs. A run starts a worker for each cell.
"""

# ruff: noqa: T201
from __future__ import annotations

import json
import resource
import tempfile
import time
from pathlib import Path

from bench.adapters.anchors import CopyContent
from bench.adapters.loading import AdapterSource
from bench.adapters.oracles import World
from bench.datasets.pack import Pack
from bench.datasets.table import load_dataset
from bench.protocols import PROTOCOLS
from bench.suite.answering import answering
from bench.suite.cell import GenerateJob, Job
from bench.suite.motions import Motions
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from bench.suite.workers import Limits, run_job

CELLS, TASKS_A_CELL = 100, 10


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        store = Store(Path(folder))
        setting = prepare(load_dataset("procedural", None, None), PROTOCOLS["stylebench-transfer@1"], "quick", store)
        pack = Pack.open(setting.pack_folder)
        answer = answering(CopyContent(), "transfer", setting.protocol.fps, pack, lambda: World([], []))
        for name in ("cold", "warm"):
            start = time.process_time()
            takes = [answer(task) for task in setting.tasks]
            answered = time.process_time()
            motions = Motions.of(takes)
            store.put("motions", motions.digest + name, lambda draft, made=motions: _write(made, draft))
            stored = time.process_time()
            per_clip = 1e3 * (answered - start) / len(takes)
            print(
                f"{name}: {per_clip:.3f} ms a 64-frame clip; {1e3 * (stored - answered):.0f} ms to store {len(takes)}"
            )
        few, many = (_worker_s(setting, store, Path(folder), n_cells) for n_cells in (1, CELLS + 1))
        for name, one, all_of_them in zip(("wall", "processor"), few, many, strict=True):
            a_cell_ms = 1e3 * (all_of_them - one) / CELLS
            print(
                f"{name}: {a_cell_ms:.1f} ms a cell of {TASKS_A_CELL} clips in a warm worker; "
                f"{one:.2f} s for a worker with one cell"
            )


def _worker_s(setting: Setting, store: Store, folder: Path, n_cells: int) -> tuple[float, float]:
    """Wall-clock and processor seconds of a worker that answers cells of ten tasks each."""
    cells = []
    for number in range(n_cells):
        tasks_file = folder / f"tasks-{number}.json"
        first = number * TASKS_A_CELL % len(setting.tasks)
        tasks_file.write_text(json.dumps([task.as_dict() for task in setting.tasks[first : first + TASKS_A_CELL]]))
        cells.append(GenerateJob(f"{n_cells}-{number}", str(tasks_file), "transfer", setting.protocol.fps))
    job = Job(
        AdapterSource("copy-content"), "procedural", str(setting.pack_folder), str(store.root), (), (), "", "smoke", 0,
        tuple(cells),
    )  # fmt: skip
    start, used = time.perf_counter(), _processor_s()
    outcomes = run_job(job, folder / "logs", limits=Limits(), listener=lambda *_: None)
    if {outcome.status for outcome in outcomes.values()} != {"ok"}:
        raise RuntimeError(str(outcomes))
    return time.perf_counter() - start, _processor_s() - used


def _processor_s() -> float:
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def _write(motions: Motions, draft: Path) -> dict[str, object]:
    motions.save(draft)
    return {"n": motions.n}


if __name__ == "__main__":
    main()
