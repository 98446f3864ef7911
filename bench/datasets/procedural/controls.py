"""Controls of a body over time, and the pose they mean: two-bone legs onto footprints, jointed trunk and arms."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d, maximum_filter1d

from bench.arrays import FloatArray
from bench.datasets.procedural.actors import Actor
from bench.motion import quat
from bench.motion.skeleton import (
    HEAD,
    LEFT_ARM,
    LEFT_TOE,
    LEFT_UP_LEG,
    N_JOINTS,
    NECK,
    RIGHT_ARM,
    RIGHT_TOE,
    RIGHT_UP_LEG,
    SPINE,
    SPINE1,
)

LEFT, RIGHT = 0, 1
FLEXION, ABDUCTION, TWIST, ELBOW, WRIST, CURL = range(6)
PITCH, SIDE, TURN = range(3)
FULL_REACH = 0.992
"""Legs never stretch beyond this share of their length, so that the knee never locks."""
EASE_FRAMES = 4
_X, _Y, _Z = np.eye(3)


@dataclass(eq=False)
class Controls:
    """What a body does at each of T frames, in a frame where the action faces +Z. Side axis: left, right.

    Attributes
    ----------
    pelvis_m : ``[T, 3]`` wanted position of the hips; lowered where a planted foot could not be reached.
    pelvis_rad, spine_rad, head_rad : ``[T, 3]`` pitch (forward), side (left side up), turn (to the left). The spine's
        is shared by two joints, the head's by neck and head.
    arms_rad : ``[T, 2, 6]`` flexion (forward), abduction, inward twist, elbow, wrist, finger curl.
    ankles_m : ``[T, 2, 3]`` where the ankle would be if the foot were flat.
    feet_rad : ``[T, 2, 3]`` pitch (heel up), side (unused, 0), turn.
    pivot : ``[T, 2]`` 1 where the foot pitches about its toe, 0 about its ankle.
    swing : ``[T, 2]`` 0 where the foot bears weight; up to 1 in the air.
    """

    pelvis_m: FloatArray
    pelvis_rad: FloatArray
    spine_rad: FloatArray
    head_rad: FloatArray
    arms_rad: FloatArray
    ankles_m: FloatArray
    feet_rad: FloatArray
    pivot: FloatArray
    swing: FloatArray


def mirrored(controls: Controls) -> Controls:
    """The same action done with the other side of the body."""
    flip_x, flip_turns = np.array([-1.0, 1.0, 1.0]), np.array([1.0, -1.0, -1.0])
    return Controls(
        controls.pelvis_m * flip_x,
        controls.pelvis_rad * flip_turns,
        controls.spine_rad * flip_turns,
        controls.head_rad * flip_turns,
        controls.arms_rad[:, ::-1],
        controls.ankles_m[:, ::-1] * flip_x,
        controls.feet_rad[:, ::-1] * flip_turns,
        controls.pivot[:, ::-1],
        controls.swing[:, ::-1],
    )


def turned(controls: Controls, heading_rad: float) -> Controls:
    """The same action facing another way."""
    turn, add = quat.about_y(heading_rad), np.array([0.0, 0.0, heading_rad])
    return Controls(
        quat.rotate(turn, controls.pelvis_m),
        controls.pelvis_rad + add,
        controls.spine_rad,
        controls.head_rad,
        controls.arms_rad,
        quat.rotate(turn, controls.ankles_m),
        controls.feet_rad + add,
        controls.pivot,
        controls.swing,
    )


def pose(controls: Controls, actor: Actor) -> tuple[FloatArray, FloatArray]:
    """Local rotations ``[T, 21, 4]`` and root path ``[T, 3]`` of the actor under these controls."""
    rotations = np.zeros((len(controls.pelvis_m), N_JOINTS, 4))
    rotations[..., 0] = 1.0
    pelvis = _turn_pitch_side(controls.pelvis_rad)
    feet, ankles = _feet(controls, actor)
    root = _reachable_root(controls, actor, pelvis, ankles)
    rotations[:, 0] = pelvis
    for side, joint in ((LEFT, LEFT_UP_LEG), (RIGHT, RIGHT_UP_LEG)):
        offset = actor.skeleton.offsets_m[joint]
        hip = root + quat.rotate(pelvis, offset)
        _leg(rotations, joint, pelvis, ankles[:, side] - hip, feet[:, side], actor)
    rotations[:, SPINE] = _turn_pitch_side(0.45 * controls.spine_rad)
    rotations[:, SPINE1] = _turn_pitch_side(0.55 * controls.spine_rad)
    rotations[:, NECK] = _turn_pitch_side(0.5 * controls.head_rad)
    rotations[:, HEAD] = _turn_pitch_side(0.5 * controls.head_rad)
    _arm(rotations, LEFT_ARM, controls.arms_rad[:, LEFT], 1.0)
    _arm(rotations, RIGHT_ARM, controls.arms_rad[:, RIGHT], -1.0)
    # The toes' own rotation keeps them flat on the ground while the heel rises.
    for side, joint in ((LEFT, LEFT_TOE), (RIGHT, RIGHT_TOE)):
        rotations[:, joint] = quat.from_axis_angle(_X, -0.8 * np.clip(controls.feet_rad[:, side, PITCH], 0.0, None))
    return quat.continuous(rotations), root


def _turn_pitch_side(angles_rad: FloatArray) -> FloatArray:
    turn = quat.about_y(angles_rad[:, TURN])
    pitch = quat.from_axis_angle(_X, angles_rad[:, PITCH])
    return quat.multiply(turn, quat.multiply(pitch, quat.from_axis_angle(_Z, angles_rad[:, SIDE])))


def _feet(controls: Controls, actor: Actor) -> tuple[FloatArray, FloatArray]:
    """World rotations ``[T, 2, 4]`` of the feet and positions ``[T, 2, 3]`` of the ankles."""
    turn = quat.about_y(controls.feet_rad[..., TURN])
    feet = quat.multiply(turn, quat.from_axis_angle(_X, controls.feet_rad[..., PITCH]))
    to_toe = actor.skeleton.offsets_m[[LEFT_TOE, RIGHT_TOE]]
    about_toe = quat.rotate(turn, to_toe) - quat.rotate(feet, to_toe)
    return feet, controls.ankles_m + controls.pivot[..., None] * about_toe


def _reachable_root(controls: Controls, actor: Actor, pelvis: FloatArray, ankles: FloatArray) -> FloatArray:
    """Lower the pelvis to where both feet that bear weight can be reached, beginning and ending some frames around it.

    The largest drop within ``EASE_FRAMES`` is averaged over as many frames, so the result is smooth in time and never
    above what can be reached.
    """
    hips = quat.rotate(pelvis[:, None], actor.skeleton.offsets_m[[LEFT_UP_LEG, RIGHT_UP_LEG]])
    away = ankles - controls.pelvis_m[:, None] - hips
    reach = FULL_REACH * actor.leg_m
    across = np.minimum(np.hypot(away[..., 0], away[..., 2]), 0.98 * reach)
    highest = ankles[..., 1] - hips[..., 1] + np.sqrt(reach**2 - across**2) + 0.5 * controls.swing
    softness_m = 0.006
    heights = np.concatenate([controls.pelvis_m[:, 1:2], highest], axis=1)
    lowest = heights.min(axis=1, keepdims=True)
    soft = lowest[:, 0] - softness_m * np.log(np.exp((lowest - heights) / softness_m).sum(axis=1))
    drop = maximum_filter1d(controls.pelvis_m[:, 1] - soft, 2 * EASE_FRAMES + 1, mode="nearest")
    root = controls.pelvis_m.copy()
    root[:, 1] -= gaussian_filter1d(drop, 0.5 * EASE_FRAMES, radius=EASE_FRAMES, mode="nearest")
    return root


def _leg(
    rotations: FloatArray, joint: int, pelvis: FloatArray, to_ankle: FloatArray, foot: FloatArray, actor: Actor
) -> None:
    """Two-bone inverse kinematics; the knee's hinge lies across, between where pelvis and foot face."""
    thigh, shank = actor.thigh_m, actor.shank_m
    distance = np.linalg.norm(to_ankle, axis=1, keepdims=True)
    along = to_ankle / distance
    distance = np.clip(distance, abs(thigh - shank) + 0.05 * thigh, 0.9995 * (thigh + shank))
    across = quat.rotate(pelvis, _X) + 0.6 * quat.rotate(foot, _X)
    across -= along * np.sum(along * across, axis=1, keepdims=True)
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    ahead = np.cross(along, across)
    cos_hip = (thigh**2 + distance**2 - shank**2) / (2.0 * thigh * distance)
    sin_hip = np.sqrt(1.0 - cos_hip**2)
    thigh_way = cos_hip * along + sin_hip * ahead
    shank_way = (distance * along - thigh * thigh_way) / shank
    upper, lower = _bone_frame(across, thigh_way), _bone_frame(across, shank_way)
    rotations[:, joint] = quat.multiply(quat.conjugate(pelvis), upper)
    rotations[:, joint + 1] = quat.multiply(quat.conjugate(upper), lower)
    rotations[:, joint + 2] = quat.multiply(quat.conjugate(lower), foot)


def _bone_frame(across: FloatArray, way: FloatArray) -> FloatArray:
    """World rotation that takes +X to ``across`` and straight down to ``way`` (orthogonal unit vectors)."""
    return quat.from_matrix(np.stack([across, -way, np.cross(across, -way)], axis=-1))


def _arm(rotations: FloatArray, joint: int, angles_rad: FloatArray, sign: float) -> None:
    """Upper arm from hanging: abduct, then flex about the chest's axis across; elbow, wrist and finger are hinges."""
    hang = quat.from_axis_angle(_Z, -sign * np.pi / 2.0)
    flex = quat.from_axis_angle(_X, -angles_rad[:, FLEXION])
    abduct = quat.from_axis_angle(_Z, sign * angles_rad[:, ABDUCTION])
    twist = quat.about_y(-sign * angles_rad[:, TWIST])
    rotations[:, joint] = quat.multiply(quat.multiply(flex, abduct), quat.multiply(twist, hang))
    rotations[:, joint + 1] = quat.about_y(-sign * np.clip(angles_rad[:, ELBOW], 0.03, 2.6))
    rotations[:, joint + 2] = quat.from_axis_angle(_Z, -sign * angles_rad[:, WRIST])
    rotations[:, joint + 3] = quat.from_axis_angle(_Z, -sign * angles_rad[:, CURL])
