"""Quaternions as ``[..., 4]`` float64 arrays in w, x, y, z order (Hamilton, active rotations).

Conversions lean on :class:`scipy.spatial.transform.Rotation`; products stay in numpy, which is faster on big batches.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray

IDENTITY = np.array([1.0, 0.0, 0.0, 0.0])


def multiply(left: FloatArray, right: FloatArray) -> FloatArray:
    """Hamilton product ``left * right`` (``right`` is applied first); both ``[..., 4]``, broadcast."""
    w1, x1, y1, z1 = np.moveaxis(left, -1, 0)
    w2, x2, y2, z2 = np.moveaxis(right, -1, 0)
    return np.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        axis=-1,
    )


def conjugate(rotation: FloatArray) -> FloatArray:
    """Inverse of unit quaternions ``[..., 4]``."""
    return np.asarray(rotation * np.array([1.0, -1.0, -1.0, -1.0]))


def rotate(rotation: FloatArray, vector: FloatArray) -> FloatArray:
    """Rotate vectors ``[..., 3]`` by unit quaternions ``[..., 4]``; shapes broadcast."""
    w, xyz = rotation[..., :1], rotation[..., 1:]
    twice = 2.0 * np.cross(xyz, vector)
    return np.asarray(vector + w * twice + np.cross(xyz, twice))


def normalise(rotation: FloatArray) -> FloatArray:
    """Scale ``[..., 4]`` to unit length; the caller guarantees non-zero input."""
    return np.asarray(rotation / np.linalg.norm(rotation, axis=-1, keepdims=True))


def from_axis_angle(axis: FloatArray, angle_rad: FloatArray | float) -> FloatArray:
    """Rotation by ``angle_rad`` ``[...]`` about unit ``axis`` ``[..., 3]``."""
    half = np.asarray(angle_rad, dtype=np.float64)[..., None] / 2.0
    return np.concatenate([np.cos(half) + 0.0 * axis[..., :1], np.sin(half) * axis], axis=-1)


def about_y(angle_rad: FloatArray | float) -> FloatArray:
    """Rotation about the up axis: ``[...]`` radians to ``[..., 4]``."""
    return from_axis_angle(np.array([0.0, 1.0, 0.0]), angle_rad)


def to_rotation_vector(rotation: FloatArray) -> FloatArray:
    """Logarithm map ``[..., 4] -> [..., 3]`` (radians, shortest way round)."""
    flat = Rotation.from_quat(rotation.reshape(-1, 4), scalar_first=True).as_rotvec()
    return np.asarray(flat.reshape(*rotation.shape[:-1], 3))


def from_rotation_vector(vector: FloatArray) -> FloatArray:
    """Exponential map ``[..., 3] -> [..., 4]``."""
    flat = Rotation.from_rotvec(vector.reshape(-1, 3)).as_quat(scalar_first=True)
    return np.asarray(flat.reshape(*vector.shape[:-1], 4))


def to_matrix(rotation: FloatArray) -> FloatArray:
    """``[..., 4] -> [..., 3, 3]``."""
    flat = Rotation.from_quat(rotation.reshape(-1, 4), scalar_first=True).as_matrix()
    return np.asarray(flat.reshape(*rotation.shape[:-1], 3, 3))


def from_matrix(matrix: FloatArray) -> FloatArray:
    """``[..., 3, 3] -> [..., 4]``; the matrix is orthonormalised by scipy if it is slightly off."""
    flat = Rotation.from_matrix(matrix.reshape(-1, 3, 3)).as_quat(scalar_first=True)
    return np.asarray(flat.reshape(*matrix.shape[:-2], 4))


def between(start: FloatArray, end: FloatArray) -> FloatArray:
    """Shortest rotation that takes direction ``start`` ``[..., 3]`` to ``end`` ``[..., 3]`` (any lengths, non-zero).

    For opposite directions, where it is not unique, it turns about the z axis (or x, if ``start`` lies along z).
    """
    start = start / np.linalg.norm(start, axis=-1, keepdims=True)
    end = end / np.linalg.norm(end, axis=-1, keepdims=True)
    w = 1.0 + np.sum(start * end, axis=-1, keepdims=True)
    axis = np.cross(start, end)
    along_z = np.abs(start[..., 2:]) > 0.9
    fallback = np.cross(start, np.where(along_z, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]))
    fallback = np.cross(fallback, start)
    opposite = w < 1e-9
    return normalise(np.concatenate([np.where(opposite, 0.0, w), np.where(opposite, fallback, axis)], axis=-1))


def same_hemisphere(rotation: FloatArray, reference: FloatArray) -> FloatArray:
    """Flip signs of ``[..., 4]`` so that each lies in the hemisphere of ``reference`` (broadcast)."""
    dots = np.sum(rotation * reference, axis=-1, keepdims=True)
    return np.where(dots < 0.0, -rotation, rotation)


def continuous(rotation: FloatArray) -> FloatArray:
    """Flip signs along the first axis of ``[T, ..., 4]`` so that neighbouring frames never jump hemisphere."""
    dots = np.sum(rotation[1:] * rotation[:-1], axis=-1)
    flips = np.cumprod(np.where(dots < 0.0, -1.0, 1.0), axis=0)
    result = rotation.copy()
    result[1:] *= flips[..., None]
    return result


def mean(rotation: FloatArray) -> FloatArray:
    """Mean rotation over the first axis of ``[N, ..., 4]``: the largest eigenvector of the scatter matrix.

    Independent of the signs of the inputs (Markley et al. 2007).
    """
    scatter = np.einsum("n...i,n...j->...ij", rotation, rotation)
    _, vectors = np.linalg.eigh(scatter)
    best = vectors[..., -1]
    return np.where(best[..., :1] < 0.0, -best, best)


def angle_between(left: FloatArray, right: FloatArray) -> FloatArray:
    """Geodesic distance on SO(3) in radians, ``[...]``; the double cover counts as one rotation.

    Uses the chord form, which keeps precision near 0 where ``arccos`` loses it.
    """
    right = same_hemisphere(right, left)
    chord = np.linalg.norm(left - right, axis=-1)
    return np.asarray(4.0 * np.arcsin(np.clip(chord / 2.0, 0.0, 1.0)))


def slerp(start: FloatArray, end: FloatArray, weight: FloatArray | float) -> FloatArray:
    """Spherical interpolation, ``weight`` 0 gives ``start`` and 1 gives ``end``; shortest way, broadcast."""
    turn = to_rotation_vector(multiply(conjugate(start), same_hemisphere(end, start)))
    weight_array = np.asarray(weight, dtype=np.float64)
    return multiply(start, from_rotation_vector(turn * weight_array[..., None]))
