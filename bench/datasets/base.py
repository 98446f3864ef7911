"""What a dataset is to the rest of the harness: takes, labels, licence, digest."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

from bench.datasets.reading import Overrides
from bench.datasets.take import Take

ProgressCallback = Callable[[str, int, int], None]
"""Called as ``progress(what, done, total)``."""


@dataclass(frozen=True, eq=False)
class Dataset:
    """A loaded dataset.

    Attributes
    ----------
    name : as on the command line, ``bandai-namco``.
    dataset_id : name and version, ``bandai-namco@1``; ``bandai-namco-local`` where the takes are not the published set.
    digest : blake2b over take names and parsed channel values (real data) or generator version and parameters.
    takes : every take, sorted by take id.
    judged_content : native content label -> the content judges are trained on (identity where nothing is merged).
    licence, citation : printed wherever results are.
    source : where it was read from, for messages.
    notes : what was assumed or left out, one sentence each.
    """

    name: str
    dataset_id: str
    digest: str
    takes: tuple[Take, ...]
    judged_content: Mapping[str, str]
    licence: str
    citation: str
    source: str = ""
    notes: tuple[str, ...] = ()

    @property
    def said(self) -> tuple[str, ...]:
        """The notes under the dataset's name, for the terminal."""
        return tuple(f"{self.dataset_id}: {note}" for note in self.notes)

    @property
    def content_labels(self) -> tuple[str, ...]:
        """Judged contents, sorted; a judge's class index is the position in this tuple."""
        return tuple(sorted({self.judged_content[t.content] for t in self.takes if t.content is not None}))

    @property
    def native_content_labels(self) -> tuple[str, ...]:
        return tuple(sorted({t.content for t in self.takes if t.content is not None}))

    @property
    def style_labels(self) -> tuple[str, ...]:
        return tuple(sorted({t.style for t in self.takes if t.style is not None}))

    @property
    def by_id(self) -> dict[str, Take]:
        return {take.take_id: take for take in self.takes}


class LoadAs(Protocol):
    """Loads a dataset with unit, up axis or frame rate as given."""

    def __call__(self, path: Path | None, progress: ProgressCallback | None, overrides: Overrides) -> Dataset: ...


@dataclass(frozen=True)
class Archive:
    """A published archive: its address, which names a version, and what it must be.

    Attributes
    ----------
    file : name to keep it under.
    sha256 : hexadecimal.
    """

    file: str
    url: str
    sha256: str
    n_bytes: int


@dataclass(frozen=True)
class DatasetEntry:
    """A row of the DATASETS table.

    Attributes
    ----------
    load : ``load(path, progress)`` -> Dataset; ``path`` is None for generated data.
    summary : one line for ``stylebench list datasets``.
    licence, citation : known before anything is loaded.
    how_to_get : where to obtain it, in one sentence.
    needs_path : False for generated data.
    load_as : the same for files whose unit, up axis and frame rate may be given; None where they are fixed.
    archives : what is downloaded; empty where there is no fixed address with a known checksum.
    unpack : whether it is read from a folder, so that its archive must be unpacked.
    """

    load: Callable[[Path | None, ProgressCallback | None], Dataset]
    summary: str
    licence: str
    citation: str
    how_to_get: str = ""
    needs_path: bool = True
    load_as: LoadAs | None = None
    archives: tuple[Archive, ...] = ()
    unpack: bool = False
