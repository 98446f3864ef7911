"""The setting of a run: one protocol on one dataset, split, with its fixed task list."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from bench.datasets.base import Dataset
from bench.datasets.pack import write_pack
from bench.datasets.split import Split, deal
from bench.datasets.take import Take
from bench.protocols.base import Protocol, Task, stable_seed
from bench.suite.store import Store
from reports.records import digest_of, write_text_atomically


@dataclass(frozen=True, eq=False)
class Setting:
    """One protocol on one dataset.

    Attributes
    ----------
    dataset : as loaded; ``takes`` below carry judged contents instead of native ones.
    takes : every take under its judged content.
    split : dealt on native contents.
    protocol, profile : the recipe and how much of it.
    tasks : the fixed list.
    pack_folder : the takes as a folder that worker processes map.
    """

    dataset: Dataset
    takes: tuple[Take, ...]
    split: Split
    protocol: Protocol
    profile: str
    tasks: tuple[Task, ...]
    pack_folder: Path

    @cached_property
    def tasks_digest(self) -> str:
        return digest_of([task.as_dict() for task in self.tasks])

    def part(self, *parts: str) -> list[Take]:
        """The takes of some parts, under judged contents."""
        return self.split.select(self.takes, *parts)

    def part_digest(self, *parts: str) -> str:
        """Digest of which takes of which dataset are in some parts."""
        return digest_of({"dataset": self.dataset.digest, "takes": [take.take_id for take in self.part(*parts)]})

    def write_tasks(self, store: Store) -> Path:
        """The task list as a file for workers; written once per list."""
        path = store.root / "tasks" / f"{self.tasks_digest}.json"
        if not path.is_file():
            write_text_atomically(path, json.dumps([task.as_dict() for task in self.tasks]))
        return path


def prepare(
    dataset: Dataset,
    protocol: Protocol,
    profile: str,
    store: Store,
    *,
    split_kind: str = "default",
    split_seed: int = 0,
) -> Setting:
    """Split a dataset, make the task list and lay the takes out for workers."""
    split = deal(dataset.takes, kind=split_kind, seed=split_seed)
    takes = tuple(replace(take, content=dataset.judged_content[str(take.content)]) for take in dataset.takes)
    seed = stable_seed(protocol.protocol_id, dataset.digest, split.digest)
    tasks = protocol.make_tasks(split.select(takes, "test"), protocol.n_samples[profile], seed)
    pack_key = digest_of({"dataset": dataset.digest, "labels": sorted(dataset.judged_content.items())})
    if not store.has("takes", pack_key):
        store.put("takes", pack_key, lambda folder: _write_takes(folder, takes))
    return Setting(dataset, takes, split, protocol, profile, tuple(tasks), store.folder("takes", pack_key))


def _write_takes(folder: Path, takes: Sequence[Take]) -> dict[str, Any]:
    write_pack(folder, takes)
    return {"n": len(takes)}
