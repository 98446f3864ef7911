"""Downloading datasets: archives with a fixed address and a known SHA-256, never anything else.

An archive that already lies in the folder is checked and used instead, so that it can be carried to a machine without
network. Addresses name a version (a Zenodo record, a commit), so that what they give cannot change unnoticed.
"""

from __future__ import annotations

import zipfile
from dataclasses import dataclass
from pathlib import Path

import pooch

from bench.datasets.base import Archive, DatasetEntry, ProgressCallback
from bench.errors import BadData, BadFile

TIMEOUT_S = 60.0
MEGABYTE = 1_000_000


@dataclass(frozen=True)
class Fetched:
    """Archives that are there and have the known digest, and what to do next.

    Attributes
    ----------
    archives : their paths.
    data : what ``NAME=PATH`` takes; None where the archives must be unpacked by hand.
    """

    archives: tuple[Path, ...]
    data: Path | None


def fetch(name: str, entry: DatasetEntry, folder: Path, progress: ProgressCallback | None = None) -> Fetched:
    """Download the archives of a dataset into a folder, check them, and unpack what is read from a folder.

    Parameters
    ----------
    name, entry : row of the DATASETS table.
    folder : made where it is not there; archives that lie in it are checked and not downloaded again.

    Raises
    ------
    BadData : there is no known address, or no answer from it; says where to place the file.
    BadFile : an archive is not the published one.
    """
    if not entry.archives:
        raise BadData(
            f"{name} has no fixed address with a known checksum and is not downloaded",
            remedy=f"{entry.how_to_get}; place it anywhere and give {name}=PATH",
        )
    found = tuple(_checked(archive, folder, progress) for archive in entry.archives)
    if len(found) > 1:
        return Fetched(found, None)
    if not entry.unpack:
        return Fetched(found, found[0])
    return Fetched(found, _unpacked(found[0], progress))


def _checked(archive: Archive, folder: Path, progress: ProgressCallback | None) -> Path:
    target = folder / archive.file
    if target.is_file():
        _refuse_other(target, archive)
        return target
    place = f"download {archive.url} by other means, place it as {target} and fetch again"
    bar = _Bar(archive.file, archive.n_bytes, progress)
    pooch.get_logger().setLevel("ERROR")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        pooch.retrieve(
            archive.url,
            f"sha256:{archive.sha256}",
            fname=archive.file,
            path=folder,
            downloader=pooch.HTTPDownloader(progressbar=bar, timeout=TIMEOUT_S, chunk_size=2**20),
        )
    except ValueError as error:
        cause = "an interrupted download, or another file at that address"
        raise BadFile(f"what {archive.url} gives has not the known SHA-256", cause=cause, remedy=place) from error
    except OSError as error:
        reason = type(error).__name__
        raise BadData(
            f"{archive.file} ({archive.n_bytes / MEGABYTE:.0f} MB) cannot be downloaded ({reason})",
            where=archive.url,
            cause="no network, a full disk, or the address is gone",
            remedy=place,
        ) from error
    return target


def _refuse_other(target: Path, archive: Archive) -> None:
    size = target.stat().st_size
    if size == archive.n_bytes and pooch.file_hash(str(target), alg="sha256") == archive.sha256:
        return
    raise BadFile(
        f"is not the published {archive.file}: {size} bytes, {archive.n_bytes} published"
        if size != archive.n_bytes
        else f"is not the published {archive.file}: its SHA-256 is another",
        where=str(target),
        cause="an interrupted download" if size < archive.n_bytes else "another version, or a damaged file",
        remedy="remove it and fetch again",
    )


def _unpacked(archive: Path, progress: ProgressCallback | None) -> Path:
    """The folder beside an archive with what was in it; members that are there in full are left as they are."""
    folder = archive.with_suffix("")
    with zipfile.ZipFile(archive) as opened:
        members = [member for member in opened.infolist() if not member.is_dir()]
        for done, member in enumerate(members, start=1):
            target = folder / member.filename
            if not (target.is_file() and target.stat().st_size == member.file_size):
                opened.extract(member, folder)
            if progress:
                progress(f"unpacking {archive.name}", done, len(members))
    return folder


class _Bar:
    """What pooch tells of a download, as calls of a progress callback in megabytes."""

    def __init__(self, file: str, n_bytes: int, progress: ProgressCallback | None) -> None:
        self.total = n_bytes
        self._file, self._progress, self._done = file, progress, 0

    def update(self, n_bytes: int) -> None:
        self._done = min(self._done + n_bytes, self.total)
        if self._progress:
            whole = max(self.total // MEGABYTE, 1)
            self._progress(f"downloading {self._file}, MB", min(self._done // MEGABYTE, whole), whole)

    def reset(self) -> None:
        self._done = 0

    def close(self) -> None:
        """Nothing is held open."""
