"""Whether a copy of a dataset is whole: files that are changed, missing, extra or truncated, by name.

Bandai-Namco is compared with the digests of its published takes, 100STYLE with the frames that its ``Frame_Cuts.csv``
names, ZeroEGGS with its 67 numbers, Xia 2015 with its number of files, cells, numbering and joints, a labelled folder
with its ``labels.csv``. Of any folder a manifest can be written
(:func:`write_manifest`), and from then on every byte is compared with it.
"""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from bench.datasets import bandai_namco, style100, xia2015, zeroeggs
from bench.datasets.bvh_files import bvh_places, read_motion
from bench.datasets.labels import LABELS_CSV
from bench.errors import BadConfig, BadData, BenchError
from bench.motion.bvh import BvhMotion, read_bvh
from bench.motion.recognise import match_joints
from bench.motion.skeleton_maps import CMU_31

MANIFEST = "stylebench-manifest.csv"
COLUMNS = ("file", "bytes", "blake2b")


@dataclass(frozen=True)
class Finding:
    """A file that is not as expected; ``state`` is changed, missing, extra or truncated."""

    file: str
    state: str
    detail: str = ""


@dataclass(frozen=True)
class Verdict:
    """What was compared, with what, and what differs."""

    compared: int
    against: str
    findings: tuple[Finding, ...]


def verify(name: str, path: Path) -> Verdict:
    """Compare a copy with what is known of it.

    Raises
    ------
    BadConfig : nothing is known of files of that dataset.
    BadData, BadFile : there is no such copy.
    """
    if not path.exists():
        raise BadData("no such file or folder", where=str(path))
    if (path / MANIFEST).is_file():
        return _against_manifest(path)
    if name == bandai_namco.NAME:
        return _bandai_namco(path)
    checks: dict[str, Callable[[Path, list[str]], tuple[str, list[Finding]]]] = {
        style100.NAME: _style100,
        zeroeggs.NAME: _zeroeggs,
        xia2015.NAME: _xia2015,
        "bvh-folder": _labelled,
    }
    if name not in checks:
        raise BadConfig(f"dataset {name!r} has no files to verify", remedy=f"choose from {', '.join(checks)}")
    places = bvh_places(path)
    against, findings = checks[name](path, places)
    named = {finding.file for finding in findings}
    findings += [found for place in places if place not in named for found in _unreadable(path, place)]
    return Verdict(len(places), f"{against}; every file must be readable", tuple(findings))


def write_manifest(folder: Path) -> Path:
    """Write down size and digest of every file of a folder, to be compared with later.

    Raises
    ------
    BadData : not a folder.
    """
    if not folder.is_dir():
        raise BadData("a manifest is written into a folder", where=str(folder))
    target = folder / MANIFEST
    with target.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        for place in _all_places(folder):
            writer.writerow([place, (folder / place).stat().st_size, _digest(folder / place)])
    return target


def _all_places(folder: Path) -> list[str]:
    found = (path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file())
    return sorted(place for place in found if place != MANIFEST)


def _digest(path: Path) -> str:
    state = hashlib.blake2b(digest_size=16)
    with path.open("rb") as file:
        while chunk := file.read(2**22):
            state.update(chunk)
    return state.hexdigest()


def _against_manifest(folder: Path) -> Verdict:
    expected = _read_manifest(folder / MANIFEST)
    places = set(_all_places(folder))
    findings = [Finding(place, "missing") for place in sorted(set(expected) - places)]
    findings += [Finding(place, "extra") for place in sorted(places - set(expected))]
    for place in sorted(places & set(expected)):
        size, digest = expected[place]
        now = (folder / place).stat().st_size
        if now < size:
            findings.append(Finding(place, "truncated", f"{now} of {size} bytes"))
        elif now > size or _digest(folder / place) != digest:
            findings.append(Finding(place, "changed"))
    return Verdict(len(expected), MANIFEST, tuple(findings))


def _read_manifest(path: Path) -> dict[str, tuple[int, str]]:
    with path.open(newline="") as file:
        try:
            return {row["file"]: (int(row["bytes"]), row["blake2b"]) for row in csv.DictReader(file)}
        except (KeyError, TypeError, ValueError) as error:
            raise BadData(f"is no manifest ({error!r})", where=str(path), remedy="write it again") from error


def _unreadable(folder: Path, place: str) -> list[Finding]:
    try:
        read_bvh(folder / place, name=place)
    except BenchError as error:
        return [_broken(place, error)]
    return []


def _broken(place: str, error: BenchError) -> Finding:
    cut = re.search(r"truncated|cut off|interrupted", f"{error.cause} {error.problem}")
    return Finding(place, "truncated" if cut else "changed", str(error))


def _bandai_namco(path: Path) -> Verdict:
    findings: list[Finding] = []
    for name, row, motion in bandai_namco.check_takes(path):
        file = f"{name}.bvh"
        if row is None:
            findings.append(Finding(file, "extra", "not in the published subset"))
        elif motion is None:
            findings.append(Finding(file, "missing"))
        elif isinstance(motion, BvhMotion):
            if motion.n_frames < row.frames:
                findings.append(Finding(file, "truncated", f"{motion.n_frames} of {row.frames} frames"))
            elif bandai_namco.channel_digest(motion) != row.digest:
                findings.append(Finding(file, "changed", "other values than published"))
        else:
            findings.append(_broken(file, motion))
    published = len(bandai_namco.published_takes())
    return Verdict(published, f"digests of the {published} published takes", tuple(findings))


def _style100(path: Path, places: list[str]) -> tuple[str, list[Finding]]:
    cuts = style100.read_cuts(style100.find_cuts(path))
    at = {PurePosixPath(place).name: place for place in places}
    findings = []
    for (style, gait), (_, stop) in sorted(cuts.items()):
        file = f"{style}_{gait}.bvh"
        if file not in at:
            findings.append(Finding(file, "missing"))
            continue
        try:
            frames = read_bvh(path / at[file], name=at[file]).n_frames
        except BenchError as error:
            findings.append(_broken(at[file], error))
            continue
        if frames < stop:
            detail = f"{frames} frames, {style100.CUTS_CSV} goes to {stop}"
            findings.append(Finding(at[file], "truncated", detail))
    known = {f"{style}_{gait}.bvh" for style, gait in cuts}
    findings += [Finding(place, "extra") for file, place in sorted(at.items()) if file not in known]
    if len(cuts) >= style100.PUBLISHED_FILES:
        findings += [Finding(style100.CUTS_CSV, "changed", wrong) for wrong in style100.check_totals(cuts)]
    return f"the {len(cuts)} recordings of {style100.CUTS_CSV}", findings


def _zeroeggs(path: Path, places: list[str]) -> tuple[str, list[Finding]]:
    numbers = {PurePosixPath(place).name[:3] for place in places}
    expected = [f"{number:03d}" for number in range(1, zeroeggs.PUBLISHED_FILES + 1)]
    findings = [Finding(f"{number}_*.bvh", "missing") for number in expected if number not in numbers]
    findings += [Finding(place, "extra") for place in places if PurePosixPath(place).name[:3] not in expected]
    return f"the {zeroeggs.PUBLISHED_FILES} numbers of the published sequences", findings


def _xia2015(path: Path, places: list[str]) -> tuple[str, list[Finding]]:
    stems = {place: PurePosixPath(place).stem for place in places}
    extra = [place for place, stem in stems.items() if xia2015.labels_of(stem) is None]
    findings = [Finding(place, "extra", "not called like a take") for place in extra]
    takes = [place for place in places if place not in extra]
    findings += [found for place in takes for found in _other_skeleton(path, place)]
    short = xia2015.PUBLISHED_FILES - len(takes)
    if short > 0:
        names = [stems[place] for place in takes]
        findings += [
            Finding(f"{style}, {content}", "missing", "no file of this cell")
            for content, style in xia2015.empty_cells(names)
        ]
        findings += [Finding(f"{name}.bvh", "missing", "its number is skipped") for name in xia2015.skipped(names)]
        findings.append(Finding(f"{short} files", "missing", f"of {xia2015.PUBLISHED_FILES}; no list of names exists"))
    return f"the number of files, {xia2015.PUBLISHED_FILES}, their numbering, names and joints", findings


def _other_skeleton(folder: Path, place: str) -> list[Finding]:
    """A readable file that lacks joints of the dataset's skeleton."""
    try:
        match = match_joints(read_motion(folder / place, place), CMU_31)
    except BenchError:
        return []
    return [Finding(place, "changed", f"lacks {', '.join(match.missing)}")] if match.missing else []


def _labelled(path: Path, places: list[str]) -> tuple[str, list[Finding]]:
    table = path / LABELS_CSV
    if not table.is_file():
        return "nothing, as there is no labels.csv and no manifest", []
    try:
        rows = list(csv.DictReader(table.read_text(encoding="utf-8-sig").splitlines()))
    except (OSError, UnicodeDecodeError) as error:
        raise BadData(f"cannot be read ({error})", where=str(table)) from error
    named = {str(row.get("file") or "").strip().replace("\\", "/").removeprefix("./") for row in rows} - {""}
    named = {file if file.lower().endswith(".bvh") else f"{file}.bvh" for file in named}
    findings = [Finding(file, "missing") for file in sorted(named - set(places))]
    findings += [Finding(place, "extra", f"no row in {LABELS_CSV}") for place in sorted(set(places) - named)]
    return f"the {len(named)} rows of {LABELS_CSV}", findings
