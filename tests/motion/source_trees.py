"""The joints of source skeletons, each with its parent, in file order."""

from __future__ import annotations

BANDAI_NAMCO_TREE: dict[str, str | None] = {
    "joint_Root": None, "Hips": "joint_Root", "Spine": "Hips", "Chest": "Spine", "Neck": "Chest", "Head": "Neck",
    "Shoulder_L": "Chest", "UpperArm_L": "Shoulder_L", "LowerArm_L": "UpperArm_L", "Hand_L": "LowerArm_L",
    "Shoulder_R": "Chest", "UpperArm_R": "Shoulder_R", "LowerArm_R": "UpperArm_R", "Hand_R": "LowerArm_R",
    "UpperLeg_L": "Hips", "LowerLeg_L": "UpperLeg_L", "Foot_L": "LowerLeg_L", "Toes_L": "Foot_L",
    "UpperLeg_R": "Hips", "LowerLeg_R": "UpperLeg_R", "Foot_R": "LowerLeg_R", "Toes_R": "Foot_R",
}  # fmt: skip
CMU_31_TREE: dict[str, str | None] = {
    "Hips": None, "LHipJoint": "Hips", "LeftUpLeg": "LHipJoint", "LeftLeg": "LeftUpLeg", "LeftFoot": "LeftLeg",
    "LeftToeBase": "LeftFoot", "RHipJoint": "Hips", "RightUpLeg": "RHipJoint", "RightLeg": "RightUpLeg",
    "RightFoot": "RightLeg", "RightToeBase": "RightFoot", "LowerBack": "Hips", "Spine": "LowerBack", "Spine1": "Spine",
    "Neck": "Spine1", "Neck1": "Neck", "Head": "Neck1", "LeftShoulder": "Spine1", "LeftArm": "LeftShoulder",
    "LeftForeArm": "LeftArm", "LeftHand": "LeftForeArm", "LeftFingerBase": "LeftHand",
    "LeftHandIndex1": "LeftFingerBase", "LThumb": "LeftHand", "RightShoulder": "Spine1", "RightArm": "RightShoulder",
    "RightForeArm": "RightArm", "RightHand": "RightForeArm", "RightFingerBase": "RightHand",
    "RightHandIndex1": "RightFingerBase", "RThumb": "RightHand",
}  # fmt: skip
