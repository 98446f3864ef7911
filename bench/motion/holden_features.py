"""Holden 2016's pose features: joint positions over the ground path of the body, that path as velocities, contacts.

Lengths are in 1/28 of the stature, which on the paper's skeleton is its own unit of 5.64 cm, so that bodies of all
sizes look alike. Velocities are per frame. The path is that of a *reference joint* on the ground under the hips.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.errors import BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.fit_rotations import fit_rotations
from bench.motion.kinematics import FOOT_JOINTS, facing_yaw, floor_height, smooth_yaw, world_positions
from bench.motion.skeleton import N_JOINTS

UNITS_PER_STATURE = 28.0
N_FEATURES = 3 * (N_JOINTS + 1) + 3 + len(FOOT_JOINTS)
"""73: the reference joint and 21 others, velocities, contacts."""

HOLDEN_SLICES = {
    "position_units": slice(0, 66),
    "velocity_xz": slice(66, 68),
    "yaw_velocity": slice(68, 69),
    "contacts": slice(69, 73),
}
"""Channels of a frame; positions begin with the reference joint, contacts are left foot, toe, right foot, toe."""

FACING_SMOOTHING_S = 20.0 / 60.0
PATH_SMOOTHING_S = 3.0 / 60.0
CONTACT_UNITS_S = 60.0 * 0.05**0.5
"""A foot is slower than this where it stands; the released code tests the squared step of a 60 fps frame."""
CONTACT_HEIGHTS_UNITS = np.array([3.0, 2.0, 3.0, 2.0])


@dataclass(frozen=True, eq=False)
class HoldenStart:
    """What the features leave out: where the path begins, how high the floor is, how long a unit is."""

    xz_m: FloatArray
    yaw_rad: float
    floor_m: float
    unit_m: float


def holden_features(clip: Clip) -> tuple[FloatArray, HoldenStart]:
    """Features ``[T, 73]``, slices in ``HOLDEN_SLICES``, and what they leave out.

    The velocity of the last frame repeats the one before it; a single frame stands still.
    """
    if not clip.skeleton.is_canonical:
        raise BadMotion("features are defined on the canonical 21 joints", remedy="retarget the clip first")
    unit_m = clip.skeleton.stature_m / UNITS_PER_STATURE
    world = world_positions(clip)
    floor_m = floor_height(world)
    yaw = smooth_yaw(facing_yaw(world), FACING_SMOOTHING_S * clip.fps)
    path = _smooth(world[:, 0, [0, 2]], PATH_SMOOTHING_S * clip.fps)
    reference = np.stack([path[:, 0], np.full(len(path), floor_m), path[:, 1]], axis=-1)
    positions = np.concatenate([np.zeros_like(reference)[:, None], world - reference[:, None]], axis=1)
    local = quat.rotate(quat.about_y(-yaw)[:, None], positions) / unit_m
    step = np.zeros_like(reference)
    step[:-1] = quat.rotate(quat.about_y(-yaw[1:]), np.diff(reference, axis=0)) / unit_m
    turn = np.append(np.diff(yaw), 0.0)
    if clip.n_frames > 1:
        step[-1], turn[-1] = step[-2], turn[-2]
    parts = [local.reshape(len(local), -1), step[:, [0, 2]], turn[:, None], _contacts(world, floor_m, unit_m, clip.fps)]
    return np.concatenate(parts, axis=-1), HoldenStart(path[0], float(yaw[0]), floor_m, unit_m)


def positions_from_holden(features: FloatArray, start: HoldenStart) -> FloatArray:
    """World positions ``[T, 21, 3]`` m: the path is integrated from its start, the joints are put over it."""
    features = finite_array(features, "features", (None, N_FEATURES))
    local = features[:, HOLDEN_SLICES["position_units"]].reshape(len(features), -1, 3)[:, 1:]
    turn = features[:-1, HOLDEN_SLICES["yaw_velocity"]][:, 0]
    yaw = start.yaw_rad + np.concatenate([[0.0], np.cumsum(turn)])
    velocity = features[:-1, HOLDEN_SLICES["velocity_xz"]]
    step = np.stack([velocity[:, 0], np.zeros(len(velocity)), velocity[:, 1]], axis=-1)
    steps = quat.rotate(quat.about_y(yaw[1:]), step) * start.unit_m
    origin = np.array([start.xz_m[0], start.floor_m, start.xz_m[1]])
    path = np.concatenate([origin[None], origin + np.cumsum(steps, axis=0)])
    return path[:, None] + quat.rotate(quat.about_y(yaw)[:, None], local) * start.unit_m


def clip_from_holden(features: FloatArray, start: HoldenStart, like: Clip) -> Clip:
    """The clip whose joints come nearest to the features' positions with the bones of ``like``."""
    return fit_rotations(positions_from_holden(features, start), like)


def _smooth(values: FloatArray, sigma_frames: float) -> FloatArray:
    from scipy.ndimage import gaussian_filter1d

    return np.asarray(gaussian_filter1d(values, sigma_frames, axis=0, mode="nearest"))


def _contacts(world_m: FloatArray, floor_m: float, unit_m: float, fps: float) -> BoolArray:
    feet = world_m[:, FOOT_JOINTS]
    speed = np.zeros(feet.shape[:2])
    speed[:-1] = np.linalg.norm(np.diff(feet, axis=0), axis=-1) * fps / unit_m
    if len(feet) > 1:
        speed[-1] = speed[-2]
    low = (feet[..., 1] - floor_m) / unit_m < CONTACT_HEIGHTS_UNITS
    return np.asarray((speed < CONTACT_UNITS_S) & low)
