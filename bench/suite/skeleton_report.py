"""What ``stylebench data skeleton FILE`` prints."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from bench.datasets.bvh_files import read_motion
from bench.datasets.bvh_folder import reading_of
from bench.errors import BadMotion
from bench.motion.bvh import BvhMotion
from bench.motion.known_skeletons import KNOWN_SKELETONS
from bench.motion.recognise import JointMatch, known_map, match_joints
from bench.motion.skeleton import CANONICAL_NAMES
from bench.motion.skeleton_maps import SkeletonMap
from bench.motion.user_map import read_skeleton_map


@dataclass(frozen=True)
class SkeletonReport:
    """How a file is understood.

    Attributes
    ----------
    facts : in words.
    joints : rows of canonical joint, ``matched`` / ``virtual`` / ``missing``, joint of the file.
    complete : whether the file can be used.
    """

    facts: dict[str, str]
    joints: list[list[str]]
    complete: bool


def skeleton_report(file: Path, options: Mapping[str, str | float]) -> SkeletonReport:
    """How a file's joints, unit, up axis and frame rate are understood.

    Parameters
    ----------
    options : of ``skeleton``, ``unit``, ``up``, ``fps``, those that are given.

    Raises
    ------
    BadFile : not a BVH file.
    BadConfig : no such skeleton or unit.
    """
    motion = read_motion(file)
    skeleton_map, match = _best(motion, str(options.get("skeleton", "")))
    facts = {
        "file": f"{file.name}, {motion.n_frames} frames, {len(motion.names)} joints",
        "skeleton": skeleton_map.name,
        "dropped joints (they only place others)": ", ".join(match.dropped) or "none",
    }
    complete = match.complete
    if match.missing:
        facts["missing"] = ", ".join(match.missing)
    if match.problem:
        facts["problem"] = match.problem
    if complete:
        try:
            given = {name: value for name, value in options.items() if name != "skeleton"}
            reading = reading_of([motion], {**given, "skeleton": str(options.get("skeleton", match.name))}, Path())
            clip = reading.to_clip(motion)
            facts["stature of Head over Toes, m"] = f"{clip.skeleton.stature_m:.3f}"
            facts["fps"] = f"{clip.fps:g}"
            facts["notes"] = "; ".join(reading.notes) or "nothing was assumed"
        except BadMotion as error:
            facts["problem"], complete = str(error), False
    return SkeletonReport(facts, _rows(skeleton_map, match), complete)


def _best(motion: BvhMotion, wanted: str) -> tuple[SkeletonMap, JointMatch]:
    """The map that is asked for, or the known one that fits best, and how it fits."""
    if wanted:
        skeleton_map = read_skeleton_map(Path(wanted)) if wanted.endswith(".toml") else known_map(wanted)
        return skeleton_map, match_joints(motion, skeleton_map)
    found = [(skeleton_map, match_joints(motion, skeleton_map)) for skeleton_map in KNOWN_SKELETONS.values()]
    return min(found, key=lambda pair: (not pair[1].complete, len(pair[1].missing)))


def _rows(skeleton_map: SkeletonMap, match: JointMatch) -> list[list[str]]:
    rows = []
    for name in CANONICAL_NAMES:
        source = skeleton_map.joints.get(name)
        if source is None:
            rows.append([name, "virtual", "-"])
        else:
            rows.append([name, "matched" if name in match.matched else "missing", source])
    return rows
