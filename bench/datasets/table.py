"""DATASETS: the table of all datasets."""

from __future__ import annotations

from pathlib import Path

from bench.datasets import bandai_namco, bvh_folder, procedural, style100, xia2015, zeroeggs
from bench.datasets.base import Dataset, DatasetEntry, ProgressCallback
from bench.errors import BadConfig, BadData

DATASETS: dict[str, DatasetEntry] = {
    "procedural": procedural.ENTRY,
    "bandai-namco": bandai_namco.ENTRY,
    "xia2015": xia2015.ENTRY,
    "100style": style100.ENTRY,
    "zeroeggs": zeroeggs.ENTRY,
    "bvh-folder": bvh_folder.ENTRY,
}
"""Name on the command line -> how to load it."""


def load_dataset(name: str, path: Path | None, progress: ProgressCallback | None = None) -> Dataset:
    """Load a dataset by name.

    Raises
    ------
    BadConfig : unknown name, or a path given or missing where it should not be.
    BadData, BadFile : see the dataset's own module.
    """
    entry = DATASETS.get(name)
    if entry is None:
        raise BadConfig(f"unknown dataset {name!r}", remedy=f"choose from {', '.join(DATASETS)}")
    if entry.needs_path and path is None:
        raise BadConfig(f"dataset {name} is read from your disk", remedy=f"--data {name}=PATH; {entry.how_to_get}")
    if not entry.needs_path and path is not None:
        raise BadConfig(f"dataset {name} is generated and takes no path", remedy=f"--data {name}")
    if path is not None and not path.exists():
        raise BadData(f"no such file or folder: {path}", where=f"--data {name}", remedy=entry.how_to_get)
    return entry.load(path, progress)


def how_to_place(name: str) -> str:
    """How to obtain a dataset, where to put it and what to do then; needs no network.

    Raises
    ------
    BadConfig : unknown name.
    """
    entry = DATASETS.get(name)
    if entry is None:
        raise BadConfig(f"unknown dataset {name!r}", remedy=f"choose from {', '.join(DATASETS)}")
    if not entry.needs_path:
        return f"{name} is generated; there is nothing to fetch"
    return (
        f"{name}: {entry.how_to_get}.\nLicence: {entry.licence}.\nCite: {entry.citation}.\n"
        f"It is not downloaded for you, as there is no address with a published checksum. Place it anywhere, then:\n"
        f"  stylebench data verify {name}=PATH\n  stylebench data info {name}=PATH\n  stylebench run --data {name}=PATH"
    )
