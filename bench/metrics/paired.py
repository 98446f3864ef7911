"""Errors against the true answer of a task, where the dataset knows it (the procedural dataset does).

Exact errors compare frame by frame and punish right poses at wrong times; aligned errors compare along the DTW path of
the two motions and forgive them. Pass real joints only: virtual joints follow others and would dilute the mean.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.dtw import Backend, dtw


@dataclass(frozen=True)
class PairedErrors:
    """Means over joints and frames (exact) or over joints and pairs of frames (aligned).

    The exact errors are NaN where the motions differ in length.
    """

    rotation_deg: float
    position_cm: float
    aligned_rotation_deg: float
    aligned_position_cm: float


def rotation_errors_deg(true_rotations_wxyz: ArrayLike, output_rotations_wxyz: ArrayLike) -> FloatArray:
    """Geodesic distance of two rotations on SO(3), ``[T, J, 4]`` twice to ``[T, J]`` degrees in 0..180.

    q and -q are one rotation. Computed from the half angle's sine and cosine, exact near 0 and near 180 degrees.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different shapes, quaternions that are not of unit length.
    """
    true = _unit_quaternions(true_rotations_wxyz, "true_rotations_wxyz", (None, None, 4))
    output = _unit_quaternions(output_rotations_wxyz, "output_rotations_wxyz", true.shape)
    return _geodesic_deg(true, output)


def position_errors_cm(true_positions_m: ArrayLike, output_positions_m: ArrayLike) -> FloatArray:
    """Euclidean distance of two positions, ``[T, J, 3]`` metres twice to ``[T, J]`` centimetres.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different shapes.
    """
    true = finite_array(true_positions_m, "true_positions_m", (None, None, 3))
    output = finite_array(output_positions_m, "output_positions_m", true.shape)
    return _distance_cm(true, output)


def paired_errors(
    true_rotations_wxyz: ArrayLike,
    output_rotations_wxyz: ArrayLike,
    true_positions_m: ArrayLike,
    output_positions_m: ArrayLike,
    backend: Backend = "exact",
) -> PairedErrors:
    """All four errors of one output. The DTW path is found on positions and used for rotations too.

    Parameters
    ----------
    true_rotations_wxyz, output_rotations_wxyz : ``[n, J, 4]`` and ``[m, J, 4]`` local unit quaternions.
    true_positions_m, output_positions_m : ``[n, J, 3]`` and ``[m, J, 3]`` world positions, metres.
    backend : DTW backend.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different joints, rotations and positions of different length,
        quaternions that are not of unit length.
    """
    true_rotations = _unit_quaternions(true_rotations_wxyz, "true_rotations_wxyz", (None, None, 4))
    joints = true_rotations.shape[1]
    output_rotations = _unit_quaternions(output_rotations_wxyz, "output_rotations_wxyz", (None, joints, 4))
    true_positions = finite_array(true_positions_m, "true_positions_m", (len(true_rotations), joints, 3))
    output_positions = finite_array(output_positions_m, "output_positions_m", (len(output_rotations), joints, 3))

    same_length = len(true_rotations) == len(output_rotations)
    path = dtw(_flat(true_positions), _flat(output_positions), backend)
    i, j = path.pairs.T
    return PairedErrors(
        rotation_deg=float(_geodesic_deg(true_rotations, output_rotations).mean()) if same_length else float("nan"),
        position_cm=float(_distance_cm(true_positions, output_positions).mean()) if same_length else float("nan"),
        aligned_rotation_deg=float(_geodesic_deg(true_rotations[i], output_rotations[j]).mean()),
        aligned_position_cm=float(_distance_cm(true_positions[i], output_positions[j]).mean()),
    )


def _flat(positions: FloatArray) -> FloatArray:
    return positions.reshape(len(positions), -1)


def _geodesic_deg(left: FloatArray, right: FloatArray) -> FloatArray:
    minus, plus = np.linalg.norm(left - right, axis=-1), np.linalg.norm(left + right, axis=-1)
    return np.asarray(np.degrees(4.0 * np.arctan2(np.minimum(minus, plus), np.maximum(minus, plus))))


def _distance_cm(left_m: FloatArray, right_m: FloatArray) -> FloatArray:
    return np.asarray(100.0 * np.linalg.norm(left_m - right_m, axis=-1))


def _unit_quaternions(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    quaternions = finite_array(values, name, shape)
    lengths = np.linalg.norm(quaternions, axis=-1, keepdims=True)
    worst = float(np.abs(lengths - 1.0).max())
    if worst > 1e-3:
        raise BadInput(f"{name} must hold unit quaternions, one has a length {worst:.3g} off 1", where=name)
    return np.asarray(quaternions / lengths)
