"""Source skeletons as they stand in their zero pose, and generated motion on them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.bvh import BvhMotion
from bench.motion.clip import Clip
from bench.motion.kinematics import forward_kinematics
from bench.motion.known_skeletons import (
    CMU_21,
    LAFAN1,
    MIXAMO,
    SEMI_MST_21,
    SMPL,
    XSENS,
    ZEROEGGS,
)
from bench.motion.skeleton import CANONICAL_NAMES
from bench.motion.skeleton_maps import BANDAI_NAMCO, CMU_31, SkeletonMap
from bench.motion.zero_pose import fitted
from tests.golden.make_bvh import POSITIONS, Joint, text_of
from tests.motion.source_trees import BANDAI_NAMCO_TREE, CMU_31_TREE

Tree = Mapping[str, tuple[str | None, tuple[float, float, float]]]
"""Joint -> parent and offset from it in the standing pose (Y up, facing +Z), centimetres."""
ZYX = "Zrotation Yrotation Xrotation"


def _tree(trunk: str, leg: str, arm: str, attach: str) -> Tree:
    """``name:x,y,z`` chains: the trunk upwards, left leg and left arm outwards; the right side mirrors the left."""
    tree: dict[str, tuple[str | None, tuple[float, float, float]]] = {}

    def chain(text: str, parent: str | None, side: str, sign: float) -> None:
        for part in text.split():
            name, _, offset = part.partition(":")
            x, y, z = (float(number) for number in offset.split(","))
            name = name.replace("*", side)
            tree[name] = (parent, (sign * x, y, z))
            parent = name

    chain(trunk, None, "", 1.0)
    root = next(iter(tree))
    sides = ("left", "right") if "_hip" in leg else ("Left", "Right")
    for side, sign in zip(sides, (1.0, -1.0), strict=True):
        chain(leg, root, side, sign)
        chain(arm, attach, side, sign)
    return {name: tree[name] for name in _depth_first(tree, root)}


def _depth_first(tree: Tree, joint: str) -> list[str]:
    children = [name for name, (parent, _) in tree.items() if parent == joint]
    return [joint, *(name for child in children for name in _depth_first(tree, child))]


_ARM = "*Shoulder:4,12,0 *Arm:13,0,0 *ForeArm:27,0,0 *Hand:25,0,0 *HandIndex1:9,0,0"
_ARM_UP = "*Shoulder:2.6,11.2,0 *Arm:0,10.6,0 *ForeArm:0.3,26,-0.5 *Hand:0.7,25,-0.3 *HandIndex1:0.1,10,2.3"
_LEG = "*UpLeg:9,-3,0 *Leg:0,-42,0 *Foot:0,-41,0 *ToeBase:0,-7,13"
_SPREAD_LEG = "*UpLeg:8,-9,4 *Leg:14,-38,0 *Foot:14,-39,0 *ToeBase:1,-3,13"
XSENS_TREE = _tree(
    "Hips:0,0,0 Chest:0,11,0 Chest2:0,10.5,0 Chest3:0,9.5,0 Chest4:0,9.5,0 Neck:0,13.5,0 Head:0,9,0",
    "*Hip:8.6,0,0 *Knee:0,-37,0 *Ankle:0,-37,0 *Toe:0,-9,15",
    "*Collar:3,7.5,0 *Shoulder:13.7,0,0 *Elbow:26.4,0,0 *Wrist:21.7,0,0",
    "Chest4",
)
MIXAMO_TREE = _tree("Hips:0,0,0 Spine:0,10,0 Spine1:0,12,0 Spine2:0,13,0 Neck:0,15,0 Head:0,10,3", _LEG, _ARM, "Spine2")
ZEROEGGS_TREE = _tree(
    "Hips:0,0,0 Spine:0,8,0 Spine1:0,9,0 Spine2:0,9,0 Spine3:0,9,0 Neck:0,16,0 Neck1:0,5,1 Head:0,5,1",
    _LEG,
    _ARM_UP,
    "Spine3",
)
CMU_21_TREE = _tree("Hips:0,0,0 Spine:0,12,0 Spine1:0,12,0 Neck1:0,10,1 Head:0,10,0", _SPREAD_LEG,
                    "*Arm:18,7,-2 *ForeArm:28,0,0 *Hand:20,0,0 *HandIndex1:4,0,0", "Spine1")  # fmt: skip
SEMI_MST_TREE = _tree("Hips:0,0,0 Spine:0,12,0 Spine1:0,12,0 Neck1:0,10,1 Head:0,10,0", _SPREAD_LEG,
                      "*Shoulder:1,1,0 *Arm:18,7,-2 *ForeArm:28,0,0 *Hand:20,0,0", "Spine1")  # fmt: skip
SMPL_TREE = _tree("pelvis:0,0,0 spine1:0,11,-2 spine2:0,13,0 spine3:0,5,2 neck:0,21,-3 head:0,9,5",
                  "*_hip:6,-8,0 *_knee:4,-38,0 *_ankle:-1,-41,-3 *_foot:3,-6,12",
                  "*_collar:7,12,-1 *_shoulder:11,4,-1 *_elbow:26,-1,-2 *_wrist:25,1,0 *_hand:8,-1,-1",
                  "spine3")  # fmt: skip
LAFAN1_TREE = _tree("Hips:0,0,0 Spine:0,7,0 Spine1:0,12.6,0 Spine2:0,12.3,0 Neck:0,25.7,0 Head:0,11.6,0",
                    "*UpLeg:10.5,0,2 *Leg:0,-43.5,0 *Foot:0,-42.4,0 *Toe:0,-6.3,16.1",
                    "*Shoulder:6,19.5,-1 *Arm:10.8,0,0 *ForeArm:28.7,0,0 *Hand:24,0,0", "Spine2")  # fmt: skip
_CMU_31_STANDING = _tree(
    "Hips:0,0,0 LowerBack:0,0,0 Spine:0,12,-1 Spine1:0,12,0 Neck:0,0,0 Neck1:0,10,1 Head:0,10,-1",
    "*HipJoint:0,0,0 *UpLeg:8,-9,4 *Leg:0,-40.5,0 *Foot:0,-42,0 *ToeBase:1,-3,13",
    "*Shoulder:0,0,0 *Arm:19,7,-2 *ForeArm:28,0,0 *Hand:20,0,0 *FingerBase:0,0,0 *HandIndex1:4,0,0 *Thumb:0,0,0",
    "Spine1",
)
_BANDAI_STANDING = _tree(
    "joint_Root:0,0,0 Hips:0,82,0 Spine:0,10,0 Chest:0,17,0 Neck:0,22,0 Head:0,9,1",
    "*UpLeg:8,-3,0 *Leg:0,-38,0 *Foot:0,-39,0 *Toes:0,-8,10",
    "*Shoulder:3,16,0 *UpperArm:11,0,-3 *LowerArm:24,0,0 *Hand:22,0,0",
    "Chest",
)


def _renamed(standing: Tree, parents: Mapping[str, str | None], names: Mapping[str, str]) -> Tree:
    """Offsets of a standing tree under another tree's names, in that tree's order."""
    offsets = {names.get(name, name): offset for name, (_, offset) in standing.items()}
    return {name: (parent, offsets[name]) for name, parent in parents.items()}


_CMU_NAMES = {"LeftHipJoint": "LHipJoint", "RightHipJoint": "RHipJoint", "LeftThumb": "LThumb", "RightThumb": "RThumb"}
_BANDAI_NAMES = {
    f"{side}{ours}": f"{theirs}_{side[0]}"
    for side in ("Left", "Right")
    for ours, theirs in (("UpLeg", "UpperLeg"), ("Leg", "LowerLeg"), ("Foot", "Foot"), ("Toes", "Toes"),
                         ("Shoulder", "Shoulder"), ("UpperArm", "UpperArm"), ("LowerArm", "LowerArm"),
                         ("Hand", "Hand"))
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class Source:
    """A map, a skeleton that it is for, and what stands before its joint names in files."""

    skeleton_map: SkeletonMap
    tree: Tree
    prefix: str = ""


SOURCES = {
    "bandai-namco": Source(BANDAI_NAMCO, _renamed(_BANDAI_STANDING, BANDAI_NAMCO_TREE, _BANDAI_NAMES)),
    "cmu-31": Source(CMU_31, _renamed(_CMU_31_STANDING, CMU_31_TREE, _CMU_NAMES)),
    "cmu-21": Source(CMU_21, CMU_21_TREE),
    "xsens": Source(XSENS, XSENS_TREE),
    "mixamo": Source(MIXAMO, MIXAMO_TREE, "mixamorig:"),
    "smpl": Source(SMPL, SMPL_TREE),
    "zeroeggs": Source(ZEROEGGS, ZEROEGGS_TREE),
    "lafan1": Source(LAFAN1, LAFAN1_TREE),
    "semi-mst-21": Source(SEMI_MST_21, SEMI_MST_TREE),
}


def on_source(clip: Clip, source: Source, unit_m: float = 0.01) -> BvhMotion:
    """A canonical clip performed by a source skeleton: mapped joints turn as the clip's, others with their parents."""
    names = tuple(source.tree)
    parents = tuple(-1 if parent is None else names.index(parent) for parent, _ in source.tree.values())
    standing = np.array([offset for _, offset in source.tree.values()]) * 0.01 / unit_m
    t_pose, bones = _t_pose_and_bones(source.skeleton_map, names, parents, standing)
    _, world = forward_kinematics(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)
    ours = {theirs: CANONICAL_NAMES.index(name) for name, theirs in source.skeleton_map.joints.items()}
    turns = np.zeros((clip.n_frames, len(names), 4))
    for joint, name in enumerate(names):
        above = parents[joint]
        if name in ours:
            turns[:, joint] = world[:, ours[name]]
        else:
            turns[:, joint] = turns[:, above] if above >= 0 else quat.IDENTITY
    rotations = quat.multiply(turns, t_pose[None])
    local = rotations.copy()
    local[:, 1:] = quat.multiply(quat.conjugate(rotations[:, list(parents[1:])]), rotations[:, 1:])
    with warnings.catch_warnings():
        # At the pole the angles are not unique; any will do.
        warnings.simplefilter("ignore", UserWarning)
        angles = Rotation.from_quat(local.reshape(-1, 4), scalar_first=True).as_euler("ZYX", degrees=True)
    rows = angles.reshape(clip.n_frames, -1)
    channels = tuple(
        tuple(f"{POSITIONS} {ZYX}".split()) if name in (names[0], "Hips") else tuple(ZYX.split()) for name in names
    )
    root = clip.root_xyz_m / unit_m
    if names[0] != source.skeleton_map.joints["Hips"]:
        still = np.zeros_like(root)
        values = np.concatenate([still, rows[:, :3], root, rows[:, 3:]], axis=1)
    else:
        values = np.concatenate([root, rows], axis=1)
    return BvhMotion(tuple(source.prefix + name for name in names), parents, bones, channels, values, 1.0 / clip.fps)


def _t_pose_and_bones(
    skeleton_map: SkeletonMap, names: tuple[str, ...], parents: tuple[int, ...], standing: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """World rotations ``[J, 4]`` in the T-pose, and file offsets ``[J, 3]``."""
    if skeleton_map.zero_pose:
        channels = tuple(("Zrotation",) for _ in names)
        still = BvhMotion(names, parents, standing, channels, np.zeros((1, len(names))), 0.03)
        fit = fitted(still, standing, skeleton_map)
        return np.stack([fit.t_pose_wxyz[name] for name in names]), standing
    t_pose = np.stack([skeleton_map.t_pose_wxyz.get(name, quat.IDENTITY) for name in names])
    bones = standing.copy()
    bones[1:] = quat.rotate(quat.conjugate(t_pose[list(parents[1:])]), standing[1:])
    return t_pose, bones


def write_motion(path: Path, motion: BvhMotion) -> Path:
    """A motion as a BVH file."""
    joints = [
        Joint(name, parent, (float(offset[0]), float(offset[1]), float(offset[2])), " ".join(channels))
        for name, parent, offset, channels in zip(
            motion.names, motion.parents, motion.offsets, motion.channels, strict=True
        )
    ]
    text = text_of(joints, np.round(motion.channel_values, 5).tolist())
    frame_time = next(line for line in text.splitlines() if line.startswith("Frame Time"))
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text.replace(frame_time, f"Frame Time: {motion.frame_time_s:.7f}"))
    return path
