"""The setting of a run: one protocol on one dataset, split, with its fixed task list."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

from bench.datasets.base import Dataset
from bench.datasets.pack import write_pack
from bench.datasets.split import PARTS, Split, deal
from bench.datasets.take import Take
from bench.protocols.base import Protocol, Task, TaskPool, stable_seed
from bench.suite.store import Store
from reports.records import digest_of, write_text_atomically

PACK_VERSION = 1


@dataclass(frozen=True, eq=False)
class Setting:
    """One protocol on one dataset.

    Attributes
    ----------
    dataset : as loaded.
    takes : every take, under its judged content where judges take part.
    split : dealt on native contents.
    protocol, profile : the recipe and how much of it.
    tasks : the fixed list.
    fit_take_ids : what methods are trained on.
    pack_folder : all takes, those that the protocol makes itself included, as a folder that worker processes map.
    """

    dataset: Dataset
    takes: tuple[Take, ...]
    split: Split
    protocol: Protocol
    profile: str
    tasks: tuple[Task, ...]
    fit_take_ids: tuple[str, ...]
    pack_folder: Path

    @cached_property
    def tasks_digest(self) -> str:
        return digest_of([task.as_dict() for task in self.tasks])

    def part(self, *parts: str) -> list[Take]:
        """The takes of some parts."""
        return self.split.select(self.takes, *parts)

    def part_digest(self, *parts: str) -> str:
        """Digest of which takes of which dataset are in some parts."""
        return self._takes_digest([take.take_id for take in self.part(*parts)])

    @property
    def content_labels(self) -> tuple[str, ...]:
        """Contents of the takes, sorted."""
        return tuple(sorted({str(take.content) for take in self.takes}))

    @property
    def fit_digest(self) -> str:
        """Digest of what methods are trained on."""
        return self._takes_digest(self.fit_take_ids)

    def _takes_digest(self, take_ids: Sequence[str]) -> str:
        return digest_of({"dataset": self.dataset.digest, "takes": list(take_ids)})

    def write_tasks(self, store: Store) -> Path:
        """The task list as a file for workers; written once per list."""
        path = store.root / "tasks" / f"{self.tasks_digest}.json"
        if not path.is_file():
            write_text_atomically(path, json.dumps([task.as_dict() for task in self.tasks]))
        return path


def read_tasks(path: Path) -> tuple[Task, ...]:
    """The tasks that :meth:`Setting.write_tasks` wrote."""
    return tuple(Task.from_dict(row) for row in json.loads(path.read_text(encoding="utf-8")))


def prepare(
    dataset: Dataset,
    protocol: Protocol,
    profile: str,
    store: Store,
    *,
    split_kind: str = "default",
    split_seed: int = 0,
    foreign: Dataset | None = None,
) -> Setting:
    """Split a dataset, make the task list and lay the takes out for workers.

    ``foreign`` is another dataset, for the condition whose contents come from elsewhere.

    Raises
    ------
    BadData : the protocol cannot be made of this data.
    """
    split = deal(dataset.takes, kind=split_kind, seed=split_seed)
    labels = dataset.judged_content if protocol.judged else {name: name for name in dataset.native_content_labels}
    takes = tuple(replace(take, content=labels[str(take.content)]) for take in dataset.takes)
    seed = stable_seed(protocol.label, dataset.digest, split.digest)
    by_part = {part: split.select(dataset.takes, part) for part in PARTS}
    extra = protocol.extra_takes(by_part, foreign, seed) if protocol.extra_takes else []
    extra_fit = protocol.extra_fit(by_part, foreign, seed) if protocol.extra_fit else []
    pool = TaskPool(split.select(takes, *protocol.source_parts), extra)
    tasks = protocol.make_tasks(pool, protocol.n_samples[profile], seed)
    fit = extra_fit or split.select(takes, "fit")
    facts: dict[str, Any] = {"dataset": dataset.digest, "labels": sorted(labels.items())}
    if extra or extra_fit:
        # Ids of made takes name their pieces, so protocols that make the same ones share a folder.
        facts |= {"version": PACK_VERSION, "made": sorted(take.take_id for take in (*extra, *extra_fit))}
        facts |= {"foreign": foreign.digest} if foreign else {}
    return Setting(
        dataset=dataset,
        takes=takes,
        split=split,
        protocol=protocol,
        profile=profile,
        tasks=tuple(tasks),
        fit_take_ids=tuple(take.take_id for take in fit),
        pack_folder=_packed(store, facts, takes, (*extra, *extra_fit)),
    )


def _packed(store: Store, facts: Mapping[str, Any], takes: Sequence[Take], extra: Sequence[Take]) -> Path:
    """The folder of all takes, made once for the ``facts`` that decide what is in it."""
    key = digest_of(dict(facts))
    if not store.has("takes", key):

        def write(folder: Path) -> dict[str, Any]:
            write_pack(folder, (*takes, *extra))
            return {"n": len(takes) + len(extra)}

        store.put("takes", key, write)
    return store.folder("takes", key)
