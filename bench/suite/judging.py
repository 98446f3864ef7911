"""Which judges a setting gets: the canonical ones where they fit, else local ones, trained once and stored."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.split import Split
from bench.suite.embedding import Embedding
from bench.suite.judges import PRETRAINED, JudgeSet, load_canonical, load_judges, save_judges, train_judges
from bench.suite.keys import embed_key
from bench.suite.motions import Motions
from bench.suite.store import Store
from reports.records import digest_of

JUDGES_VERSION = 1
"""Raised when local judges must be trained again because the way they are trained has changed."""


@dataclass(frozen=True, eq=False)
class JudgesOnDisk:
    """Judges and the folder that other processes load them from."""

    judges: JudgeSet
    folder: Path


def judges_for(
    dataset: Dataset, split: Split, store: Store, *, retrain: bool, progress: ProgressCallback | None
) -> JudgesOnDisk:
    """Canonical judges where data and split are theirs (unless ``retrain``), else local ones from the store.

    Raises
    ------
    JudgeRefused : the judges cannot tell real motions of this dataset apart.
    """
    if not retrain:
        canonical = load_canonical(dataset.dataset_id, dataset.digest, split.digest)
        if canonical is not None:
            return JudgesOnDisk(canonical, PRETRAINED / dataset.dataset_id)
    key = digest_of({"version": JUDGES_VERSION, "dataset": dataset.digest, "split": split.digest})
    if not store.has("judges", key):

        def write(folder: Path) -> dict[str, str]:
            judges = train_judges(dataset, split, progress=progress)
            save_judges(folder, judges)
            return {"digest": judges.digest}

        store.put("judges", key, write)
    folder = store.folder("judges", key)
    return JudgesOnDisk(load_judges(folder), folder)


def embed(judges: JudgeSet, motions: Motions) -> Embedding:
    """What all judges say about a set of motions; native-label judges only serve the judge card."""
    return replace(judges, native=()).evaluate(motions.window_features()).embedding


def stored_embedding(judges: JudgeSet, motions: Motions, store: Store) -> Embedding:
    """:func:`embed`, asked once for the same motions and judges."""
    return stored_answers(judges.digest, lambda: embed(judges, motions), motions, store)


def stored_answers(judges_digest: str, ask: Callable[[], Embedding], motions: Motions, store: Store) -> Embedding:
    """What some judges say about a set of motions, asked once."""
    key = embed_key(motions.digest, judges_digest)
    if not store.has("embed", key):

        def write(folder: Path) -> dict[str, int]:
            ask().save(folder)
            return {"n": motions.n}

        store.put("embed", key, write)
    return Embedding.load(store.folder("embed", key))
