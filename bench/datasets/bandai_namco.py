"""Bandai-Namco-Research-Motiondataset 1 and 2 (Kobayashi et al. 2023), from the folder or zip as downloaded.

Quirks handled here: every joint has six channels and ``joint_Root`` carries motion in a few takes of dataset 1 (the BVH
reader composes it); the Hips OFFSET names the recording session and determines the style, so it is kept as a label and
never read as motion; takes float at different heights, so each is put on its own floor.
"""

from __future__ import annotations

import csv
import hashlib
import re
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bench.datasets.base import Dataset, DatasetEntry, ProgressCallback
from bench.datasets.cache import Made, cached_takes
from bench.datasets.take import Take
from bench.errors import BadData, BadFile, BenchError
from bench.motion.bvh import BvhMotion, read_bvh
from bench.motion.edit import on_floor
from bench.motion.retarget import to_canonical
from bench.motion.skeleton_maps import BANDAI_NAMCO

NAME = "bandai-namco"
READER_VERSION = 1
UNIT_M, FPS = 0.01, 30.0
FILE_NAME = re.compile(r"dataset-(?P<set>[12])_(?P<content>[a-z0-9-]+)_(?P<style>[a-z-]+)_(?P<number>\d+)\.bvh")
MAX_MEMBER_BYTES = 64 * 2**20
TAKES_CSV = Path(__file__).with_name("bandai_namco_takes.csv")
LICENCE = "CC BY-NC 4.0"
CITATION = (
    "Kobayashi et al. 2023, Motion Capture Dataset for Practical Use of AI-based Motion Editing, arXiv 2306.08861"
)
HOW_TO_GET = (
    "download https://github.com/BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset and give its folder or zip"
)


@dataclass(frozen=True)
class PublishedTake:
    """A row of the published subset: ``name`` without ``.bvh``, frames, digest of the parsed channel values."""

    name: str
    frames: int
    digest: str


@cache
def published_takes() -> Mapping[str, PublishedTake]:
    """The takes that make up ``bandai-namco@1``, by name."""
    with TAKES_CSV.open(newline="") as file:
        rows = [PublishedTake(row["name"], int(row["frames"]), row["digest"]) for row in csv.DictReader(file)]
    return {row.name: row for row in rows}


def load(path: Path | None, progress: ProgressCallback | None = None) -> Dataset:
    """Read a folder or zip, at any depth.

    Where all published takes are there, exactly those are used (``bandai-namco@1``); otherwise all that are found
    (``bandai-namco-local``).

    Raises
    ------
    BadData : no path, nothing there, or no take of the dataset in it.
    BadFile : not a folder or zip, or broken BVH files; the first is named with its line.
    """
    if path is None or not path.exists():
        raise BadData(f"no such file or folder: {path}", where=NAME, remedy=HOW_TO_GET)
    files = _files(path)
    published = published_takes()
    if set(published) <= set(files):
        takes, digests = _read_cached(path, files, sorted(published), progress)
        if all(digests[name] == row.digest for name, row in published.items()):
            return _dataset(f"{NAME}@1", takes, digests, path, _left_out(len(files) - len(published)))
        notes = ["some takes differ from the published ones, so all takes found are used"]
    else:
        missing = len(set(published) - set(files))
        notes = [f"{missing} of {len(published)} published takes are missing, so all {len(files)} found are used"]
    takes, digests = _read_cached(path, files, sorted(files), progress)
    return _dataset(f"{NAME}-local", takes, digests, path, notes)


def write_takes_csv(source: Path, target: Path) -> None:
    """Write the table of published takes from a folder or zip that holds exactly them (for maintainers)."""
    files = _files(source)
    with target.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["name", "frames", "digest"])
        for name in sorted(files):
            motion = read_bvh(files[name].read(), name=f"{name}.bvh")
            writer.writerow([name, motion.n_frames, channel_digest(motion)])


def channel_digest(motion: BvhMotion) -> str:
    """blake2b (16 bytes, hex) of the parsed channel values: the same on every machine, from a folder or a zip."""
    return hashlib.blake2b(motion.channel_values.astype("<f8").tobytes(), digest_size=16).hexdigest()


def _left_out(n: int) -> list[str]:
    return [f"{n} takes beyond the published subset are left out"] if n else []


def _dataset(
    dataset_id: str, takes: Sequence[Take], digests: Mapping[str, str], path: Path, notes: Sequence[str]
) -> Dataset:
    lines = "\n".join(f"{name} {digest}" for name, digest in sorted(digests.items()))
    contents = sorted({str(take.content) for take in takes})
    return Dataset(
        name=NAME,
        dataset_id=dataset_id,
        digest=hashlib.blake2b(lines.encode(), digest_size=16).hexdigest(),
        takes=tuple(takes),
        judged_content={content: judged_content(content) for content in contents},
        licence=LICENCE,
        citation=CITATION,
        source=path.name,
        notes=(*notes, "fingers are virtual", *_merged_note(contents)),
    )


def judged_content(content: str) -> str:
    """The content judges are trained on: raising and waving the same hand are one, ``left-hand``.

    In a 64-frame root-relative window the two look alike.
    """
    found = re.fullmatch(r"(?:raise-up|wave)-(left|right|both)-hands?", content)
    if not found:
        return content
    return f"{found[1]}-hands" if found[1] == "both" else f"{found[1]}-hand"


def _merged_note(contents: Sequence[str]) -> list[str]:
    merged = [content for content in contents if judged_content(content) != content]
    return ["raise-up and wave of the same hand are judged as one content"] if merged else []


@dataclass(frozen=True)
class _File:
    """A BVH on disk or in a zip."""

    path: Path
    member: str = ""

    def read(self) -> bytes:
        if not self.member:
            return self.path.read_bytes()
        with zipfile.ZipFile(self.path) as archive:
            return archive.read(self.member)


def _files(path: Path) -> dict[str, _File]:
    """BVH files of the dataset by name, from a folder or a zip."""
    found = dict(_in_folder(path) if path.is_dir() else _in_zip(path))
    if not found:
        raise BadData("no file called like dataset-2_walk_normal_001.bvh in it", where=str(path), remedy=HOW_TO_GET)
    return found


def _in_folder(path: Path) -> Iterator[tuple[str, _File]]:
    for file in sorted(path.rglob("*.bvh")):
        if FILE_NAME.fullmatch(file.name) and not file.is_symlink():
            yield file.stem, _File(file)


def _in_zip(path: Path) -> Iterator[tuple[str, _File]]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, OSError) as error:
        raise BadFile(
            f"expected a folder or a zip, got neither ({error})", where=str(path), remedy=HOW_TO_GET
        ) from error
    for member in members:
        name = Path(member.filename)
        if name.is_absolute() or ".." in name.parts:
            raise BadFile(f"member {member.filename!r} lies outside the archive", where=str(path))
        if FILE_NAME.fullmatch(name.name):
            if member.file_size > MAX_MEMBER_BYTES:
                raise BadFile(f"{member.filename} claims {member.file_size} bytes", where=str(path))
            yield name.stem, _File(path, member.filename)


def _read_cached(
    path: Path, files: Mapping[str, _File], names: Sequence[str], progress: ProgressCallback | None
) -> tuple[list[Take], dict[str, str]]:
    key = f"{NAME}-{READER_VERSION}-{_content_digest(path, files, names)}"
    takes, facts = cached_takes(key, lambda: _read(files, names, progress))
    digests: dict[str, str] = facts["digests"]
    return list(takes), digests


def _content_digest(path: Path, files: Mapping[str, _File], names: Sequence[str]) -> str:
    """Digest of what will be read: the archive as a whole, or each file of a folder."""
    state = hashlib.blake2b("\n".join(names).encode(), digest_size=16)
    if path.is_dir():
        for name in names:
            state.update(files[name].read())
    else:
        with path.open("rb") as file:
            while chunk := file.read(2**22):
                state.update(chunk)
    return state.hexdigest()


def _read(files: Mapping[str, _File], names: Sequence[str], progress: ProgressCallback | None) -> Made:
    takes: list[Take] = []
    digests: dict[str, str] = {}
    broken: list[BenchError] = []
    for done, name in enumerate(names):
        try:
            motion = read_bvh(files[name].read(), name=f"{name}.bvh")
            takes.append(_take(name, motion))
            digests[name] = channel_digest(motion)
        except BenchError as error:
            broken.append(error)
        if progress:
            progress("reading BVH files", done + 1, len(names))
    if broken:
        raise BadFile(
            f"{len(broken)} of {len(names)} BVH files cannot be read, first: {broken[0]}",
            remedy="download them again, or remove them",
        )
    return takes, {"digests": digests}


def _take(name: str, motion: BvhMotion) -> Take:
    found = FILE_NAME.fullmatch(f"{name}.bvh")
    if found is None:
        raise BadFile(f"{name} is not called like a take of the dataset")
    prefix = "dataset-1_" if found["set"] == "1" else ""
    clip = on_floor(to_canonical(motion, BANDAI_NAMCO, unit_m=UNIT_M, fps=FPS))
    return Take(
        clip,
        take_id=f"{prefix}{found['content']}_{found['style']}_{found['number']}",
        dataset=NAME,
        content=found["content"],
        style=found["style"],
        session=_session(motion),
    )


def _session(motion: BvhMotion) -> str:
    """The recording session, which only the Hips OFFSET tells: three values in dataset 2."""
    height = motion.offsets[motion.names.index("Hips")][1]
    return f"hips offset {height:.2f} cm"


ENTRY = DatasetEntry(
    load=load,
    summary="captured motion: 10 contents x 7 styles (dataset 2), 30 fps; read from your copy",
    licence=LICENCE,
    citation=CITATION,
    how_to_get=HOW_TO_GET,
)
