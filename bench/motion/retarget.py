"""Any mapped skeleton to the canonical 21 joints.

World rotations of kept joints are those of the source, expressed relative to the canonical T-pose: where the source
stands in that pose, the clip's rotations are identity. Joints that the canonical skeleton lacks are folded in by
forward kinematics: their rotations are part of the world rotations below them, and they place those joints in the rest
pose. A clip's bones are rigid, so what a dropped joint does beyond its T-pose rotation moves the joints below it by a
little; :func:`folding_error_m` says by how much. Rotations are not bent to hide it: that would move the error from the
position of a shoulder into the direction of an arm, which is what the judges and the gesture metrics look at.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadMotion
from bench.motion import kinematics, quat
from bench.motion.bvh import BvhMotion, local_motion, world_motion
from bench.motion.clip import Clip
from bench.motion.skeleton import CANONICAL_NAMES, CANONICAL_PARENTS, Skeleton, canonical_skeleton
from bench.motion.skeleton_maps import SkeletonMap
from bench.motion.zero_pose import fitted

_Z_TO_Y_UP = quat.from_axis_angle(np.array([1.0, 0.0, 0.0]), -np.pi / 2)
OFFSET_TOLERANCE = 1e-3
"""File units by which position channels may leave OFFSET and still count as rounding of it."""


def to_canonical(
    bvh: BvhMotion, skeleton_map: SkeletonMap, *, unit_m: float, fps: float | None = None, up: str = "y"
) -> Clip:
    """The motion on the canonical 21 joints.

    Parameters
    ----------
    bvh : a motion with the joints that the map names.
    skeleton_map : see :mod:`bench.motion.skeleton_maps`.
    unit_m : metres per file unit.
    fps : overrides the file's frame time.
    up : the world's up axis in the file, ``"y"`` or ``"z"``.

    Raises
    ------
    BadMotion : a mapped joint is missing, or the frame rate is not one of a motion.
    BadConfig : another ``up``, or a ``unit_m`` that is not positive.
    """
    skeleton_map = _with_t_pose(bvh, skeleton_map)
    positions, rotations = _canonical_world(bvh, skeleton_map, unit_m, up)
    skeleton = _skeleton(bvh, skeleton_map, unit_m)
    local = rotations.copy()
    parents = list(CANONICAL_PARENTS[1:])
    local[:, 1:] = quat.multiply(quat.conjugate(rotations[:, parents]), rotations[:, 1:])
    return Clip(skeleton, local, positions[:, 0], _checked_fps(bvh, fps))


def folding_error_m(
    bvh: BvhMotion, clip: Clip, skeleton_map: SkeletonMap, *, unit_m: float, up: str = "y"
) -> FloatArray:
    """Distance ``[F, 21]`` in metres between a retargeted clip's joints and the source's; NaN for virtual joints."""
    positions, _ = _canonical_world(bvh, _with_t_pose(bvh, skeleton_map), unit_m, up)
    error: FloatArray = np.linalg.norm(kinematics.world_positions(clip) - positions, axis=-1)
    return error


def rest_stature(bvh: BvhMotion, skeleton_map: SkeletonMap) -> float:
    """Rest height of Head over the lower toe in file units.

    Raises
    ------
    BadMotion : a mapped joint is missing, or the skeleton does not stand.
    """
    return _skeleton(bvh, _with_t_pose(bvh, skeleton_map), 1.0).stature_m


def _with_t_pose(bvh: BvhMotion, skeleton_map: SkeletonMap) -> SkeletonMap:
    """The map with the T-pose rotations of this file's joints."""
    _source_indices(bvh, skeleton_map)
    return fitted(bvh, _bones(bvh), skeleton_map) if skeleton_map.zero_pose else skeleton_map


def _canonical_world(
    bvh: BvhMotion, skeleton_map: SkeletonMap, unit_m: float, up: str
) -> tuple[FloatArray, FloatArray]:
    """World positions ``[F, 21, 3]`` (metres, NaN for virtual joints) and rotations relative to the T-pose."""
    if up not in ("y", "z"):
        raise BadConfig(f"up must be 'y' or 'z', got {up!r}", where="up")
    if not 0.0 < unit_m < np.inf:
        raise BadConfig(f"unit_m must be metres per file unit, got {unit_m}", where="unit_m", remedy="0.01 is a cm")
    sources = _source_indices(bvh, skeleton_map)
    source_positions, source_rotations = world_motion(bvh)
    rest = np.stack([skeleton_map.t_pose_wxyz.get(bvh.names[source], quat.IDENTITY) for source in sources])
    positions = source_positions[:, sources] * unit_m
    rotations = quat.multiply(source_rotations[:, sources], quat.conjugate(rest))
    if up == "z":
        positions, rotations = quat.rotate(_Z_TO_Y_UP, positions), quat.multiply(_Z_TO_Y_UP, rotations)
    virtual = [CANONICAL_NAMES.index(name) for name in skeleton_map.virtual_offsets_m]
    positions[:, virtual] = np.nan
    return positions, rotations


def _source_indices(bvh: BvhMotion, skeleton_map: SkeletonMap) -> list[int]:
    """For each canonical joint the index of its source joint; a virtual joint follows its canonical parent's."""
    index = {name: i for i, name in enumerate(bvh.names)}
    missing = [source for source in skeleton_map.joints.values() if source not in index]
    if missing:
        raise BadMotion(
            f"the skeleton lacks {', '.join(missing)}; it has {', '.join(bvh.names[:40])}",
            cause=f"not a {skeleton_map.name} skeleton",
            remedy="use another joint map",
        )
    sources: list[int] = []
    for name, parent in zip(CANONICAL_NAMES, CANONICAL_PARENTS, strict=True):
        source = skeleton_map.joints.get(name)
        sources.append(sources[parent] if source is None else index[source])
    return sources


def _skeleton(bvh: BvhMotion, skeleton_map: SkeletonMap, unit_m: float) -> Skeleton:
    """Canonical offsets: the source skeleton put into the T-pose, dropped joints included."""
    t_pose = np.stack([skeleton_map.t_pose_wxyz.get(name, quat.IDENTITY) for name in bvh.names])
    bones = quat.rotate(t_pose[list(bvh.parents)], _bones(bvh))
    rest = np.zeros((len(bvh.names), 3))
    for joint, parent in enumerate(bvh.parents[1:], start=1):
        rest[joint] = rest[parent] + bones[joint]
    offsets = np.zeros((len(CANONICAL_NAMES), 3))
    sources = _source_indices(bvh, skeleton_map)
    for joint, parent in enumerate(CANONICAL_PARENTS[1:], start=1):
        virtual_offset = skeleton_map.virtual_offsets_m.get(CANONICAL_NAMES[joint])
        if virtual_offset is not None:
            offsets[joint] = virtual_offset
        else:
            offsets[joint] = (rest[sources[joint]] - rest[sources[parent]]) * unit_m
    # Files of one skeleton differ in the last bits; rounded to a picometre, their takes share one.
    return canonical_skeleton(np.round(offsets, 12), frozenset(skeleton_map.virtual_offsets_m))


def _bones(bvh: BvhMotion) -> FloatArray:
    """Offset ``[J, 3]`` of each joint from its parent; the mean of its position channels where they leave OFFSET."""
    moving = [joint for joint, names in enumerate(bvh.channels) if any(n.endswith("position") for n in names)]
    bones = bvh.offsets.copy()
    if moving:
        _, translations = local_motion(bvh)
        away = np.abs(translations[:, moving] - bvh.offsets[moving]).max(axis=(0, 2)) > OFFSET_TOLERANCE
        off = np.asarray(moving)[away]
        bones[off] = translations[:, off].mean(axis=0)
    return bones


def _checked_fps(bvh: BvhMotion, fps: float | None) -> float:
    if fps is None and not 1.0 <= bvh.fps <= 1000.0:
        raise BadMotion(
            f"Frame Time {bvh.frame_time_s:g} s means {bvh.fps:.4g} frames per second",
            cause="a frame time in milliseconds, or the rate in its place",
            remedy="give fps",
        )
    return bvh.fps if fps is None else fps
