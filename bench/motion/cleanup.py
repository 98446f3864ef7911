"""Foot-skate removal by inverse kinematics: the post-processing behind the papers' numbers, with their settings.

All three take the source's foot contacts, move each planted foot joint to its average position in the contact (Motion
Puzzle 2022, section 7.2.3), blend over some frames before and after, and solve by a damped Jacobian with 10
iterations. Their code works at 30 or 60 fps in units of 5.6444 cm; here everything is in metres and seconds:

    speed = root(squared displacement a frame) x 0.056444 x fps     damping = damping x 0.056444     time = frames / fps

What differs from the released code, for all three alike: only hip, knee and ankle turn (theirs moves all joints
towards where they were); contacts are looked for in the world frame (Park's copy looks in a frame that moves with the
root, where a planted foot travels at walking speed); around a contact the correction fades, not the position, so that
a swinging foot is not held back; a foot of which one joint is planted moves as a whole; the body is not moved to the
floor, and only planted toes are put on it where the settings say so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray
from bench.errors import BadInput, BadMotion
from bench.motion import _ik_kernels
from bench.motion.clip import Clip
from bench.motion.kinematics import FOOT_JOINTS, forward_kinematics, velocities, world_positions
from bench.motion.skeleton import HIPS, LEFT_FOOT, LEFT_LEG, LEFT_TOE, LEFT_UP_LEG

UNIT_M = 0.056444
"""Length unit of the processed CMU and Xia data."""
SOFTNESS_M = 0.01
LEGS = ((LEFT_UP_LEG, LEFT_LEG, LEFT_FOOT, LEFT_TOE), (5, 6, 7, 8))


@dataclass(frozen=True)
class IkSettings:
    """One way to remove foot skate.

    Attributes
    ----------
    name, title : as suffix of a row's name and title.
    blend_s : seconds over which a correction fades in before and out after a contact.
    damping_m : added to the Jacobian's singular values; larger is smoother and farther from the target.
    iterations : steps of the solver.
    max_speed_m_s : a foot joint is planted where the source's is slower ...
    max_height_m : ... and lower than this over the floor, ankle and toe; None where height does not count.
    on_floor : planted toes are put on the floor, else they stay at their average height.
    """

    name: str
    title: str
    blend_s: float
    damping_m: float
    iterations: int
    max_speed_m_s: float
    max_height_m: tuple[float, float] | None
    on_floor: bool


def _speed(squared_displacement: float, fps: float) -> float:
    return float(np.sqrt(squared_displacement) * UNIT_M * fps)


ABERMAN_IK = IkSettings("aberman-ik", "Aberman IK", 5 / 30, 4.0 * UNIT_M, 10, _speed(0.05, 30), None, on_floor=True)
"""Aberman 2020, released code: 5 frames at 30 fps, damping 4, 0.38 m/s."""
PARK_IK = IkSettings("park-ik", "Park IK", 15 / 30, 2.0 * UNIT_M, 10, _speed(0.05, 30), None, on_floor=False)
"""Park 2021, released code: 15 frames at 30 fps, damping 2, 0.38 m/s."""
PUZZLE_IK = IkSettings(
    "puzzle-ik", "Motion Puzzle IK", 10 / 60, 5.0 * UNIT_M, 10, _speed(0.05, 60), (3.0 * UNIT_M, 2.0 * UNIT_M), False
)
"""Motion Puzzle 2022, released code: 10 frames at 60 fps, damping 5, 0.76 m/s, ankle under 16.9, toe under 11.3 cm."""

IK_SETTINGS: dict[str, IkSettings] = {settings.name: settings for settings in (ABERMAN_IK, PARK_IK, PUZZLE_IK)}


def planted_feet(clip: Clip, settings: IkSettings) -> BoolArray:
    """Which foot joints stand, ``[T, 4]`` in the order of ``FOOT_JOINTS``.

    Raises
    ------
    BadMotion : not the canonical 21 joints.
    """
    feet = _canonical(clip)[:, FOOT_JOINTS]
    planted = np.linalg.norm(velocities(feet, clip.fps), axis=-1) < settings.max_speed_m_s
    if settings.max_height_m is not None:
        planted &= feet[..., 1] - soft_floor(feet) < np.tile(settings.max_height_m, 2)
    return np.asarray(planted)


def soft_floor(feet_m: FloatArray) -> float:
    """Soft minimum over time of the height of the lowest foot joint of ``[T, F, 3]``, metres."""
    heights = feet_m[..., 1].min(axis=1)
    lowest = float(heights.min())
    return lowest - SOFTNESS_M * float(np.log(np.exp((lowest - heights) / SOFTNESS_M).mean()))


def remove_foot_skate(clip: Clip, settings: IkSettings, planted: BoolArray | None = None) -> Clip:
    """The clip with planted feet held still; everything but the legs' rotations stays as it is.

    Parameters
    ----------
    clip : canonical joints.
    planted : ``[T, 4]`` contacts of the source, see :func:`planted_feet`; by default those of the clip itself.

    Raises
    ------
    BadMotion : not the canonical 21 joints.
    BadInput : contacts of another shape.
    """
    positions = _canonical(clip)
    contacts = planted_feet(clip, settings) if planted is None else np.asarray(planted, dtype=bool)
    if contacts.shape != (clip.n_frames, len(FOOT_JOINTS)):
        raise BadInput(f"planted must have shape [{clip.n_frames}, 4], got {list(contacts.shape)}", where="planted")
    feet = positions[:, FOOT_JOINTS]
    floor = soft_floor(feet) if settings.on_floor else None
    shift = _corrections(feet, contacts, max(round(settings.blend_s * clip.fps), 0), floor)
    world_rotations = forward_kinematics(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)[1]
    rotations = clip.rotations_wxyz.copy()
    for side, leg in enumerate(LEGS):
        joints = list(leg[:3])
        turned = np.ascontiguousarray(rotations[:, joints])
        wanted = shift[:, 2 * side : 2 * side + 2]
        _ik_kernels.solve_legs(
            turned,
            np.ascontiguousarray(positions[:, leg[0]]),
            np.ascontiguousarray(world_rotations[:, HIPS]),
            np.ascontiguousarray(clip.skeleton.offsets_m[list(leg[1:])]),
            np.ascontiguousarray(positions[:, leg[2:]] + wanted),
            np.abs(wanted).max(axis=(1, 2)) > 0.0,
            settings.iterations,
            settings.damping_m,
        )
        rotations[:, joints] = turned
    return clip.with_motion(rotations, clip.root_xyz_m)


def _corrections(feet: FloatArray, contacts: BoolArray, n_blend: int, floor_m: float | None) -> FloatArray:
    """How far each foot joint is to be moved, ``[T, 4, 3]``: zero away from contacts."""
    faded, weights = np.empty_like(feet), np.empty(contacts.shape)
    for joint in range(contacts.shape[1]):
        on_floor = floor_m if joint % 2 else None
        faded[:, joint], weights[:, joint] = _joint_corrections(feet[:, joint], contacts[:, joint], n_blend, on_floor)
    partner = [1, 0, 3, 2]
    return np.asarray(faded + (1.0 - weights)[..., None] * faded[:, partner])


def _joint_corrections(
    path: FloatArray, contact: BoolArray, n_blend: int, floor_m: float | None
) -> tuple[FloatArray, FloatArray]:
    """Faded corrections ``[T, 3]`` of one foot joint and the share ``[T]`` of the contacts in each frame."""
    n_frames = len(path)
    held = np.zeros_like(path)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], contact.astype(np.int8), [0]])))
    for start, end in edges.reshape(-1, 2):
        place = path[start:end].mean(axis=0)
        if floor_m is not None:
            place[1] = floor_m
        held[start:end] = place - path[start:end]
    frames = np.arange(n_frames)
    before = np.maximum.accumulate(np.where(contact, frames, -n_frames))
    after = np.minimum.accumulate(np.where(contact, frames, 2 * n_frames)[::-1])[::-1]
    from_before, from_after = _fading(frames - before, n_blend), _fading(after - frames, n_blend)
    weight = np.maximum(from_before, from_after)
    total = np.where(weight > 0.0, from_before + from_after, 1.0)
    mixed = (
        from_before[:, None] * held[np.clip(before, 0, n_frames - 1)]
        + from_after[:, None] * held[np.clip(after, 0, n_frames - 1)]
    ) / total[:, None]
    return weight[:, None] * mixed, weight


def _fading(distance_frames: NDArray[np.signedinteger[Any]], n_blend: int) -> FloatArray:
    """1 in a contact, smoothly 0 from ``n_blend + 1`` frames away."""
    share = np.clip(distance_frames / (n_blend + 1.0), 0.0, 1.0)
    return np.asarray(1.0 - share * share * (3.0 - 2.0 * share))


def _canonical(clip: Clip) -> FloatArray:
    if not clip.skeleton.is_canonical:
        raise BadMotion("foot-skate removal is defined on the canonical 21 joints", remedy="retarget the clip first")
    return world_positions(clip)
