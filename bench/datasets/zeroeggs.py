"""ZeroEGGS (Ghorbani et al. 2022): 67 monologues of one actress in 19 styles, 75 joints, 60 fps.

Files are called ``001_Neutral_0.bvh``, in the cleaned set ``001_Neutral_0_x_1_0.bvh``; mirrored copies and copies at
another speed do not count. A take is a piece of ``PIECE_S`` seconds. All content is speech, so there is one content and
nothing for a content judge to tell apart: tracks that need two contents refuse it and say so.
"""

from __future__ import annotations

import re
from pathlib import Path, PurePosixPath

from bench.datasets.base import Archive, Dataset, DatasetEntry, ProgressCallback
from bench.datasets.bvh_files import (
    LabelledFile,
    bvh_places,
    given_folder,
    local_dataset,
    neutral_as_elsewhere,
    read_motion,
)
from bench.datasets.reading import Overrides, known_reading
from bench.errors import BadData
from bench.motion.known_skeletons import ZEROEGGS
from bench.motion.recognise import guess_unit
from bench.motion.retarget import rest_stature

NAME = "zeroeggs"
CONTENT, PIECE_S = "speech", 8.0
PUBLISHED_FILES, PUBLISHED_MINUTES = 67, 134.65
LICENCE = "CC BY-NC-ND 4.0"
CITATION = "Ghorbani et al. 2022, ZeroEGGS: Zero-shot Example-based Gesture Generation from Speech, arXiv 2209.07556"
HOW_TO_GET = (
    "get Zeggs_data.zip, .z01 and .z02 from https://github.com/ubisoft/ubisoft-laforge-ZeroEGGS (git lfs), unpack the "
    "three as one archive and give the folder 'clean' or 'original'"
)
_COMMIT = "561caa8a527c014892f94c7a30ee51db15a0efde"
ARCHIVES = tuple(
    Archive(
        file=file,
        url=f"https://media.githubusercontent.com/media/ubisoft/ubisoft-laforge-ZeroEGGS/{_COMMIT}/data/{file}",
        sha256=sha256,
        n_bytes=n_bytes,
    )
    for file, sha256, n_bytes in (
        ("Zeggs_data.zip", "edfe4037e2bf45ffade7b50bb30fe0b2f1d8776f3e8440809d5a1d1fb457d8b4", 672_547_515),
        ("Zeggs_data.z01", "1e26f661887a19b32acb5014f412d93ea8ce3b8f6184bfb90d78a07764cdff33", 1_048_576_000),
        ("Zeggs_data.z02", "3cc3bbe92aa5c90a4b4f0c4fbc0ba8fae7c9cceafb660b575a318c320cd6deb8", 1_048_576_000),
    )
)
"""One archive in three volumes; digests are those of the repository's git-lfs pointers at that commit."""
_FILE = re.compile(r"(?P<number>\d{3})_(?P<style>[A-Za-z]+)_\d+(?:_x_1_0)?")


def load(path: Path | None, progress: ProgressCallback | None = None, overrides: Overrides | None = None) -> Dataset:
    """Read a folder, at any depth.

    Raises
    ------
    BadData : no path, no file of the dataset, or a take that is there twice (raw and cleaned).
    BadFile : files that cannot be read.
    BadMotion : another skeleton.
    """
    folder = given_folder(path, NAME, HOW_TO_GET)
    places = bvh_places(folder)
    files: dict[str, LabelledFile] = {}
    for place in places:
        found = _FILE.fullmatch(PurePosixPath(place).stem)
        if found is None:
            continue
        if found["number"] in files:
            raise BadData(
                f"sequence {found['number']} is there twice: {files[found['number']].place} and {place}",
                where=str(folder),
                cause="raw and cleaned files in one folder",
                remedy="give the folder 'clean' or 'original'",
            )
        files[found["number"]] = LabelledFile(place, CONTENT, neutral_as_elsewhere(found["style"]))
    if not files:
        raise BadData(
            f"no file is called like 001_Neutral_0.bvh; the first is {places[0]}", where=str(folder), remedy=HOW_TO_GET
        )
    labelled = list(files.values())
    overrides = overrides or Overrides()
    unit = "m"
    if overrides.unit is None:
        unit = guess_unit(rest_stature(read_motion(folder / labelled[0].place, labelled[0].place), ZEROEGGS))
    reading = known_reading(ZEROEGGS, unit, overrides, why="assumed from the stature")
    left = len(places) - len(files)
    return local_dataset(
        folder,
        labelled,
        reading,
        overrides,
        name=NAME,
        licence=LICENCE,
        citation=CITATION,
        notes=(
            f"{len(files)} of {PUBLISHED_FILES} sequences",
            *reading.notes,
            f"sequences are cut into takes of {PIECE_S:g} s",
            *[f"{left} BVH files are mirrored or changed copies and left out"] * bool(left),
        ),
        piece_s=PIECE_S,
        progress=progress,
    )


ENTRY = DatasetEntry(
    load=load,
    summary="captured gestures with speech: 19 styles of one actress, 60 fps; read from your copy",
    licence=LICENCE,
    citation=CITATION,
    how_to_get=HOW_TO_GET,
    load_as=load,
    archives=ARCHIVES,
)
