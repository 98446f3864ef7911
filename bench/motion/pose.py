"""Poses moved between skeletons, and simple statistics of poses: what anchors and baselines share."""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.kinematics import facing_yaw, world_positions, yaw_aligned
from bench.motion.skeleton import Skeleton


def onto_skeleton(clip: Clip, skeleton: Skeleton) -> Clip:
    """The same rotations on other bones; the root path is scaled by the ratio of statures."""
    scale = skeleton.stature_m / clip.skeleton.stature_m
    return Clip(skeleton, clip.rotations_wxyz, clip.root_xyz_m * scale, clip.fps)


def fitted_window(clip: Clip, like: Clip, start: int) -> Clip:
    """The window of ``clip`` from ``start`` with the length, bones and fps of ``like``."""
    return onto_skeleton(window(clip, start if clip.n_frames >= like.n_frames else 0, like.n_frames), like.skeleton)


def random_start(clip: Clip, n_frames: int, rng: np.random.Generator) -> int:
    """A uniformly drawn start of a window of ``n_frames``; 0 where the clip is shorter."""
    return int(rng.integers(0, max(clip.n_frames - n_frames, 0) + 1))


def local_rotation_vectors(clip: Clip, reference_wxyz: FloatArray) -> FloatArray:
    """Rotations of a clip as vectors ``[T, J, 3]`` about per-joint references ``[J, 4]``, the root without its heading.

    About a mean rotation the logarithm is far from its cut at 180 degrees, so vectors may be averaged.
    """
    aligned, _ = heading_removed(clip)
    return quat.to_rotation_vector(quat.multiply(quat.conjugate(reference_wxyz)[None], aligned))


def heading_removed(clip: Clip) -> tuple[FloatArray, FloatArray]:
    """Local rotations ``[T, J, 4]`` with the heading taken out of the root frame by frame, and the headings ``[T]``."""
    yaw = facing_yaw(world_positions(clip))
    aligned, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, yaw)
    return aligned, yaw


def from_local_rotation_vectors(
    vectors: FloatArray, reference_wxyz: FloatArray, yaw_rad: FloatArray, root_xyz_m: FloatArray, like: Clip
) -> Clip:
    """Inverse of :func:`local_rotation_vectors`: heading ``[T]`` and root path ``[T, 3]`` put back."""
    aligned = quat.multiply(reference_wxyz[None], quat.from_rotation_vector(vectors))
    rotations, _ = yaw_aligned(aligned, root_xyz_m, -yaw_rad)
    return like.with_motion(rotations, root_xyz_m)
