"""What the harness adds to a method: ``python benchmarks/harness.py``.

A thousand tasks of the transfer track answered by an adapter that does nothing, in this process as in a warm worker:
reading takes, cutting windows, hiding labels, checking answers; then collecting, digesting and storing them.
"""

# ruff: noqa: T201
from __future__ import annotations

import tempfile
import time
from pathlib import Path

from bench.adapters.anchors import CopyContent
from bench.adapters.oracles import World
from bench.datasets.pack import Pack
from bench.datasets.table import load_dataset
from bench.protocols import PROTOCOLS
from bench.suite.answering import answering
from bench.suite.motions import Motions
from bench.suite.setting import prepare
from bench.suite.store import Store


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


def _write(motions: Motions, draft: Path) -> dict[str, object]:
    motions.save(draft)
    return {"n": motions.n}


if __name__ == "__main__":
    main()
