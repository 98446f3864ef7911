"""Array types and the shared checks at the door of every pure function."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.errors import BadInput

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]


def finite_array(values: ArrayLike, name: str, shape: tuple[int | None, ...]) -> FloatArray:
    """Return ``values`` as float64 after checking its shape and that all of it is finite.

    Parameters
    ----------
    values : anything array-like.
    name : the argument's name, for the message.
    shape : expected shape; ``None`` stands for any length of at least 1.

    Raises
    ------
    BadInput : wrong number of axes, wrong length of an axis, an empty axis, or NaN / Inf.
    """
    array = np.asarray(values, dtype=np.float64)
    wanted = "[" + ", ".join("any" if n is None else str(n) for n in shape) + "]"
    fits = array.ndim == len(shape) and all(
        have > 0 and (n is None or have == n) for have, n in zip(array.shape, shape, strict=False)
    )
    if not fits:
        raise BadInput(f"{name} must have shape {wanted}, got {list(array.shape)}", where=name)
    if not np.isfinite(array).all():
        bad = int(array.size - np.isfinite(array).sum())
        raise BadInput(f"{name} must be finite, got {bad} NaN or Inf of {array.size} values", where=name)
    return array


def read_only(array: NDArray[Any]) -> NDArray[Any]:
    """A view of ``array`` that refuses to be written to."""
    view = array.view()
    view.flags.writeable = False
    return view
