"""How far each joint moves when the style of one body part is transferred (Motion Puzzle, section 7.1, Table 1).

Parts are index sequences over the joints; their names live on the skeleton. Virtual joints, which follow other joints
rigidly, are named in ``virtual`` and counted nowhere.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.errors import BadConfig, BadInput

Alignment = Literal["none", "start", "root"]

TABLE_THRESHOLDS = (0.1, 0.05)
"""The two lists of the paper's table; the second includes the first."""


def joint_displacement(
    source_positions_m: ArrayLike,
    output_positions_m: ArrayLike,
    stature_m: float,
    *,
    squared: bool = True,
    align: Alignment = "none",
) -> FloatArray:
    """Mean over frames of each joint's (squared) distance between source and output, lengths divided by stature.

    Parameters
    ----------
    source_positions_m, output_positions_m : ``[T, J, 3]`` world positions of the same frames and joints, metres, Y up.
    stature_m : the skeleton's height.
    squared : True for the mean squared displacement of the caption, False for the plain distance. The paper's text and
        table name the first, its thresholds would suit either.
    align : ``"none"``: global positions as they are, the paper's words; ``"start"``: the output is first moved over the
        ground so that both roots start above the same point; ``"root"``: relative to the root, in every frame.

    Returns
    -------
    ``[J]``, in stature squared, or in statures if not ``squared``.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different shapes, stature not positive. BadConfig : no such alignment.
    """
    source = finite_array(source_positions_m, "source_positions_m", (None, None, 3))
    output = finite_array(output_positions_m, "output_positions_m", source.shape)
    if not (np.isfinite(stature_m) and stature_m > 0.0):
        raise BadInput(f"stature_m must be positive, got {stature_m}", where="stature_m")
    distances = np.linalg.norm(_offsets(source, output, align), axis=-1) / stature_m
    return np.asarray((distances**2 if squared else distances).mean(axis=0))


def joints_above(displacement: ArrayLike, threshold: float, virtual: Sequence[int] = ()) -> tuple[int, ...]:
    """Indices of the joints whose displacement is larger than ``threshold``, ascending.

    Larger, as in the table's head and the text; its caption says "or more".

    Parameters
    ----------
    displacement : ``[J]`` as from ``joint_displacement``.
    threshold : 0.1 and 0.05 in the paper.
    virtual : joints that do not count.

    Raises
    ------
    BadInput : not one-dimensional, empty, not finite, negative; a joint index that does not exist; a threshold below 0.
    """
    values = _displacement(displacement)
    if not (np.isfinite(threshold) and threshold >= 0.0):
        raise BadInput(f"threshold must be at least 0 and finite, got {threshold}", where="threshold")
    real = ~_members(virtual, len(values), "virtual")
    return tuple(int(joint) for joint in np.flatnonzero(real & (values > threshold)))


def leak_ratio(displacement: ArrayLike, touched: Sequence[int], virtual: Sequence[int] = ()) -> float:
    """Mean displacement of the joints outside the part over that of the joints inside; 0 is perfectly local.

    Parameters
    ----------
    displacement : ``[J]`` mean displacement of each joint: of positions, or of local rotations (in which a spine that
        turns does not move the arms).
    touched : joints of the part whose style was transferred.
    virtual : joints that count on neither side.

    Returns
    -------
    The ratio; NaN where it is undefined: no joint is left outside the part, or the part itself did not move.

    Raises
    ------
    BadInput : not one-dimensional, empty, not finite, negative; a joint index that does not exist; an empty part.
    """
    values = _displacement(displacement)
    real = ~_members(virtual, len(values), "virtual")
    inside = _members(touched, len(values), "touched")
    if not (inside & real).any():
        raise BadInput("touched must name at least one joint that is not virtual", where="touched")
    moved = float(values[inside & real].mean())
    if moved == 0.0 or not (~inside & real).any():
        return float("nan")
    return float(values[~inside & real].mean()) / moved


def _offsets(source: FloatArray, output: FloatArray, align: Alignment) -> FloatArray:
    offsets = output - source
    if align == "root":
        return np.asarray(offsets - offsets[:, :1])
    if align == "start":
        return np.asarray(offsets - offsets[0, 0] * np.array([1.0, 0.0, 1.0]))
    if align == "none":
        return offsets
    raise BadConfig(f"align must be none, start or root, got {align!r}", where="align")


def _displacement(displacement: ArrayLike) -> FloatArray:
    values = finite_array(displacement, "displacement", (None,))
    if values.min() < 0.0:
        raise BadInput(f"displacement cannot be negative, got {values.min():g}", where="displacement")
    return values


def _members(joints: Sequence[int], n_joints: int, name: str) -> BoolArray:
    """``[J]`` mask of the named joints."""
    mask = np.zeros(n_joints, dtype=np.bool_)
    for joint in joints:
        if not 0 <= joint < n_joints:
            raise BadInput(f"{name} names joint {joint}, but there are {n_joints} joints", where=name)
        mask[joint] = True
    return mask
