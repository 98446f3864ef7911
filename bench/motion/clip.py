"""Clip: one motion, the one currency of the harness."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import FloatArray, finite_array, read_only
from bench.errors import BadMotion
from bench.motion import quat
from bench.motion.skeleton import Skeleton

UNIT_TOLERANCE = 1e-3
"""How far the length of a rotation may be from 1 before it is refused; within it, rotations are normalised."""


@dataclass(frozen=True, eq=False)
class Clip:
    """One motion. Immutable; metres, seconds, Y up.

    Attributes
    ----------
    skeleton : the joints and their rest offsets.
    rotations_wxyz : ``[T, J, 4]`` local joint rotations, unit quaternions.
    root_xyz_m : ``[T, 3]`` world position of joint 0.
    fps : frames per second.

    Raises
    ------
    BadMotion : wrong shapes, NaN / Inf, rotations that are not unit length, fps outside (0, 1000].
    """

    skeleton: Skeleton
    rotations_wxyz: FloatArray
    root_xyz_m: FloatArray
    fps: float

    def __post_init__(self) -> None:
        try:
            rotations = finite_array(self.rotations_wxyz, "rotations_wxyz", (None, self.skeleton.n_joints, 4))
            root = finite_array(self.root_xyz_m, "root_xyz_m", (rotations.shape[0], 3))
        except Exception as error:
            raise BadMotion(str(error)) from error
        if not 0.0 < self.fps <= 1000.0:
            raise BadMotion(f"fps must be in (0, 1000], got {self.fps}", cause="a frame time of 0 or in milliseconds")
        lengths = np.linalg.norm(rotations, axis=-1)
        worst = float(np.abs(lengths - 1.0).max())
        if worst > UNIT_TOLERANCE:
            frame, joint = np.unravel_index(int(np.abs(lengths - 1.0).argmax()), lengths.shape)
            raise BadMotion(
                f"rotations_wxyz must be unit quaternions, got length {lengths[frame, joint]:.4g}",
                where=f"frame {frame}, joint {self.skeleton.names[joint]}",
                cause="not normalised, or another rotation representation",
            )
        object.__setattr__(self, "rotations_wxyz", read_only(quat.normalise(rotations)))
        object.__setattr__(self, "root_xyz_m", read_only(root.copy()))
        object.__setattr__(self, "fps", float(self.fps))

    @property
    def n_frames(self) -> int:
        return int(self.rotations_wxyz.shape[0])

    @property
    def duration_s(self) -> float:
        return self.n_frames / self.fps

    def with_motion(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> Clip:
        """Another motion of the same skeleton at the same fps."""
        return Clip(self.skeleton, rotations_wxyz, root_xyz_m, self.fps)
