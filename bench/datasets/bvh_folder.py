"""Any folder of BVH files, labelled by ``labels.csv`` or by a pattern for file names.

A file ``stylebench.toml`` in the folder may hold::

    pattern = "{content}_{style}_{any}"    # instead of labels.csv: where labels stand in the path, without .bvh
    unit = "cm"                            # m, cm, mm, inch, cmu, or metres per file unit
    up = "y"                               # or "z"
    fps = 60                               # instead of the files' frame times
    skeleton = "mixamo"                    # a known skeleton, or a joint map of your own: "my_rig.toml"

What is not given is read off the files, and :attr:`Dataset.notes` says what was assumed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from bench.datasets.base import Dataset, DatasetEntry, ProgressCallback
from bench.datasets.bvh_files import LabelledFile, bvh_places, read_motion, read_takes
from bench.datasets.labels import LABELS_CSV, labels_from_csv, labels_from_pattern
from bench.datasets.reading import Overrides, Reading
from bench.errors import BadConfig, BadData
from bench.motion.bvh import BvhMotion
from bench.motion.recognise import (
    common_stature,
    guess_unit,
    guess_up,
    head_over_feet,
    known_map,
    recognise,
    unit_metres,
)
from bench.motion.retarget import rest_stature
from bench.motion.user_map import read_skeleton_map, read_toml

NAME = "bvh-folder"
OPTIONS_FILE = "stylebench.toml"
OPTIONS = ("pattern", "unit", "up", "fps", "skeleton")
LOOKED_AT = 20
"""Files, spread over the folder, from which unit and up axis are read."""
HOW_TO_GET = f"your own folder of BVH files with {LABELS_CSV} (columns file, content, style), see docs/datasets.md"


def load(path: Path | None, progress: ProgressCallback | None = None, overrides: Overrides | None = None) -> Dataset:
    """Read a folder; what ``overrides`` gives goes before ``stylebench.toml``.

    Raises
    ------
    BadData : no labels, or labels that do not fit the files.
    BadConfig : options that do not exist.
    BadMotion : the skeleton, unit or up axis cannot be told; says how to give it.
    BadFile : files that cannot be read.
    """
    if path is None:
        raise BadData("it is read from your folder, and no path is given", where=NAME, remedy=HOW_TO_GET)
    places = bvh_places(path)
    overrides = overrides or Overrides()
    options = folder_options(path) | overrides.given
    files, notes = _labelled(path, options.get("pattern"), places)
    step = max(1, len(files) // LOOKED_AT)
    reading = reading_of([read_motion(path / f.place, f.place) for f in files[::step]], options, path)
    facts = {
        "skeleton": reading.skeleton_map.name,
        "joints": sorted(reading.skeleton_map.joints.items()),
        "t_pose": sorted((name, list(map(float, q))) for name, q in reading.skeleton_map.t_pose_wxyz.items()),
        "virtual": sorted((name, list(xyz)) for name, xyz in reading.skeleton_map.virtual_offsets_m.items()),
        "unit_m": reading.unit_m,
        "up": reading.up,
        "fps": reading.fps,
    }
    takes, digest = read_takes(path, files, reading.to_clip, facts, dataset=NAME, progress=progress)
    contents = {file.content for file in files}
    return Dataset(
        name=NAME,
        dataset_id=f"{NAME}-{_slug(path.resolve().name)}",
        digest=digest,
        takes=takes,
        judged_content={content: content for content in sorted(contents)},
        licence="as stated by whoever gave you the files",
        citation="none given",
        source=path.name,
        notes=(*reading.notes, *overrides.notes, *notes),
    )


def folder_options(folder: Path) -> dict[str, str | float]:
    """The options in a folder's ``stylebench.toml``; none where there is no such file.

    Raises
    ------
    BadConfig : an option that does not exist, or has the wrong type.
    """
    path = folder / OPTIONS_FILE
    if not path.is_file():
        return {}
    options = read_toml(path, OPTIONS)
    for name, value in options.items():
        kinds = (int, float) if name == "fps" else (str, int, float) if name == "unit" else (str,)
        if not isinstance(value, kinds) or isinstance(value, bool):
            raise BadConfig(f"{name} cannot be {value!r}", where=str(path))
    return options


def reading_of(motions: Sequence[BvhMotion], options: dict[str, str | float], folder: Path) -> Reading:
    """How to read motions (joint names without prefixes): as the options say, else as the motions look.

    Raises
    ------
    BadMotion : skeleton, unit or up axis is not given and cannot be told.
    BadConfig : no such skeleton or unit.
    """
    notes: list[str] = []
    skeleton = options.get("skeleton")
    if skeleton is None:
        skeleton_map = recognise(motions[0])
        notes.append(f"skeleton {skeleton_map.name}, recognised by its joint names")
    elif str(skeleton).endswith(".toml"):
        skeleton_map = read_skeleton_map(folder / str(skeleton))
    else:
        skeleton_map = known_map(str(skeleton))
    stature = common_stature(rest_stature(motion, skeleton_map) for motion in motions)
    unit = options.get("unit")
    if unit is None:
        unit = guess_unit(stature)
        notes.append(f"unit {unit} assumed, because Head over toes is {stature:.4g} file units")
    unit_m = unit_metres(unit)
    up = options.get("up")
    if up is None:
        up = guess_up([head_over_feet(motion, skeleton_map) for motion in motions])
        notes.append(f"{up.upper()} up assumed, because heads are over feet along it")
    fps = options.get("fps")
    if fps is None:
        rates = Counter(round(motion.fps, 3) for motion in motions)
        notes.append(f"{', '.join(f'{rate:g}' for rate in sorted(rates))} frames per second, from the frame times")
    virtual = sorted(skeleton_map.virtual_offsets_m)
    if virtual:
        notes.append(f"virtual: {', '.join(virtual)}")
    return Reading(skeleton_map, unit_m, str(up), None if fps is None else float(fps), tuple(notes))


def _labelled(folder: Path, pattern: str | float | None, places: Sequence[str]) -> tuple[list[LabelledFile], list[str]]:
    table = folder / LABELS_CSV
    if table.is_file() and pattern is not None:
        raise BadConfig(f"{LABELS_CSV} and a pattern are both given", where=str(folder), remedy="keep one of them")
    if table.is_file():
        files = labels_from_csv(table, places)
        left = len(places) - len(files)
        return files, [f"{left} BVH files without a row in {LABELS_CSV} are left out"] * bool(left)
    if pattern is None:
        raise BadData(
            f"no labels: neither {LABELS_CSV} nor a pattern in {OPTIONS_FILE}; the folder has {len(places)} BVH files",
            where=str(folder),
            remedy=f"write {LABELS_CSV} with columns file, content, style, or {OPTIONS_FILE} with a line "
            'such as pattern = "{content}_{style}_{any}"',
        )
    files, others = labels_from_pattern(str(pattern), places)
    if not files:
        raise BadData(
            f"no file fits the pattern {pattern!r}, the first is {places[0]}", where=str(folder / OPTIONS_FILE)
        )
    return files, [f"{len(others)} BVH files do not fit the pattern and are left out"] * bool(others)


def _slug(name: str) -> str:
    return "".join(letter if letter.isalnum() or letter in "-_." else "-" for letter in name)[:40] or "folder"


ENTRY = DatasetEntry(
    load=load,
    summary="any folder of BVH files with labels.csv or a pattern for file names",
    licence="that of your files",
    citation="that of your files",
    how_to_get=HOW_TO_GET,
    load_as=load,
)
