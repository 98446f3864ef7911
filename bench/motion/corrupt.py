"""Corruptions of clips with a level each: what metrics under test must see, and what they must not.

Every function answers with a clip of the same frames and fps; level 0 is the clip itself. Random ones take a generator.
"""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop, pad_to, resample
from bench.motion.kinematics import world_positions, yaw_aligned
from bench.motion.pose import onto_skeleton
from bench.motion.representation import mean_facing
from bench.motion.skeleton import (
    LEFT_ARM,
    LEFT_FOREARM,
    LEFT_LEG,
    LEFT_UP_LEG,
    RIGHT_ARM,
    RIGHT_FOREARM,
    RIGHT_LEG,
    RIGHT_UP_LEG,
)

SWAPPED_JOINTS = (
    (LEFT_FOREARM, LEFT_LEG),
    (RIGHT_FOREARM, RIGHT_LEG),
    (LEFT_ARM, LEFT_UP_LEG),
    (RIGHT_ARM, RIGHT_UP_LEG),
)
"""Joints that :func:`joints_swapped` exchanges, in this order."""


def noisy(clip: Clip, sd_rad: float, rng: np.random.Generator) -> Clip:
    """Independent rotation noise on every joint and frame."""
    turns = quat.from_rotation_vector(rng.normal(0.0, 1.0, (*clip.rotations_wxyz.shape[:2], 3)) * sd_rad)
    return clip.with_motion(quat.multiply(clip.rotations_wxyz, turns), clip.root_xyz_m)


def jittered(clip: Clip, sd_m: float, rng: np.random.Generator) -> Clip:
    """Independent noise on the root's position in every frame: the whole body trembles."""
    return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + rng.normal(0.0, 1.0, clip.root_xyz_m.shape) * sd_m)


def time_warped(clip: Clip, share: float) -> Clip:
    """One slow and one fast half: speed is ``1 + share x cos`` over the clip, whose ends stay where they are.

    Raises
    ------
    BadInput : a share outside 0..1.
    """
    _check_share(share)
    last = clip.n_frames - 1
    time = np.arange(clip.n_frames) / max(last, 1)
    return _at(clip, last * (time + share * np.sin(2.0 * np.pi * time) / (2.0 * np.pi)))


def foot_slid(clip: Clip, speed_m_s: float) -> Clip:
    """The root drifts at a constant speed along +X, and the feet slide with it."""
    drift = speed_m_s * np.arange(clip.n_frames) / clip.fps
    return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + drift[:, None] * np.array([1.0, 0.0, 0.0]))


def joints_swapped(clip: Clip, n_pairs: int) -> Clip:
    """Local rotations exchanged between arm and leg in the first pairs of ``SWAPPED_JOINTS``.

    Raises
    ------
    BadInput : more pairs than there are.
    """
    if not 0 <= n_pairs <= len(SWAPPED_JOINTS):
        raise BadInput(f"n_pairs must be in 0..{len(SWAPPED_JOINTS)}, got {n_pairs}", where="n_pairs")
    order = list(range(clip.skeleton.n_joints))
    for one, other in SWAPPED_JOINTS[: int(n_pairs)]:
        order[one], order[other] = other, one
    return clip.with_motion(clip.rotations_wxyz[:, order], clip.root_xyz_m)


def blended(clip: Clip, other: Clip, alpha: float) -> Clip:
    """Frame by frame between ``clip`` and ``other``, which is turned and moved to the same mean heading and place.

    At 1 it is ``other`` on the bones of ``clip``. Both have the same frames and fps.

    Raises
    ------
    BadInput : an alpha outside 0..1, or clips of different lengths.
    """
    _check_share(alpha)
    if other.n_frames != clip.n_frames:
        raise BadInput(f"other must have {clip.n_frames} frames, got {other.n_frames}", where="other")
    fitted = onto_skeleton(other, clip.skeleton)
    turn = mean_facing(world_positions(fitted)) - mean_facing(world_positions(clip))
    rotations, root = yaw_aligned(fitted.rotations_wxyz, fitted.root_xyz_m, float(turn))
    root = root + (clip.root_xyz_m.mean(axis=0) - root.mean(axis=0)) * np.array([1.0, 0.0, 1.0])
    mixed = quat.slerp(clip.rotations_wxyz, rotations, np.full(rotations.shape[:2], alpha))
    return clip.with_motion(mixed, clip.root_xyz_m + alpha * (root - clip.root_xyz_m))


def frozen(clip: Clip, share: float) -> Clip:
    """The middle of the clip plays, before and after it the pose is held; at 1 all frames are the middle one.

    Raises
    ------
    BadInput : a share outside 0..1.
    """
    _check_share(share)
    middle, reach = (clip.n_frames - 1) // 2, round((1.0 - share) * clip.n_frames / 2.0)
    return _frames(clip, np.clip(np.arange(clip.n_frames), middle - reach, middle + reach))


def frames_dropped(clip: Clip, share: float, rng: np.random.Generator) -> Clip:
    """Each frame but the first is lost with probability ``share``; the one before it is shown instead.

    Raises
    ------
    BadInput : a share outside 0..1.
    """
    _check_share(share)
    kept = rng.random(clip.n_frames) >= share
    kept[0] = True
    return _frames(clip, np.maximum.accumulate(np.where(kept, np.arange(clip.n_frames), 0)))


def turned(clip: Clip, yaw_rad: float) -> Clip:
    """The whole motion turned about the world's up axis."""
    rotations, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, -yaw_rad)
    return clip.with_motion(rotations, root)


def moved(clip: Clip, distance_m: float) -> Clip:
    """The whole motion moved over the floor."""
    return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + distance_m * np.array([0.6, 0.0, 0.8]))


def resampled_and_back(clip: Clip, fps: float) -> Clip:
    """The clip at another frame rate and back at its own; ``fps`` 0 leaves it alone."""
    if fps == 0.0:
        return clip
    there_and_back = resample(resample(clip, fps), clip.fps)
    return crop(pad_to(there_and_back, clip.n_frames), 0, clip.n_frames)


def _at(clip: Clip, places: FloatArray) -> Clip:
    """The clip at fractional frames ``[T]``."""
    before = np.clip(np.floor(places).astype(np.int64), 0, clip.n_frames - 1)
    after = np.minimum(before + 1, clip.n_frames - 1)
    weight = np.clip(places - before, 0.0, 1.0)
    spread = np.broadcast_to(weight[:, None], clip.rotations_wxyz.shape[:2])
    rotations = quat.slerp(clip.rotations_wxyz[before], clip.rotations_wxyz[after], spread)
    root = clip.root_xyz_m[before] + weight[:, None] * (clip.root_xyz_m[after] - clip.root_xyz_m[before])
    return clip.with_motion(rotations, root)


def _frames(clip: Clip, frames: np.ndarray[tuple[int, ...], np.dtype[np.int64]]) -> Clip:
    return clip.with_motion(clip.rotations_wxyz[frames], clip.root_xyz_m[frames])


def _check_share(share: float) -> None:
    if not 0.0 <= share <= 1.0:
        raise BadInput(f"a share must be in 0..1, got {share}", where="share")
