"""Checks at the door of metrics on joint positions."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput


def checked_positions(
    positions_m: ArrayLike, name: str, joints: Sequence[int] | None, *, min_frames: int, root_relative: bool = False
) -> FloatArray:
    """Positions ``[n, T, len(joints), 3]`` of ``[n, T, J, 3]``; all joints where ``joints`` is None.

    Raises
    ------
    BadInput : another shape, fewer than ``min_frames`` frames, NaN, joints that do not exist.
    """
    positions = finite_array(positions_m, name, (None, None, None, 3))
    if positions.shape[1] < min_frames:
        raise BadInput(f"{name} must have at least {min_frames} frames, got {positions.shape[1]}", where=name)
    kept = checked_joints(joints, positions.shape[2])
    if root_relative:
        positions = positions - positions[:, :, :1]
    return positions if joints is None else positions[:, :, kept]


def checked_joints(joints: Sequence[int] | None, n_joints: int) -> list[int]:
    """``joints`` as a list, all ``n_joints`` where None; refused where they repeat or do not exist."""
    if joints is None:
        return list(range(n_joints))
    kept = [int(j) for j in joints]
    if not kept or len(set(kept)) != len(kept) or not all(0 <= j < n_joints for j in kept):
        raise BadInput(f"joints must be different indices in 0..{n_joints - 1}, got {kept}", where="joints")
    return kept


def checked_fps(fps: float) -> float:
    """``fps``, refused where it is not a positive number."""
    if not np.isfinite(fps) or fps <= 0.0:
        raise BadInput(f"fps must be positive, got {fps}", where="fps")
    return float(fps)
