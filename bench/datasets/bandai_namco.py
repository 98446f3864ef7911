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
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from pathlib import Path, PurePosixPath

from bench.datasets.base import Archive, Dataset, DatasetEntry, ProgressCallback
from bench.datasets.cache import Made, cached_takes
from bench.datasets.take import Take
from bench.errors import BadData, BadFile, BadMotion, BenchError
from bench.motion.bvh import BvhMotion, read_bvh
from bench.motion.edit import on_floor
from bench.motion.retarget import to_canonical
from bench.motion.skeleton_maps import BANDAI_NAMCO

NAME = "bandai-namco"
READER_VERSION = 2
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
ARCHIVE = Archive(
    file="Bandai-Namco-Research-Motiondataset-2.zip",
    url="https://media.githubusercontent.com/media/BandaiNamcoResearchInc/Bandai-Namco-Research-Motiondataset/"
    "60c0ef1971398d0e62c036b7ebafa536b1152efe/dataset/Bandai-Namco-Research-Motiondataset-2/data.zip",
    sha256="62b24dc8aa8934f2c2239746218ddbf1b004b5a238ad461330690d07ed1486bd",
    n_bytes=126_309_261,
)
"""Dataset 2; the digest is that of the repository's git-lfs pointer at that commit."""


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
    if path is None:
        raise BadData("it is read from your copy, and no path is given", where=NAME, remedy=HOW_TO_GET)
    if not path.exists():
        raise BadData("no such file or folder", where=str(path), remedy=HOW_TO_GET)
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
        with _opened(source, files) as content_of:
            for name in sorted(files):
                motion = read_bvh(content_of(name), name=f"{name}.bvh")
                writer.writerow([name, motion.n_frames, channel_digest(motion)])


def channel_digest(motion: BvhMotion) -> str:
    """blake2b (16 bytes, hex) of the parsed channel values: the same on every machine, from a folder or a zip."""
    return hashlib.blake2b(motion.channel_values.astype("<f8").tobytes(), digest_size=16).hexdigest()


def check_takes(path: Path) -> Iterator[tuple[str, PublishedTake | None, BvhMotion | BenchError | None]]:
    """Every take that is published or found: its name, its published row, and what its file holds.

    The row is None for a take that is not in the published subset; the motion is None where there is no file, and the
    reader's refusal where the file cannot be read.

    Raises
    ------
    BadData, BadFile : as :func:`load`.
    """
    files, published = _files(path), published_takes()
    with _opened(path, files) as content_of:
        for name in sorted({*files, *published}):
            motion: BvhMotion | BenchError | None = None
            if name in files:
                try:
                    motion = read_bvh(content_of(name), name=f"{name}.bvh")
                except BenchError as error:
                    motion = error
            yield name, published.get(name), motion


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


Files = Mapping[str, str]
"""Take name -> path inside the folder, or member of the zip."""


def _files(path: Path) -> Files:
    """BVH files of the dataset, from a folder or a zip."""
    inside = _in_folder(path) if path.is_dir() else _in_zip(path)
    found: dict[str, str] = {}
    others = 0
    for place in inside:
        name = PurePosixPath(place)
        if not FILE_NAME.fullmatch(name.name):
            others += 1
        elif name.stem in found:
            problem = f"{name.name} is there twice: {found[name.stem]} and {place}"
            raise BadData(problem, where=str(path), cause="two copies of the dataset", remedy="give one of them")
        else:
            found[name.stem] = place
    if not found:
        instead = f", but {others} other BVH files" if others else ""
        problem = f"expected files called like dataset-2_walk_normal_001.bvh, found none{instead}"
        raise BadData(problem, where=str(path), remedy=HOW_TO_GET)
    return found


def _in_folder(path: Path) -> Iterator[str]:
    return (file.relative_to(path).as_posix() for file in sorted(path.rglob("*.bvh")))


def _in_zip(path: Path) -> Iterator[str]:
    try:
        with zipfile.ZipFile(path) as archive:
            members = archive.infolist()
    except (zipfile.BadZipFile, OSError) as error:
        raise BadFile(
            f"expected a folder or a zip, got neither ({error})", where=str(path), remedy=HOW_TO_GET
        ) from error
    for member in members:
        place = PurePosixPath(member.filename.replace("\\", "/"))
        if place.is_absolute() or ".." in place.parts:
            problem = f"member {member.filename!r} lies outside the archive"
            raise BadFile(problem, where=str(path), cause="not the archive as published", remedy=HOW_TO_GET)
        if place.suffix == ".bvh":
            if member.file_size > MAX_MEMBER_BYTES:
                problem = f"expected at most {MAX_MEMBER_BYTES} bytes, {member.filename} claims {member.file_size}"
                raise BadFile(problem, where=str(path), cause="not the archive as published", remedy=HOW_TO_GET)
            yield member.filename


@contextmanager
def _opened(path: Path, files: Files) -> Iterator[Callable[[str], bytes]]:
    """What gives a take's file by the take's name. A zip is opened once: listing its members takes longer than a take.

    A file that cannot be read is a :class:`BadFile`.
    """
    archive = None if path.is_dir() else zipfile.ZipFile(path)

    def content_of(name: str) -> bytes:
        try:
            return (path / files[name]).read_bytes() if archive is None else archive.read(files[name])
        except (OSError, EOFError, zipfile.BadZipFile, zlib.error, RuntimeError) as error:
            cause = "a damaged or encrypted archive" if archive else "no permission, or a damaged disk"
            raise BadFile(f"cannot be read ({error})", where=f"{name}.bvh", cause=cause) from error

    try:
        yield content_of
    finally:
        if archive is not None:
            archive.close()


def _read_cached(
    path: Path, files: Files, names: Sequence[str], progress: ProgressCallback | None
) -> tuple[list[Take], dict[str, str]]:
    key = f"{NAME}-{READER_VERSION}-{_content_digest(path, files, names)}"
    takes, facts = cached_takes(key, lambda: _read(path, files, names, progress))
    digests: dict[str, str] = facts["digests"]
    return list(takes), digests


def _content_digest(path: Path, files: Files, names: Sequence[str]) -> str:
    """Digest of what will be read: the archive as a whole, or each file of a folder."""
    state = hashlib.blake2b("\n".join(names).encode(), digest_size=16)
    if path.is_dir():
        with _opened(path, files) as content_of:
            for name in names:
                content = content_of(name)
                state.update(len(content).to_bytes(8, "little") + content)
    else:
        with path.open("rb") as file:
            while chunk := file.read(2**22):
                state.update(chunk)
    return state.hexdigest()


def _read(path: Path, files: Files, names: Sequence[str], progress: ProgressCallback | None) -> Made:
    takes: list[Take] = []
    digests: dict[str, str] = {}
    broken: list[BenchError] = []
    with _opened(path, files) as content_of:
        for done, name in enumerate(names, start=1):
            try:
                motion = read_bvh(content_of(name), name=f"{name}.bvh")
                takes.append(_take(name, motion))
                digests[name] = channel_digest(motion)
            except BenchError as error:
                broken.append(error)
            if progress:
                progress("reading BVH files", done, len(names))
    if broken:
        first = broken[0]
        raise BadFile(
            f"{len(broken)} of {len(names)} BVH files cannot be read, the first is {first.where}: {first.problem}",
            where=str(path),
            cause=first.cause,
            remedy="get the broken files again, or remove them",
        )
    return takes, {"digests": digests}


def _take(name: str, motion: BvhMotion) -> Take:
    found = FILE_NAME.fullmatch(f"{name}.bvh")
    if found is None:
        raise BadFile("not called like a take of the dataset", where=f"{name}.bvh")
    if motion.fps != FPS:
        cause = "a resampled or edited file"
        raise BadFile(f"expected {FPS:g} frames per second, got {motion.fps:.6g}", where=f"{name}.bvh", cause=cause)
    try:
        clip = on_floor(to_canonical(motion, BANDAI_NAMCO, unit_m=UNIT_M))
    except BadMotion as error:
        raise BadFile(error.problem, where=f"{name}.bvh", cause=error.cause) from error
    prefix = "dataset-1_" if found["set"] == "1" else ""
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
    archives=(ARCHIVE,),
)
