"""Joint angles outside the range that real motion has.

Conventions: rotations are local unit quaternions w, x, y, z; the range is taken from real motion first and applied to
outputs then.

A joint's angles are the rotation vector from its mean rotation in real motion, along the three principal axes of real
motion: for a knee, bending and the two directions in which it hardly gives. Their range leaves out the outermost
thousandth at either end, so that single bad frames do not widen it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.checks import checked_joints

TAIL = 0.001
MARGIN_DEG = 1.0
"""An angle is outside only if it is beyond the range by more than this."""


@dataclass(frozen=True, eq=False)
class JointRange:
    """The range of joint angles in real motion.

    Attributes
    ----------
    mean_wxyz : ``[J, 4]`` mean rotation of each joint.
    axes : ``[J, 3, 3]`` principal axes of each joint, one a row.
    low_deg, high_deg : ``[J, 3]`` range along them.
    """

    mean_wxyz: FloatArray
    axes: FloatArray
    low_deg: FloatArray
    high_deg: FloatArray

    @classmethod
    def seen_in(cls, rotations_wxyz: ArrayLike) -> JointRange:
        """The range in frames ``[F, J, 4]`` of real motion.

        Raises
        ------
        BadInput : another shape, NaN, a quaternion that is zero.
        """
        rotations = _checked_rotations(rotations_wxyz, (None, None, 4))
        means, axes, angles = [], [], []
        for joint in range(rotations.shape[1]):
            turned = Rotation.from_quat(rotations[:, joint], scalar_first=True)
            mean = turned.mean()
            vectors = (mean.inv() * turned).as_rotvec(degrees=True)
            _, _, principal = np.linalg.svd(vectors.T @ vectors)
            means.append(mean.as_quat(scalar_first=True))
            axes.append(principal)
            angles.append(np.quantile(vectors @ principal.T, [TAIL, 1.0 - TAIL], axis=0))
        low_high = np.stack(angles)
        return cls(np.stack(means), np.stack(axes), low_high[:, 0], low_high[:, 1])

    def outside(self, rotations_wxyz: ArrayLike, *, joints: Sequence[int] | None = None) -> FloatArray:
        """Share of joint angles outside the range by more than a degree: ``[n]`` percent.

        Parameters
        ----------
        rotations_wxyz : ``[n, T, J, 4]``.
        joints : joints that count; all by default. Leave out the root, whose rotation is where the body faces.

        Raises
        ------
        BadInput : another shape or number of joints, NaN, a quaternion that is zero, joints that do not exist.
        """
        rotations = _checked_rotations(rotations_wxyz, (None, None, len(self.mean_wxyz), 4))
        counted = checked_joints(joints, len(self.mean_wxyz))
        outside = []
        for joint in counted:
            mean = Rotation.from_quat(self.mean_wxyz[joint], scalar_first=True)
            turned = Rotation.from_quat(rotations[:, :, joint].reshape(-1, 4), scalar_first=True)
            angles = (mean.inv() * turned).as_rotvec(degrees=True) @ self.axes[joint].T
            beyond = np.maximum(self.low_deg[joint] - angles, angles - self.high_deg[joint])
            outside.append((beyond > MARGIN_DEG).reshape(len(rotations), -1).mean(axis=1))
        return np.asarray(100.0 * np.mean(outside, axis=0))


def _checked_rotations(rotations_wxyz: ArrayLike, shape: tuple[int | None, ...]) -> FloatArray:
    rotations = finite_array(rotations_wxyz, "rotations_wxyz", shape)
    if (np.linalg.norm(rotations, axis=-1) < 1e-6).any():
        raise BadInput("rotations_wxyz must be unit quaternions, got a zero one", where="rotations_wxyz")
    return rotations
