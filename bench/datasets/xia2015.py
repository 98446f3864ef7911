"""Xia et al. 2015 (8 styles, 31 CMU joints, 120 fps), under any of the three naming schemes in which it goes round.

``angry_13_000.bvh``: style, number of the action (1 to 28), repetition: as processed by Aberman et al. 2020.
``angry_fast_punching_003.bvh``: style, action, number. ``fast punching_angry_03.bvh``: action with spaces, style,
number, perhaps ``_m`` for a mirrored copy (Park et al. 2021), which is left out.

Contents are the six of the papers; fast and normal walking are one, fast and plain punching are one.
"""

from __future__ import annotations

import re
from collections import defaultdict
from collections.abc import Iterable
from pathlib import Path, PurePosixPath

from bench.datasets.base import Dataset, DatasetEntry, ProgressCallback
from bench.datasets.bvh_files import LabelledFile, bvh_places, given_folder, local_dataset
from bench.datasets.reading import Overrides, known_reading
from bench.errors import BadData
from bench.motion.skeleton_maps import CMU_31

NAME = "xia2015"
STYLES = ("angry", "childlike", "depressed", "neutral", "old", "proud", "sexy", "strutting")
ACTIONS = {
    "fast punching": "punching",
    "fast walking": "walking",
    "jumping": "jumping",
    "kicking": "kicking",
    "normal walking": "walking",
    "punching": "punching",
    "running": "running",
    "transitions": "transitions",
}
"""Action in a file name -> content."""
PUBLISHED_FILES = 572
TEST_PER_CELL = {"walking": 3, "running": 1, "jumping": 1, "kicking": 1, "punching": 1, "transitions": 0}
"""Aberman et al. 2020: how many files of each style and content, first by name, are the test set: 56 files."""
LICENCE = "not stated by its publishers; ask the authors before redistribution"
CITATION = (
    "Xia, Wang, Chai, Hodgins 2015, Realtime Style Transfer for Unlabeled Heterogeneous Human Motion, ACM TOG 34(4)"
)
HOW_TO_GET = (
    "get the BVH files from the authors' page, or as processed from "
    "https://github.com/DeepMotionEditing/deep-motion-editing, and give their folder"
)
_STYLE = "|".join(STYLES)
_BY_NUMBER = re.compile(rf"(?P<style>{_STYLE})_(?P<id>\d{{1,2}})(?:_\d+)?")
_BY_ACTION = re.compile(rf"(?P<style>{_STYLE})_(?P<action>[a-z]+(?:_[a-z]+)?)_\d+")
_WITH_SPACES = re.compile(rf"(?P<action>[a-z]+(?: [a-z]+)?)_(?P<style>{_STYLE})_\d+(?P<mirrored>_m)?")
_LAST = re.compile(r"(?P<stem>.*_)(?P<number>\d+)")
_LAST_NUMBER = (
    (12, "walking"),
    (15, "running"),
    (17, "jumping"),
    (21, "punching"),
    (23, "kicking"),
    (28, "transitions"),
)


def content_of_number(number: int) -> str:
    """Content of an action number: 1-12 walking, 13-15 running, 16-17 jumping, 18-21 punching, 22-23 kicking, else
    transitions (deep-motion-editing's list).

    Raises
    ------
    BadData : not 1 to 28.
    """
    for last, content in _LAST_NUMBER:
        if 1 <= number <= last:
            return content
    raise BadData(f"action numbers are 1 to 28, got {number}", where=NAME)


def labels_of(stem: str) -> tuple[str, str] | None:
    """Content and style of a file name without ``.bvh``; None where it is none of the dataset, or a mirrored copy.

    Raises
    ------
    BadData : an action number that does not exist.
    """
    lower = stem.lower()
    found = _BY_NUMBER.fullmatch(lower)
    if found:
        return content_of_number(int(found["id"])), found["style"]
    found = _BY_ACTION.fullmatch(lower)
    if found is None:
        found = _WITH_SPACES.fullmatch(lower)
        if found is None or found["mirrored"]:
            return None
    content = ACTIONS.get(found["action"].replace("_", " "))
    return (content, found["style"]) if content else None


def aberman_test_names(names: Iterable[str]) -> tuple[str, ...]:
    """Names (without ``.bvh``) that Aberman et al. 2020 test on: the first few of each style and content by name."""
    cells: dict[tuple[str, str], list[str]] = defaultdict(list)
    for name in sorted(names):
        labels = labels_of(name)
        if labels is not None:
            cells[labels].append(name)
    chosen = [name for (content, _), found in cells.items() for name in found[: TEST_PER_CELL[content]]]
    return tuple(sorted(chosen))


def empty_cells(names: Iterable[str]) -> tuple[tuple[str, str], ...]:
    """Contents and styles of which no name (without ``.bvh``) is a take; the full set has takes of each."""
    there = {labels_of(name) for name in names}
    cells = ((content, style) for style in STYLES for content in sorted(set(ACTIONS.values())))
    return tuple(cell for cell in cells if cell not in there)


def skipped(names: Iterable[str]) -> tuple[str, ...]:
    """Names that the numbering of takes skips: ``old_13_001`` where ``old_13_000`` and ``old_13_002`` are there."""
    numbers: dict[tuple[str, int], set[int]] = defaultdict(set)
    for name in names:
        found = _LAST.fullmatch(name)
        if found:
            numbers[found["stem"], len(found["number"])].add(int(found["number"]))
    return tuple(
        f"{stem}{number:0{width}d}"
        for (stem, width), there in sorted(numbers.items())
        for number in range(min(there), max(there))
        if number not in there
    )


def load(path: Path | None, progress: ProgressCallback | None = None, overrides: Overrides | None = None) -> Dataset:
    """Read a folder, at any depth.

    Raises
    ------
    BadData : no path, or no file of the dataset.
    BadFile : files that cannot be read.
    """
    folder = given_folder(path, NAME, HOW_TO_GET)
    places = bvh_places(folder)
    files: list[LabelledFile] = []
    for place in places:
        labels = labels_of(PurePosixPath(place).stem)
        if labels is not None:
            files.append(LabelledFile(place, *labels))
    if not files:
        raise BadData(
            f"no file is called like angry_13_000.bvh; the first is {places[0]}", where=str(folder), remedy=HOW_TO_GET
        )
    overrides = overrides or Overrides()
    reading = known_reading(CMU_31, "cmu", overrides, why="(5.6444 cm), as published")
    left = len(places) - len(files)
    return local_dataset(
        folder,
        files,
        reading,
        overrides,
        name=NAME,
        licence=LICENCE,
        citation=CITATION,
        notes=(
            f"{len(files)} files; the papers name {PUBLISHED_FILES}",
            *reading.notes,
            *[f"{left} files are mirrored copies or no files of the dataset, and left out"] * bool(left),
        ),
        progress=progress,
    )


ENTRY = DatasetEntry(
    load=load,
    summary="captured motion: 6 contents x 8 styles, 572 short takes at 120 fps; read from your copy",
    licence=LICENCE,
    citation=CITATION,
    how_to_get=HOW_TO_GET,
    load_as=load,
)
