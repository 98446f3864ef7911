"""What a motion file does not say: which skeleton it has, its unit, which way is up.

Skeletons are recognised by joint names, without prefixes such as ``mixamorig:``. The unit follows from the stature: an
adult's Head joint lies 1.0 to 1.9 m over the toes. Up is the axis along which the head is over the feet.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadMotion
from bench.motion.bvh import BvhMotion, world_motion
from bench.motion.known_skeletons import KNOWN_SKELETONS
from bench.motion.retarget import rest_stature
from bench.motion.skeleton_maps import CMU_UNIT_M, SkeletonMap

UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254, "cmu": CMU_UNIT_M}
"""Name of a unit -> metres."""
ADULT_STATURE_M = (1.0, 1.9)
"""Plausible heights of the Head joint over the toes."""
_PREFIX = re.compile(r".*:|(?:mixamorig|Character)\d*_")


@dataclass(frozen=True)
class JointMatch:
    """How a file's joints fit a map.

    Attributes
    ----------
    name : of the map.
    matched : canonical name -> the file's joint.
    virtual : canonical joints that the map places rigidly.
    missing : joints that the map names and the file lacks.
    dropped : joints of the file that only place others.
    stands : False where the map reads the zero pose and the file's is not a standing one; ``problem`` says why.
    """

    name: str
    matched: dict[str, str]
    virtual: tuple[str, ...]
    missing: tuple[str, ...]
    dropped: tuple[str, ...]
    stands: bool = True
    problem: str = ""

    @property
    def complete(self) -> bool:
        return not self.missing and self.stands


def with_bare_names(bvh: BvhMotion) -> BvhMotion:
    """The motion with joint names without prefix; unchanged where two names would become one."""
    names = tuple(_PREFIX.sub("", name, count=1) for name in bvh.names)
    return replace(bvh, names=names) if len(set(names)) == len(names) and all(names) else bvh


def match_joints(bvh: BvhMotion, skeleton_map: SkeletonMap) -> JointMatch:
    """How a file's joints fit a map."""
    needed = [*skeleton_map.joints.values(), *skeleton_map.t_pose_wxyz]
    missing = tuple(dict.fromkeys(name for name in needed if name not in bvh.names))
    stands, problem = True, ""
    if not missing:
        try:
            rest_stature(bvh, skeleton_map)
        except BadMotion as error:
            stands, problem = False, str(error)
    return JointMatch(
        skeleton_map.name,
        {ours: theirs for ours, theirs in skeleton_map.joints.items() if theirs in bvh.names},
        tuple(skeleton_map.virtual_offsets_m),
        missing,
        tuple(name for name in bvh.names if name not in skeleton_map.joints.values()),
        stands,
        problem,
    )


def recognise(bvh: BvhMotion) -> SkeletonMap:
    """The known map that fits the (bare) joint names.

    Raises
    ------
    BadMotion : none fits; says which comes nearest and what it lacks.
    """
    matches = [match_joints(bvh, skeleton_map) for skeleton_map in KNOWN_SKELETONS.values()]
    for match in matches:
        if match.complete:
            return KNOWN_SKELETONS[match.name]
    nearest = min(matches, key=lambda match: (len(match.missing), -len(match.matched)))
    lacks = f"lacks {', '.join(nearest.missing)}" if nearest.missing else nearest.problem
    raise BadMotion(
        f"no known skeleton fits its {len(bvh.names)} joints; nearest is {nearest.name}: {lacks}",
        cause=f"other joint names: {', '.join(bvh.names[:12])} ...",
        remedy="write a joint map (docs/skeletons.md) and see what it matches with 'stylebench data skeleton'",
    )


def known_map(name: str) -> SkeletonMap:
    """A known map by name.

    Raises
    ------
    BadConfig : there is none of that name.
    """
    if name not in KNOWN_SKELETONS:
        raise BadConfig(f"no skeleton called {name!r}", remedy=f"choose from {', '.join(KNOWN_SKELETONS)}")
    return KNOWN_SKELETONS[name]


def guess_unit(stature: float) -> str:
    """The unit in which ``stature`` (Head over toes, file units) is an adult's.

    Raises
    ------
    BadMotion : none is.
    """
    low, high = ADULT_STATURE_M
    for name, metres in UNITS_M.items():
        if low <= stature * metres <= high:
            return name
    raise BadMotion(
        f"Head over toes is {stature:.4g} file units, an adult's in none of {', '.join(UNITS_M)}",
        cause="a child, an animal, or another unit",
        remedy="give unit: a name, or metres per file unit",
    )


def head_over_feet(bvh: BvhMotion, skeleton_map: SkeletonMap) -> FloatArray:
    """Mean direction ``[3]`` from the feet to the head, of unit length, in the file's own axes."""
    positions, _ = world_motion(bvh)
    head, left, right = (
        positions[:, bvh.names.index(skeleton_map.joints[name])] for name in ("Head", "LeftFoot", "RightFoot")
    )
    direction = (head - (left + right) / 2.0).mean(axis=0)
    return np.asarray(direction / max(float(np.linalg.norm(direction)), 1e-12))


def guess_up(directions: Sequence[FloatArray]) -> str:
    """``"y"`` or ``"z"``: the axis along which heads are over feet, over all files.

    Raises
    ------
    BadMotion : it is neither.
    """
    mean = np.mean(np.stack(directions), axis=0)
    axis = int(np.abs(mean).argmax())
    if axis == 0 or mean[axis] < 0.5:
        text = ", ".join(f"{value:.2f}" for value in mean)
        raise BadMotion(
            f"heads lie along ({text}) from feet, which is neither Y nor Z up",
            cause="people lying down, or another up axis",
            remedy="give up: y or z",
        )
    return "xyz"[axis]


def unit_metres(unit: str | float) -> float:
    """Metres per file unit of a unit's name, or of a number given as such.

    Raises
    ------
    BadConfig : neither.
    """
    if isinstance(unit, str) and unit in UNITS_M:
        return UNITS_M[unit]
    try:
        return float(unit)
    except ValueError:
        raise BadConfig(f"unit must be one of {', '.join(UNITS_M)} or metres per file unit, got {unit!r}") from None


def common_stature(statures: Iterable[float]) -> float:
    """The median: one wrong file does not decide for a folder."""
    return float(np.median(list(statures)))
