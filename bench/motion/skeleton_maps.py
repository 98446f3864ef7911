"""Joint maps from known source skeletons to the canonical 21 joints.

A map says which source joint plays which canonical joint, and how every source joint would be turned in the canonical
T-pose (Y up, facing +Z, left arm along +X). Source frames are described by where their own x and y axes point in that
T-pose, which can be read off a standing pose:

Bandai-Namco. Bones run along local x (left) or -x (right), so zero rotations mean nothing. The mean world rotation of
each joint over standing and walking takes, turned to the facing frame, lies within a few degrees of a signed
permutation of the axes on the trunk and legs; arms hang there and are raised by a quarter turn about the facing axis,
palms down. Feet keep the pitch that they have in quiet standing (40 degrees, toes 22). The dropped shoulders keep their
mean direction, 18 degrees back, made symmetric.

CMU, 31 joints (the topology of Park 2021, Motion Puzzle and Style-ERD). Zero rotations are a T-pose but for the legs,
which are spread by 20 degrees. The dropped hip joints turn the upper legs' roots by 10 degrees in every
take of Xia 2015, the dropped shoulders by 7 degrees to the back on average.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadConfig
from bench.motion import quat
from bench.motion.skeleton import CANONICAL_NAMES

RIGHT, LEFT = (-1.0, 0.0, 0.0), (1.0, 0.0, 0.0)
DOWN, UP = (0.0, -1.0, 0.0), (0.0, 1.0, 0.0)
BACK, FORWARD = (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)
Direction = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class SkeletonMap:
    """How a source skeleton becomes the canonical one.

    Attributes
    ----------
    name : for messages.
    joints : canonical name -> source joint; a canonical joint that is not listed is virtual.
    t_pose_wxyz : source joint -> its world rotation ``[4]`` in the canonical T-pose; identity if not listed. Joints
        that have no canonical counterpart count too: they place the joints below them.
    virtual_offsets_m : canonical name -> ``[3]`` T-pose offset of a virtual joint from its canonical parent, metres.
    zero_pose : True where all rotations zero is a standing pose, from which ``t_pose_wxyz`` is read file by file (see
        :mod:`bench.motion.zero_pose`).

    Raises
    ------
    BadConfig : names that are not canonical, or a joint that is neither mapped nor virtual.
    """

    name: str
    joints: Mapping[str, str]
    t_pose_wxyz: Mapping[str, FloatArray] = field(default_factory=dict)
    virtual_offsets_m: Mapping[str, Direction] = field(default_factory=dict)
    zero_pose: bool = False

    def __post_init__(self) -> None:
        listed = [*self.joints, *self.virtual_offsets_m]
        if sorted(listed) != sorted(CANONICAL_NAMES):
            wrong = sorted(set(listed) ^ set(CANONICAL_NAMES)) or sorted({j for j in listed if listed.count(j) > 1})
            raise BadConfig(f"each canonical joint must be mapped or virtual, once; see {wrong}", where=self.name)
        if "Hips" not in self.joints:
            raise BadConfig("Hips cannot be virtual", where=self.name)


def axes(x: Direction, y: Direction) -> FloatArray:
    """The rotation ``[4]`` that turns the x and y axes to the two given unit directions, which are perpendicular."""
    return quat.from_matrix(np.stack([x, y, np.cross(x, y)], axis=1))


def turn(axis: Direction, degrees: float) -> FloatArray:
    """The rotation ``[4]`` by ``degrees`` about a unit ``axis``."""
    return quat.from_axis_angle(np.asarray(axis), np.radians(degrees))


def pitched(degrees: float, sign: float) -> Direction:
    """``sign`` times the forward direction tipped down by ``degrees``."""
    return (0.0, -sign * float(np.sin(np.radians(degrees))), sign * float(np.cos(np.radians(degrees))))


_TRUNK = axes(x=UP, y=FORWARD)
_RIGHT_ARM = axes(x=LEFT, y=DOWN)
_FINGER_M = 0.08

BANDAI_NAMCO = SkeletonMap(
    name="bandai-namco",
    joints={
        "Hips": "Hips",
        "LeftUpLeg": "UpperLeg_L",
        "LeftLeg": "LowerLeg_L",
        "LeftFoot": "Foot_L",
        "LeftToeBase": "Toes_L",
        "RightUpLeg": "UpperLeg_R",
        "RightLeg": "LowerLeg_R",
        "RightFoot": "Foot_R",
        "RightToeBase": "Toes_R",
        "Spine": "Spine",
        "Spine1": "Chest",
        "Neck1": "Neck",
        "Head": "Head",
        "LeftArm": "UpperArm_L",
        "LeftForeArm": "LowerArm_L",
        "LeftHand": "Hand_L",
        "RightArm": "UpperArm_R",
        "RightForeArm": "LowerArm_R",
        "RightHand": "Hand_R",
    },
    t_pose_wxyz={
        "Hips": axes(x=UP, y=RIGHT),
        "Spine": _TRUNK,
        "Chest": _TRUNK,
        "Neck": _TRUNK,
        "Head": _TRUNK,
        "Shoulder_L": turn(UP, 18.0),
        "Shoulder_R": quat.multiply(turn(UP, -18.0), _RIGHT_ARM),
        "UpperArm_R": _RIGHT_ARM,
        "LowerArm_R": _RIGHT_ARM,
        "Hand_R": _RIGHT_ARM,
        "UpperLeg_L": axes(x=DOWN, y=LEFT),
        "LowerLeg_L": axes(x=DOWN, y=LEFT),
        "Foot_L": axes(x=pitched(40.0, 1.0), y=LEFT),
        "Toes_L": axes(x=pitched(22.0, 1.0), y=LEFT),
        "UpperLeg_R": axes(x=UP, y=LEFT),
        "LowerLeg_R": axes(x=UP, y=LEFT),
        "Foot_R": axes(x=pitched(40.0, -1.0), y=LEFT),
        "Toes_R": axes(x=pitched(22.0, -1.0), y=LEFT),
    },
    virtual_offsets_m={"LeftHandIndex1": (_FINGER_M, 0.0, 0.0), "RightHandIndex1": (-_FINGER_M, 0.0, 0.0)},
)

CMU_31 = SkeletonMap(
    name="cmu-31",
    joints={name: name for name in CANONICAL_NAMES},
    t_pose_wxyz={
        "LHipJoint": turn(FORWARD, -10.0),
        "RHipJoint": turn(FORWARD, 10.0),
        "LeftShoulder": turn(UP, 7.0),
        "RightShoulder": turn(UP, -7.0),
        "LeftUpLeg": turn(FORWARD, -20.0),
        "LeftLeg": turn(FORWARD, -20.0),
        "RightUpLeg": turn(FORWARD, 20.0),
        "RightLeg": turn(FORWARD, 20.0),
    },
)
CMU_UNIT_M = 0.056444
"""Metres in a unit of the CMU files (Semi-MST divides by 5.6444 to go from centimetres to them)."""
