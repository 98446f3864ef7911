"""What ``stylebench list`` and ``stylebench data info`` print."""

from __future__ import annotations

from collections import Counter

import numpy as np

from bench.adapters.loading import available_adapters
from bench.datasets.base import Dataset
from bench.datasets.split import PARTS, deal, leak
from bench.datasets.table import DATASETS
from bench.errors import BadConfig, BadData
from bench.metrics import METRICS
from bench.protocols import PROTOCOLS

Listing = tuple[list[str], list[list[str]]]


def listing(what: str) -> Listing:
    """Headers and rows of one of the tables.

    Raises
    ------
    BadConfig : there is no such table.
    """
    tables = {"datasets": _datasets, "methods": _methods, "protocols": _protocols, "metrics": _metrics}
    if what not in tables:
        raise BadConfig(f"nothing called {what!r} to list", remedy=f"choose from {', '.join(tables)}")
    return tables[what]()


def _datasets() -> Listing:
    rows = [[name, entry.summary, entry.licence, entry.how_to_get] for name, entry in DATASETS.items()]
    return ["name", "what", "licence", "how to get it"], rows


def _methods() -> Listing:
    rows = [
        [name, adapter.kind, ", ".join(adapter.capabilities()) or "answers with full knowledge", adapter.description]
        for name, adapter in available_adapters().items()
    ]
    return ["name", "kind", "capabilities", "what"], rows


def _protocols() -> Listing:
    rows = [
        [protocol_id, p.track, ", ".join(f"{k} {n}" for k, n in p.n_samples.items()), p.summary]
        for protocol_id, p in PROTOCOLS.items()
    ]
    return ["name", "track", "samples", "what"], rows


def _metrics() -> Listing:
    rows = [[m.name, str(m.version), m.unit, m.better, m.summary, m.source, m.misleads] for m in METRICS.values()]
    return ["name", "version", "unit", "better", "what", "source", "when it misleads"], rows


def describe_dataset(dataset: Dataset) -> dict[str, str]:
    """Facts of a dataset in words."""
    frames = np.array([take.clip.n_frames for take in dataset.takes])
    seconds = float(sum(take.clip.duration_s for take in dataset.takes))
    statures = sorted({round(take.clip.skeleton.stature_m, 2) for take in dataset.takes})
    return {
        "dataset": dataset.dataset_id,
        "source": dataset.source or "generated",
        "digest": dataset.digest,
        "takes": str(len(dataset.takes)),
        "frames": f"{frames.sum()} ({frames.min()} to {frames.max()} a take, median {int(np.median(frames))})",
        "minutes": f"{seconds / 60.0:.1f}",
        "fps": ", ".join(str(fps) for fps in sorted({take.clip.fps for take in dataset.takes})),
        "joints": f"21, virtual: {', '.join(sorted(dataset.takes[0].clip.skeleton.virtual)) or 'none'}",
        "stature of Head over Toes, m": f"{statures[0]} to {statures[-1]}",
        "judged contents": ", ".join(dataset.content_labels),
        "styles": ", ".join(dataset.style_labels),
        **_describe_split(dataset),
        "licence": dataset.licence,
        "citation": dataset.citation,
        "notes": "; ".join(dataset.notes) or "none",
    }


def _describe_split(dataset: Dataset) -> dict[str, str]:
    try:
        split = deal(dataset.takes)
    except BadData as error:
        return {"default split": f"cannot be dealt: {error}"}
    leaked = leak(dataset.takes, split)
    counts = Counter(split.part_of.values())
    return {
        "default split": ", ".join(f"{part} {counts[part]}" for part in PARTS),
        "leak": f"nearest neighbour in judge or fit: {leaked.share:.0%} of test takes, {leaked.chance:.0%} by chance",
    }


def dataset_table(dataset: Dataset) -> Listing:
    """Takes by native content (rows) and style (columns)."""
    styles = list(dataset.style_labels)
    counts = Counter((take.content, take.style) for take in dataset.takes)
    rows = [[content, *(str(counts[content, style]) for style in styles)] for content in dataset.native_content_labels]
    return ["content", *styles], rows
