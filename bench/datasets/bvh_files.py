"""Labelled BVH files into takes: what the readers of folders share."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.cache import Made, cached_takes
from bench.datasets.reading import Overrides, Reading, facts_of
from bench.datasets.take import Take
from bench.errors import BadData, BadFile, BenchError
from bench.motion.bvh import BvhMotion, read_bvh
from bench.motion.clip import Clip
from bench.motion.edit import crop, on_floor
from bench.motion.recognise import with_bare_names

READER_VERSION = 2


@dataclass(frozen=True)
class LabelledFile:
    """A motion file and what is known of it.

    Attributes
    ----------
    place : path inside the folder, with slashes.
    content, style, actor, session : labels.
    frames : half-open range of frames to use; None for all.
    """

    place: str
    content: str
    style: str
    actor: str | None = None
    session: str | None = None
    frames: tuple[int, int] | None = None

    @property
    def take_id(self) -> str:
        return self.place[: -len(".bvh")]


def given_folder(path: Path | None, dataset: str, how_to_get: str) -> Path:
    """The folder of a dataset that everybody gets for themselves.

    Raises
    ------
    BadData : no path is given; says how to get the dataset.
    """
    if path is None:
        raise BadData("it is read from your copy, and no path is given", where=dataset, remedy=how_to_get)
    return path


def bvh_places(folder: Path) -> list[str]:
    """BVH files of a folder at any depth, sorted, as paths inside it.

    Raises
    ------
    BadData : not a folder, or none in it.
    """
    if not folder.is_dir():
        raise BadData("expected a folder of BVH files", where=str(folder), remedy="unpack archives first")
    places = sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.suffix.lower() == ".bvh")
    if not places:
        raise BadData("there is no BVH file in it", where=str(folder))
    return places


def neutral_as_elsewhere(style: str) -> str:
    """A style's published name; ``Neutral`` as ``neutral``, by which protocols know the style without style."""
    return "neutral" if style.lower() == "neutral" else style


def read_motion(path: Path, name: str = "") -> BvhMotion:
    """A BVH file with joint names without prefixes."""
    return with_bare_names(read_bvh(path, name=name))


def read_takes(
    folder: Path,
    files: Sequence[LabelledFile],
    to_clip: Callable[[BvhMotion], Clip],
    facts: Mapping[str, Any],
    *,
    dataset: str,
    piece_s: float | None = None,
    progress: ProgressCallback | None = None,
) -> tuple[tuple[Take, ...], str]:
    """Takes of labelled files on their own floor, and their digest; parsed once, then kept in the cache.

    Parameters
    ----------
    files : what to read.
    to_clip : retargets a motion (joint names without prefixes).
    facts : JSON values that decide what ``to_clip`` does: part of the digest.
    dataset : name of the dataset.
    piece_s : cuts every file into takes of this many seconds, ids ``file-001``; the rest goes to the last one.

    Raises
    ------
    BadFile : files cannot be read; how many, and the first.
    """
    state = hashlib.blake2b(digest_size=16)
    rows = [asdict(file) for file in files]
    state.update(json.dumps([READER_VERSION, dataset, dict(facts), piece_s, rows], sort_keys=True).encode())
    for file in files:
        try:
            state.update(hashlib.blake2b((folder / file.place).read_bytes(), digest_size=16).digest())
        except OSError as error:
            raise BadFile(f"cannot be read ({error.strerror})", where=str(folder / file.place)) from error
    digest = state.hexdigest()
    takes, _ = cached_takes(f"{dataset}-{digest}", lambda: _made(folder, files, to_clip, dataset, piece_s, progress))
    return takes, digest


def local_dataset(
    folder: Path,
    files: Sequence[LabelledFile],
    reading: Reading,
    overrides: Overrides,
    *,
    name: str,
    licence: str,
    citation: str,
    notes: Sequence[str],
    piece_s: float | None = None,
    progress: ProgressCallback | None = None,
) -> Dataset:
    """The dataset of labelled files of somebody's copy, each content judged under its own name.

    Raises
    ------
    BadFile : files cannot be read.
    """
    facts = facts_of(reading, overrides)
    takes, digest = read_takes(folder, files, reading.to_clip, facts, dataset=name, piece_s=piece_s, progress=progress)
    return Dataset(
        name=name,
        dataset_id=f"{name}-local",
        digest=digest,
        takes=takes,
        judged_content={content: content for content in sorted({file.content for file in files})},
        licence=licence,
        citation=citation,
        source=folder.name,
        notes=tuple(notes),
    )


def _made(
    folder: Path,
    files: Sequence[LabelledFile],
    to_clip: Callable[[BvhMotion], Clip],
    dataset: str,
    piece_s: float | None,
    progress: ProgressCallback | None,
) -> Made:
    takes: list[Take] = []
    broken: list[BenchError] = []
    for done, file in enumerate(files, start=1):
        try:
            takes += _takes(file, to_clip(read_motion(folder / file.place, file.place)), dataset, piece_s)
        except BenchError as error:
            error.where = error.where or file.place
            broken.append(error)
        if progress:
            progress("reading BVH files", done, len(files))
    if broken:
        first = broken[0]
        where = first.where if first.where.startswith(tuple(file.place for file in files)) else folder.name
        raise BadFile(
            f"{len(broken)} of {len(files)} BVH files cannot be used, the first is {where}: {first.problem}",
            where=str(folder),
            cause=first.cause,
            remedy=first.remedy or "get the broken files again, or leave them out",
        )
    return sorted(takes, key=lambda take: take.take_id), {}


def _takes(file: LabelledFile, clip: Clip, dataset: str, piece_s: float | None) -> list[Take]:
    if file.frames is not None:
        start, stop = file.frames
        clip = crop(clip, start, stop - start)
    clip = on_floor(clip)
    length = clip.n_frames if piece_s is None else round(piece_s * clip.fps)
    starts = range(0, max(clip.n_frames - length, 0) + 1, length)
    pieces = [crop(clip, start, length if start != starts[-1] else clip.n_frames - start) for start in starts]
    ids = [file.take_id] if piece_s is None else [f"{file.take_id}-{n:03d}" for n in range(1, len(pieces) + 1)]
    return [
        Take(piece, take_id, dataset, file.content, file.style, file.actor, file.session)
        for take_id, piece in zip(ids, pieces, strict=True)
    ]
