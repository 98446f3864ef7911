"""Joint maps of the skeletons that motion files come on, beside those of :mod:`bench.motion.skeleton_maps`.

Most stand in their zero pose, so names are enough: Xsens MVN (100STYLE; wrist, toe and head sites are End Sites),
Mixamo (joint names may carry a prefix such as ``mixamorig:``), SMPL with 22 or 24 joints, ZeroEGGS, and CMU cuts with
21 joints: this benchmark's own and Semi-MST's, which keeps clavicles and drops fingers.

LAFAN1 (Harvey et al. 2020). Bones run along local x on both sides, so zero rotations mean nothing. Hips: x up, y ahead;
legs: x down, y ahead; feet tip by 21.5 degrees so that toes lie flat; shoulders and arms: x outwards, y back.

Where a chain has three or four spine joints, the second plays Spine and the last, which carries neck and arms, Spine1.
"""

from __future__ import annotations

from bench.motion.skeleton_maps import (
    BACK,
    BANDAI_NAMCO,
    CMU_31,
    DOWN,
    FORWARD,
    LEFT,
    RIGHT,
    UP,
    SkeletonMap,
    axes,
    pitched,
)

FINGERS_M = {"LeftHandIndex1": (0.08, 0.0, 0.0), "RightHandIndex1": (-0.08, 0.0, 0.0)}
"""Where virtual fingers are, from the hands."""


def _both_sides(joints: dict[str, str], left: str, right: str) -> dict[str, str]:
    """Canonical names without side -> source names with ``*`` for the side."""
    sides = (("Left", left), ("Right", right))
    return {f"{ours}{joint}": source.replace("*", theirs) for ours, theirs in sides for joint, source in joints.items()}


_LIMBS = {
    "UpLeg": "*UpLeg", "Leg": "*Leg", "Foot": "*Foot", "ToeBase": "*ToeBase",
    "Arm": "*Arm", "ForeArm": "*ForeArm", "Hand": "*Hand",
}  # fmt: skip
_SMPL_LIMBS = {
    "UpLeg": "*_hip", "Leg": "*_knee", "Foot": "*_ankle", "ToeBase": "*_foot",
    "Arm": "*_shoulder", "ForeArm": "*_elbow", "Hand": "*_wrist",
}  # fmt: skip
_FINGER = {"HandIndex1": "*HandIndex1"}

XSENS = SkeletonMap(
    name="xsens",
    joints={
        "Hips": "Hips",
        "Spine": "Chest2",
        "Spine1": "Chest4",
        "Neck1": "Neck",
        "Head": "Head",
        **_both_sides(
            {
                "UpLeg": "*Hip",
                "Leg": "*Knee",
                "Foot": "*Ankle",
                "ToeBase": "*Toe",
                "Arm": "*Shoulder",
                "ForeArm": "*Elbow",
                "Hand": "*Wrist",
            },
            "Left",
            "Right",
        ),
    },
    virtual_offsets_m=FINGERS_M,
    zero_pose=True,
)
_MIXAMO_TRUNK = {"Hips": "Hips", "Spine": "Spine1", "Spine1": "Spine2", "Neck1": "Neck", "Head": "Head"}
MIXAMO = SkeletonMap(
    name="mixamo",
    joints={**_MIXAMO_TRUNK, **_both_sides(_LIMBS | _FINGER, "Left", "Right")},
    zero_pose=True,
)
MIXAMO_NO_FINGERS = SkeletonMap(
    name="mixamo without fingers",
    joints={**_MIXAMO_TRUNK, **_both_sides(_LIMBS, "Left", "Right")},
    virtual_offsets_m=FINGERS_M,
    zero_pose=True,
)
ZEROEGGS = SkeletonMap(
    name="zeroeggs",
    joints={
        "Hips": "Hips",
        "Spine": "Spine1",
        "Spine1": "Spine3",
        "Neck1": "Neck1",
        "Head": "Head",
        **_both_sides(_LIMBS | _FINGER, "Left", "Right"),
    },
    zero_pose=True,
)
_CMU_TRUNK = {"Hips": "Hips", "Spine": "Spine", "Spine1": "Spine1", "Neck1": "Neck1", "Head": "Head"}
CMU_21 = SkeletonMap(
    name="cmu-21",
    joints={**_CMU_TRUNK, **_both_sides(_LIMBS | _FINGER, "Left", "Right")},
    zero_pose=True,
)
SEMI_MST_21 = SkeletonMap(
    name="semi-mst-21",
    joints={**_CMU_TRUNK, **_both_sides(_LIMBS, "Left", "Right")},
    virtual_offsets_m=FINGERS_M,
    zero_pose=True,
)
SMPL = SkeletonMap(
    name="smpl",
    joints={
        "Hips": "pelvis",
        "Spine": "spine2",
        "Spine1": "spine3",
        "Neck1": "neck",
        "Head": "head",
        **_both_sides(_SMPL_LIMBS, "left", "right"),
    },
    virtual_offsets_m=FINGERS_M,
    zero_pose=True,
)
SMPL_SHORT_NAMES = SkeletonMap(
    name="smpl with short names",
    joints={
        "Hips": "Pelvis",
        "Spine": "Spine2",
        "Spine1": "Spine3",
        "Neck1": "Neck",
        "Head": "Head",
        **_both_sides({ours: source.title() for ours, source in _SMPL_LIMBS.items()}, "L", "R"),
    },
    virtual_offsets_m=FINGERS_M,
    zero_pose=True,
)
_LAFAN_TRUNK, _LAFAN_LEG = axes(x=UP, y=FORWARD), axes(x=DOWN, y=FORWARD)
_LAFAN_FOOT = axes(x=pitched(21.5, 1.0), y=pitched(21.5 - 90.0, 1.0))
_LAFAN_TOE = axes(x=FORWARD, y=UP)
LAFAN1 = SkeletonMap(
    name="lafan1",
    joints={**_MIXAMO_TRUNK, **_both_sides(_LIMBS | {"ToeBase": "*Toe"}, "Left", "Right")},
    t_pose_wxyz={
        **dict.fromkeys(("Hips", "Spine", "Spine1", "Spine2", "Neck", "Head"), _LAFAN_TRUNK),
        **{
            f"{side}{joint}": rotation
            for side, outwards in (("Left", LEFT), ("Right", RIGHT))
            for joint, rotation in (
                ("UpLeg", _LAFAN_LEG),
                ("Leg", _LAFAN_LEG),
                ("Foot", _LAFAN_FOOT),
                ("Toe", _LAFAN_TOE),
                *((name, axes(x=outwards, y=BACK)) for name in ("Shoulder", "Arm", "ForeArm", "Hand")),
            )
        },
    },
    virtual_offsets_m=FINGERS_M,
)

KNOWN_SKELETONS = {
    skeleton_map.name: skeleton_map
    for skeleton_map in (
        BANDAI_NAMCO, CMU_31, XSENS, ZEROEGGS, LAFAN1, MIXAMO, MIXAMO_NO_FINGERS, CMU_21, SEMI_MST_21, SMPL,
        SMPL_SHORT_NAMES,
    )
}  # fmt: skip
"""Name -> map, in the order in which they are tried."""
