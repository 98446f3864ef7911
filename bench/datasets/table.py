"""DATASETS: the table of all datasets."""

from __future__ import annotations

from pathlib import Path

from bench.datasets import bandai_namco, bvh_folder, procedural, style100, xia2015, zeroeggs
from bench.datasets.base import Dataset, DatasetEntry, ProgressCallback
from bench.datasets.reading import Overrides
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


def load_dataset(
    name: str, path: Path | None, progress: ProgressCallback | None = None, overrides: Overrides | None = None
) -> Dataset:
    """Load a dataset by name.

    Parameters
    ----------
    overrides : unit, up axis and frame rate of its files, where they are not what the files say or look like.

    Raises
    ------
    BadConfig : unknown name, or a path or overrides given or missing where they should not be.
    BadData, BadFile : see the dataset's own module.
    """
    entry = entry_of(name)
    if entry.needs_path and path is None:
        raise BadConfig(f"dataset {name} is read from your disk", remedy=f"--data {name}=PATH; {entry.how_to_get}")
    if not entry.needs_path and path is not None:
        raise BadConfig(f"dataset {name} is generated and takes no path", remedy=f"--data {name}")
    if path is not None and not path.exists():
        raise BadData(f"no such file or folder: {path}", where=f"--data {name}", remedy=entry.how_to_get)
    if overrides is None or not overrides.given:
        return entry.load(path, progress)
    if entry.load_as is None:
        raise BadConfig(
            f"{', '.join(overrides.given)} of dataset {name} cannot be given",
            cause="it is generated" if not entry.needs_path else "it is compared with digests of what was published",
            remedy="leave it out" if not entry.needs_path else "read the folder as bvh-folder",
        )
    return entry.load_as(path, progress, overrides)


def entry_of(name: str) -> DatasetEntry:
    """The row of a dataset.

    Raises
    ------
    BadConfig : unknown name.
    """
    if name not in DATASETS:
        raise BadConfig(f"unknown dataset {name!r}", remedy=f"choose from {', '.join(DATASETS)}")
    return DATASETS[name]


def how_to_place(name: str) -> str:
    """How to obtain a dataset, where to put it and what to do then; needs no network.

    Raises
    ------
    BadConfig : unknown name.
    """
    entry = entry_of(name)
    if not entry.needs_path:
        return f"{name} is generated; there is nothing to fetch"
    source = "It is not downloaded for you, as there is no fixed address with a known checksum. Place it anywhere"
    if entry.archives:
        lines = "".join(f"  {archive.url}\n    as {archive.file}\n" for archive in entry.archives)
        source = (
            "Without network, place these in the folder that --out names and fetch again, which checks them:\n"
            f"{lines}or place it anywhere"
        )
    return (
        f"{name}: {entry.how_to_get}.\nLicence: {entry.licence}.\nCite: {entry.citation}.\n{source}, then:\n"
        f"  stylebench data verify {name}=PATH\n  stylebench data info {name}=PATH\n  stylebench run --data {name}=PATH"
    )
