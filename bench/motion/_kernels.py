"""Compiled loops of the motion core (numba, cached on disk). Inputs are checked by their callers."""

from __future__ import annotations

import numba
import numpy as np

from bench.arrays import FloatArray, IntArray


@numba.njit(cache=True, nogil=True)
def forward_kinematics(
    rotations: FloatArray, root: FloatArray, offsets: FloatArray, parents: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Local rotations [N, J, 4] and root [N, 3] to world positions [N, J, 3] and world rotations [N, J, 4]."""
    n, joints = rotations.shape[0], rotations.shape[1]
    positions = np.empty((n, joints, 3))
    world = np.empty((n, joints, 4))
    for i in range(n):
        for k in range(3):
            positions[i, 0, k] = root[i, k]
        for k in range(4):
            world[i, 0, k] = rotations[i, 0, k]
        for j in range(1, joints):
            p = parents[j]
            w, x, y, z = world[i, p, 0], world[i, p, 1], world[i, p, 2], world[i, p, 3]
            a, b, c = offsets[j, 0], offsets[j, 1], offsets[j, 2]
            tx = 2.0 * (y * c - z * b)
            ty = 2.0 * (z * a - x * c)
            tz = 2.0 * (x * b - y * a)
            positions[i, j, 0] = positions[i, p, 0] + a + w * tx + y * tz - z * ty
            positions[i, j, 1] = positions[i, p, 1] + b + w * ty + z * tx - x * tz
            positions[i, j, 2] = positions[i, p, 2] + c + w * tz + x * ty - y * tx
            rw, rx, ry, rz = rotations[i, j, 0], rotations[i, j, 1], rotations[i, j, 2], rotations[i, j, 3]
            world[i, j, 0] = w * rw - x * rx - y * ry - z * rz
            world[i, j, 1] = w * rx + x * rw + y * rz - z * ry
            world[i, j, 2] = w * ry - x * rz + y * rw + z * rx
            world[i, j, 3] = w * rz + x * ry - y * rx + z * rw
    return positions, world
