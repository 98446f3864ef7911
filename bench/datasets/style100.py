"""100STYLE (Mason et al. 2022): 100 styles x 8 gaits of one actor on the 28 joints of Xsens, 60 fps, centimetres.

A file ``Style_GAIT.bvh`` is one long recording; ``Frame_Cuts.csv`` says which frames of it count, as half-open ranges.
A take is a piece of ``PIECE_S`` seconds of that range, ids in recording order.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping
from pathlib import Path, PurePosixPath

from bench.datasets.base import Archive, Dataset, DatasetEntry, ProgressCallback
from bench.datasets.bvh_files import LabelledFile, bvh_places, given_folder, local_dataset, neutral_as_elsewhere
from bench.datasets.reading import Overrides, known_reading
from bench.errors import BadData
from bench.motion.known_skeletons import XSENS

NAME = "100style"
GAITS = {
    "BR": "backwards running",
    "BW": "backwards walking",
    "FR": "forwards running",
    "FW": "forwards walking",
    "ID": "idling",
    "SR": "sidesteps running",
    "SW": "sidesteps walking",
    "TR1": "transitions",
    "TR2": "transitions",
    "TR3": "transitions",
}
CUTS_CSV = "Frame_Cuts.csv"
PUBLISHED_FILES, PUBLISHED_STYLES, PUBLISHED_FRAMES = 810, 100, 4_055_978
"""Mason et al. 2022, Table 1; the frames are the sum of STOP - START over Frame_Cuts.csv."""
PUBLISHED_TRANSITION_FRAMES = 786_818
UNIT, PIECE_S = "cm", 8.0
LICENCE = "CC BY 4.0"
CITATION = (
    "Mason, Starke, Komura 2022, Real-Time Style Modelling of Human Locomotion via Feature-Wise Transformations and "
    "Local Motion Phases, PACMCGIT 5(1)"
)
HOW_TO_GET = (
    "download 100STYLE from https://www.ianxmason.com/100style/ (archived as zenodo.org/record/8127870), unpack it and "
    "give the folder"
)
ARCHIVE = Archive(
    file="100STYLE.zip",
    url="https://zenodo.org/records/8127870/files/100STYLE.zip",
    sha256="2c3b4017f8e2397ee6904c9b9f43551d8b426d39ddc3558d121fee9e55cb2d58",
    n_bytes=1_468_515_354,
)
_FILE = re.compile(rf"(?P<style>[A-Za-z0-9]+)_(?P<gait>{'|'.join(GAITS)})")

Cuts = Mapping[tuple[str, str], tuple[int, int]]
"""Style and gait -> half-open range of frames."""


def read_cuts(path: Path) -> dict[tuple[str, str], tuple[int, int]]:
    """``Frame_Cuts.csv``: a row a style, columns STYLE_NAME and GAIT_START, GAIT_STOP; N/A where there is no recording.

    Raises
    ------
    BadData : unreadable, no STYLE_NAME, or a range that is none; starts with ``file:line``.
    """
    try:
        lines = path.read_text(encoding="utf-8-sig").splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise BadData(f"cannot be read ({error})", where=str(path), remedy=HOW_TO_GET) from error
    reader = csv.DictReader(lines)
    if "STYLE_NAME" not in (reader.fieldnames or ()):
        raise BadData("has no column STYLE_NAME", where=f"{path}:1", cause="not the file as published")
    cuts: dict[tuple[str, str], tuple[int, int]] = {}
    for row in reader:
        for gait in GAITS:
            start, stop = (str(row.get(f"{gait}_{end}") or "N/A").strip() for end in ("START", "STOP"))
            if "N/A" in (start, stop):
                continue
            if not (start.isdigit() and stop.isdigit() and int(start) < int(stop)):
                raise BadData(f"{gait} from {start!r} to {stop!r} is no range", where=f"{path}:{reader.line_num}")
            cuts[row["STYLE_NAME"].strip(), gait] = (int(start), int(stop))
    return cuts


def check_totals(cuts: Cuts) -> list[str]:
    """What is wrong with the frame cuts of a full set, against the published totals; empty where all agrees."""
    frames = sum(stop - start for start, stop in cuts.values())
    transitions = sum(stop - start for (_, gait), (start, stop) in cuts.items() if gait.startswith("TR"))
    found = (
        ("recordings", len(cuts), PUBLISHED_FILES),
        ("styles", len({style for style, _ in cuts}), PUBLISHED_STYLES),
        ("frames", frames, PUBLISHED_FRAMES),
        ("transition frames", transitions, PUBLISHED_TRANSITION_FRAMES),
    )
    return [
        f"{count} {what} in {CUTS_CSV}, {published} published" for what, count, published in found if count != published
    ]


def load(path: Path | None, progress: ProgressCallback | None = None, overrides: Overrides | None = None) -> Dataset:
    """Read a folder, at any depth; ``Frame_Cuts.csv`` must be in it.

    Raises
    ------
    BadData : no path, no file of the dataset, no frame cuts, or a full set whose totals are not the published ones.
    BadFile : files that cannot be read.
    """
    folder = given_folder(path, NAME, HOW_TO_GET)
    places = bvh_places(folder)
    cuts = read_cuts(find_cuts(folder))
    files: list[LabelledFile] = []
    for place in places:
        found = _FILE.fullmatch(PurePosixPath(place).stem)
        if found and (found["style"], found["gait"]) in cuts:
            frames = cuts[found["style"], found["gait"]]
            style = neutral_as_elsewhere(found["style"])
            files.append(LabelledFile(place, GAITS[found["gait"]], style, frames=frames))
    if not files:
        raise BadData(f"no file is called like Angry_FW.bvh; the first is {places[0]}", where=str(folder))
    full = len(files) >= PUBLISHED_FILES
    wrong = check_totals(cuts) if full else []
    if wrong:
        raise BadData("; ".join(wrong), where=str(folder), cause="not the frame cuts as published", remedy=HOW_TO_GET)
    overrides = overrides or Overrides()
    reading = known_reading(XSENS, UNIT, overrides)
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
            "frame totals agree with the published ones" if full else f"{len(files)} of {PUBLISHED_FILES} recordings",
            *reading.notes,
            f"recordings are cut into takes of {PIECE_S:g} s",
            "fingers are virtual",
            *[f"{left} BVH files are not in {CUTS_CSV} and left out"] * bool(left),
        ),
        piece_s=PIECE_S,
        progress=progress,
    )


def find_cuts(folder: Path) -> Path:
    """Where ``Frame_Cuts.csv`` lies in a folder.

    Raises
    ------
    BadData : nowhere.
    """
    found = sorted(folder.rglob(CUTS_CSV))
    if not found:
        raise BadData(f"there is no {CUTS_CSV} in it", where=str(folder), remedy=f"{CUTS_CSV} comes with the dataset")
    return found[0]


def expected_files(folder: Path) -> set[str]:
    """File names that the folder's frame cuts speak of."""
    return {f"{style}_{gait}.bvh" for style, gait in read_cuts(find_cuts(folder))}


ENTRY = DatasetEntry(
    load=load,
    summary="captured locomotion: 8 gaits x 100 styles of one actor, 60 fps; read from your copy",
    licence=LICENCE,
    citation=CITATION,
    how_to_get=HOW_TO_GET,
    load_as=load,
    archives=(ARCHIVE,),
    unpack=True,
)
