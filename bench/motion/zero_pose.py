"""T-pose rotations read off a zero pose.

In many files all rotations zero is a person who stands: arms out or hanging aslant, legs straight or spread, along any
axes. The up axis is the signed axis nearest to Hips -> Head, the left axis the one nearest to right -> left upper leg;
one rotation brings both to Y and X. Then arms and legs get the least turn that brings each bone to its direction in the
canonical T-pose, and so does a clavicle that points elsewhere than outwards, as where the arms of the zero pose are up.
Feet, trunk and other dropped joints keep the direction that they have. Fingers turn with the hand, virtual ones with
the forearm.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadMotion
from bench.motion import quat
from bench.motion.bvh import BvhMotion
from bench.motion.skeleton_maps import DOWN, LEFT, RIGHT, SkeletonMap

LIMBS = (
    (DOWN, ("LeftUpLeg", "LeftLeg", "LeftFoot")),
    (DOWN, ("RightUpLeg", "RightLeg", "RightFoot")),
    (LEFT, ("LeftArm", "LeftForeArm", "LeftHand", "LeftHandIndex1")),
    (RIGHT, ("RightArm", "RightForeArm", "RightHand", "RightHandIndex1")),
)
"""Direction of a limb's bones in the canonical T-pose, and its joints."""
MIN_AXIS_SHARE = 0.8
"""How much of a direction must lie along its nearest axis."""
MIN_OUTWARD_SHARE = 0.7
"""How much of a clavicle must point outwards for it to be left as it is."""


def fitted(bvh: BvhMotion, bones: FloatArray, skeleton_map: SkeletonMap) -> SkeletonMap:
    """The map with T-pose rotations for every joint of the file.

    Parameters
    ----------
    bvh : has the joints that the map names.
    bones : ``[J, 3]`` offset of each joint from its parent, file units.
    skeleton_map : its own ``t_pose_wxyz`` entries are kept.

    Raises
    ------
    BadMotion : the zero pose does not stand upright along an axis.
    """
    place = dict(zip(bvh.names, _positions(bvh, bones), strict=True))
    upright = _upright(place, skeleton_map)
    t_pose = dict.fromkeys(bvh.names, upright)
    for direction, chain in LIMBS:
        turned = upright
        for joint, child in zip(chain, (*chain[1:], None), strict=True):
            start = skeleton_map.joints.get(joint)
            if start is None:
                continue
            end = skeleton_map.joints.get(child) if child else None
            now = None if end is None else _direction(place[end] - place[start], upright)
            if now is not None:
                turned = quat.multiply(quat.between(now, np.asarray(direction)), upright)
            if end is None and joint.endswith("Foot"):
                continue
            for name in _path(bvh, start, end):
                t_pose[name] = turned
        for name, child in _clavicles(bvh, skeleton_map, chain[0]):
            now = _direction(place[child] - place[name], upright)
            if now is not None and now @ np.asarray(direction) < MIN_OUTWARD_SHARE:
                t_pose[name] = quat.multiply(quat.between(now, np.asarray(direction)), upright)
    return replace(skeleton_map, t_pose_wxyz={**t_pose, **skeleton_map.t_pose_wxyz})


def _direction(bone: FloatArray, upright: FloatArray) -> FloatArray | None:
    """Where a bone of the zero pose points once that stands upright; None for a bone without length."""
    length = float(np.linalg.norm(bone))
    return quat.rotate(upright, bone / length) if length > 0.0 else None


def _clavicles(bvh: BvhMotion, skeleton_map: SkeletonMap, limb: str) -> list[tuple[str, str]]:
    """Dropped joints between the chest and an arm, each with the joint that its bone leads to."""
    if not limb.endswith("Arm"):
        return []
    chest, arm = skeleton_map.joints["Spine1"], skeleton_map.joints[limb]
    path = _path(bvh, chest, arm)
    dropped = path[:-1] if path[-1] == chest else []
    return list(zip(dropped, [arm, *dropped], strict=False))


def _positions(bvh: BvhMotion, bones: FloatArray) -> FloatArray:
    """Joint positions ``[J, 3]`` with all rotations zero, the root at the origin."""
    positions = np.zeros((len(bvh.names), 3))
    for joint, parent in enumerate(bvh.parents[1:], start=1):
        positions[joint] = positions[parent] + bones[joint]
    return positions


def _upright(place: dict[str, FloatArray], skeleton_map: SkeletonMap) -> FloatArray:
    """The rotation ``[4]`` that stands the zero pose up along Y, facing +Z."""
    hips, head, left, right, foot = (
        place[skeleton_map.joints[name]] for name in ("Hips", "Head", "LeftUpLeg", "RightUpLeg", "LeftFoot")
    )
    up, across = _nearest_axis(head - hips), _nearest_axis(left - right)
    if up is None or across is None or up @ across != 0.0 or (foot - hips) @ up >= 0.0:
        raise BadMotion(
            f"with all rotations zero the skeleton does not stand: Head lies {_text(head - hips)} from Hips, "
            f"LeftFoot {_text(foot - hips)}, LeftUpLeg {_text(left - right)} from RightUpLeg",
            cause=f"bones along local axes, or not a {skeleton_map.name} skeleton",
            remedy="give a joint map with the T-pose axes of its joints, see docs/skeletons.md",
        )
    return quat.from_matrix(np.stack([across, up, np.cross(across, up)]))


def _nearest_axis(vector: FloatArray) -> FloatArray | None:
    length = float(np.linalg.norm(vector))
    largest = int(np.abs(vector).argmax())
    if length == 0.0 or abs(vector[largest]) < MIN_AXIS_SHARE * length:
        return None
    axis = np.zeros(3)
    axis[largest] = np.sign(vector[largest])
    return axis


def _path(bvh: BvhMotion, start: str, end: str | None) -> list[str]:
    """Joints from ``start`` down to, without, ``end``; ``start`` alone where there is no end below it."""
    if end is None:
        return [start]
    joint, path = bvh.parents[bvh.names.index(end)], []
    while joint >= 0:
        path.append(bvh.names[joint])
        if bvh.names[joint] == start:
            return path
        joint = bvh.parents[joint]
    return [start]


def _text(vector: FloatArray) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in vector) + ")"
