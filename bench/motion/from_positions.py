"""Joint positions to a clip: for data that comes as arrays of SMPL joints instead of BVH.

Hips and Spine1 get frames from the joints fixed to them (upper legs and Spine; arms and Neck1). Every other joint gets
the least turn, from its parent's frame, that brings its bone from the rest direction to where it is; so turns about a
bone's own axis, which positions do not show, are those of the parent. Bones are as long as the median over the frames.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray, finite_array
from bench.errors import BadConfig, BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.known_skeletons import FINGERS_M, SMPL
from bench.motion.skeleton import CANONICAL_NAMES, CANONICAL_PARENTS, N_JOINTS, SPINE1, canonical_skeleton
from bench.motion.skeleton_maps import DOWN, LEFT, RIGHT

SMPL_NAMES = (
    "pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle",
    "spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder",
    "right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand",
)  # fmt: skip
"""Joints of SMPL in order; sets with 22 joints (HumanML3D, AMASS) leave out the hands."""

_NEXT = {name: child for child, name in ((c, CANONICAL_NAMES[p]) for c, p in enumerate(CANONICAL_PARENTS) if p >= 0)}
_REST = {
    **dict.fromkeys(("LeftUpLeg", "LeftLeg", "RightUpLeg", "RightLeg"), DOWN),
    **dict.fromkeys(("LeftArm", "LeftForeArm"), LEFT),
    **dict.fromkeys(("RightArm", "RightForeArm"), RIGHT),
}
"""Rest direction of the bone that leaves a limb's joint; other bones rest in their median direction."""


def clip_from_smpl(positions: FloatArray, fps: float, *, unit_m: float = 1.0, up: str = "y") -> Clip:
    """A clip on the canonical 21 joints from SMPL joint positions.

    Parameters
    ----------
    positions : ``[F, 22, 3]`` or ``[F, 24, 3]`` in the order of ``SMPL_NAMES``.
    fps : frames per second.
    unit_m : metres per unit.
    up : ``"y"`` or ``"z"``.

    Raises
    ------
    BadMotion : another shape, or values that are not finite.
    BadConfig : another ``up``.
    """
    if up not in ("y", "z"):
        raise BadConfig(f"up must be 'y' or 'z', got {up!r}", where="up")
    shape = np.shape(positions)
    if len(shape) != 3 or shape[1] not in (22, 24):
        raise BadMotion(f"positions must be [F, 22, 3] or [F, 24, 3], got {list(shape)}", cause="not SMPL joints")
    try:
        values = finite_array(positions, "positions", (None, shape[1], 3)) * unit_m
    except Exception as error:
        raise BadMotion(str(error)) from error
    if up == "z":
        values = values[..., [0, 2, 1]] * np.array([1.0, 1.0, -1.0])
    sources = [SMPL_NAMES.index(SMPL.joints[name]) if name in SMPL.joints else -1 for name in CANONICAL_NAMES]
    return _clip(values[:, sources], fps)


def _clip(positions: FloatArray, fps: float) -> Clip:
    """A clip from canonical positions ``[F, 21, 3]``; those of the fingers are not looked at."""
    at = dict(zip(CANONICAL_NAMES, np.moveaxis(positions, 1, 0), strict=True))
    world = np.zeros((len(positions), N_JOINTS, 4))
    offsets = np.zeros((N_JOINTS, 3))
    for joint, (name, parent) in enumerate(zip(CANONICAL_NAMES, CANONICAL_PARENTS, strict=True)):
        if name in FINGERS_M:
            world[:, joint], offsets[joint] = world[:, parent], FINGERS_M[name]
            continue
        if parent >= 0:
            offsets[joint] = _offset(at[name] - at[CANONICAL_NAMES[parent]], world[:, parent], CANONICAL_NAMES[parent])
        if name == "Hips":
            middle = (at["LeftUpLeg"] + at["RightUpLeg"]) / 2.0
            world[:, joint] = _frame(at["LeftUpLeg"] - at["RightUpLeg"], at["Spine"] - middle)
        elif joint == SPINE1:
            world[:, joint] = _frame(at["LeftArm"] - at["RightArm"], at["Neck1"] - at["Spine1"])
        else:
            world[:, joint] = _least_turn(name, at, world[:, parent])
    local = world.copy()
    parents = list(CANONICAL_PARENTS[1:])
    local[:, 1:] = quat.multiply(quat.conjugate(world[:, parents]), world[:, 1:])
    return Clip(canonical_skeleton(offsets, frozenset(FINGERS_M)), local, positions[:, 0], fps)


def _offset(bone: FloatArray, parent_world: FloatArray, parent: str) -> FloatArray:
    """Rest offset ``[3]`` of a joint from bones ``[F, 3]``: along the parent's rest direction, else the median."""
    length = float(np.median(np.linalg.norm(bone, axis=-1)))
    if parent in _REST:
        return length * np.asarray(_REST[parent])
    median = np.median(quat.rotate(quat.conjugate(parent_world), bone), axis=0)
    return np.asarray(median * length / max(float(np.linalg.norm(median)), 1e-12))


def _least_turn(name: str, at: dict[str, FloatArray], parent_world: FloatArray) -> FloatArray:
    child = CANONICAL_NAMES[_NEXT[name]] if name in _NEXT else ""
    if not child or child in FINGERS_M:
        return parent_world
    bone = at[child] - at[name]
    rest = np.asarray(_REST.get(name) or np.median(quat.rotate(quat.conjugate(parent_world), bone), axis=0))
    return quat.multiply(quat.between(quat.rotate(parent_world, rest), bone), parent_world)


def _frame(across: FloatArray, up: FloatArray) -> FloatArray:
    """Rotations ``[F, 4]`` whose x axis is ``across`` and whose y axis is nearest to ``up``, both ``[F, 3]``."""
    x = across / np.maximum(np.linalg.norm(across, axis=-1, keepdims=True), 1e-12)
    z = np.cross(x, up)
    z /= np.maximum(np.linalg.norm(z, axis=-1, keepdims=True), 1e-12)
    return quat.from_matrix(np.stack([x, np.cross(z, x), z], axis=-1))
