"""Compiled loop of the leg solver (numba, cached on disk). Inputs are checked by the caller."""

from __future__ import annotations

import numba
import numpy as np

from bench.arrays import BoolArray, FloatArray

NEAR_ENOUGH_M = 1e-5
"""A frame is left alone, and the solver stops, where both foot joints are this close to their targets."""


@numba.njit(cache=True, nogil=True)
def _product(left: FloatArray, right: FloatArray) -> FloatArray:
    w, x, y, z = left
    a, b, c, d = right
    return np.array(
        [
            w * a - x * b - y * c - z * d,
            w * b + x * a + y * d - z * c,
            w * c - x * d + y * a + z * b,
            w * d + x * c - y * b + z * a,
        ]
    )


@numba.njit(cache=True, nogil=True)
def _turned(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    w, x, y, z = rotation
    a, b, c = vector
    tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
    return np.array([a + w * tx + y * tz - z * ty, b + w * ty + z * tx - x * tz, c + w * tz + x * ty - y * tx])


@numba.njit(cache=True, nogil=True)
def _exponential(vector: FloatArray) -> FloatArray:
    angle = np.sqrt((vector * vector).sum())
    scale = 0.5 if angle < 1e-9 else np.sin(angle / 2.0) / angle
    return np.array([np.cos(angle / 2.0), scale * vector[0], scale * vector[1], scale * vector[2]])


@numba.njit(cache=True, nogil=True)
def _damped_step(jacobian: FloatArray, error: FloatArray, damping: float, step: FloatArray) -> None:
    """``J' (J J' + damping^2)^-1 error`` into ``step``, by a Cholesky factor of the 6 x 6 system."""
    lower, solved = np.zeros((6, 6)), np.empty(6)
    for i in range(6):
        for j in range(i + 1):
            total = damping * damping if i == j else 0.0
            for k in range(9):
                total += jacobian[i, k] * jacobian[j, k]
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            lower[i, j] = np.sqrt(total) if i == j else total / lower[j, j]
    for i in range(6):
        total = error[i]
        for k in range(i):
            total -= lower[i, k] * solved[k]
        solved[i] = total / lower[i, i]
    for i in range(5, -1, -1):
        total = solved[i]
        for k in range(i + 1, 6):
            total -= lower[k, i] * solved[k]
        solved[i] = total / lower[i, i]
    for k in range(9):
        step[k] = 0.0
        for i in range(6):
            step[k] += jacobian[i, k] * solved[i]


@numba.njit(cache=True, nogil=True)
def solve_legs(
    rotations: FloatArray,
    hip_positions: FloatArray,
    root_rotations: FloatArray,
    offsets: FloatArray,
    targets: FloatArray,
    wanted: BoolArray,
    iterations: int,
    damping: float,
) -> None:
    """Turn hip, knee and ankle of one leg so that ankle and toe reach their targets, frame by frame, in place.

    ``rotations [T, 3, 4]`` local rotations of upper leg, leg and foot; ``hip_positions [T, 3]`` world positions of the
    upper leg; ``root_rotations [T, 4]`` world rotations of its parent; ``offsets [3, 3]`` knee, ankle and toe from
    their parents; ``targets [T, 2, 3]`` world positions of ankle and toe; ``wanted [T]`` frames to be solved.
    """
    points, parents = np.empty((4, 3)), np.empty((4, 4))
    jacobian = np.zeros((6, 9))
    error, step = np.empty(6), np.empty(9)
    for frame in range(len(rotations)):
        if not wanted[frame]:
            continue
        for iteration in range(iterations + 1):
            points[0] = hip_positions[frame]
            parents[0] = root_rotations[frame]
            for j in range(3):
                parents[j + 1] = _product(parents[j], rotations[frame, j])
                points[j + 1] = points[j] + _turned(parents[j + 1], offsets[j])
            error[:3] = targets[frame, 0] - points[2]
            error[3:] = targets[frame, 1] - points[3]
            if iteration == iterations or np.abs(error).max() < NEAR_ENOUGH_M:
                break
            for j in range(3):
                for end in range(2):
                    arm = points[2 + end] - points[j]
                    row = 3 * end
                    # Columns are axis x arm for the three world axes; the foot joint does not move the ankle.
                    jacobian[row, 3 * j + 1], jacobian[row, 3 * j + 2] = arm[2], -arm[1]
                    jacobian[row + 1, 3 * j], jacobian[row + 1, 3 * j + 2] = -arm[2], arm[0]
                    jacobian[row + 2, 3 * j], jacobian[row + 2, 3 * j + 1] = arm[1], -arm[0]
            _damped_step(jacobian, error, damping, step)
            for j in range(3):
                turn = _exponential(step[3 * j : 3 * j + 3])
                back = parents[j] * np.array([1.0, -1.0, -1.0, -1.0])
                local = _product(_product(back, _product(turn, parents[j])), rotations[frame, j])
                rotations[frame, j] = local / np.sqrt((local * local).sum())
