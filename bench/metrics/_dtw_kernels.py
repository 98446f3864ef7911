"""Compiled loops of dynamic time warping (numba, cached on disk). Inputs are checked by their callers.

The table is filled in strips of 16 rows. One step moves through all rows of a strip, each one column behind the row
above it: such cells do not depend on each other and stay in vector registers. numba has no type for those, so the first
half of this file makes one; the second half is the algorithm.
"""

# mypy: allow-untyped-calls

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numba
import numpy as np
from llvmlite import ir  # type: ignore[import-untyped]
from numba import float64, intp, uint16
from numba.core import cgutils
from numba.extending import intrinsic, models, register_model
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray

Directions = NDArray[np.uint16]

LANES = 16
"""Rows of a strip: several registers on every processor, so that a step need not wait for the one before it."""

VECTOR = ir.VectorType(ir.DoubleType(), LANES)
INDEX = ir.IntType(32)


class VectorType(numba.types.Type):
    """``LANES`` numbers in registers, as a type of compiled code."""


@register_model(VectorType)
class VectorModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: Any) -> None:
        super().__init__(manager, kind, VECTOR)


vector = VectorType("vector")


def operation(result: Any, *parameters: Any) -> Callable[[Callable[..., Any]], Any]:
    """Make a function of compiled code from one that writes its instructions: ``(builder, *values) -> result``."""

    def decorate(write: Callable[..., Any]) -> Any:
        def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
            return write(builder, *values)

        if len(parameters) == 1:
            return intrinsic(lambda typing, x: (result(*parameters), code))
        return intrinsic(lambda typing, x, y: (result(*parameters), code))

    return decorate


@operation(vector, float64)
def everywhere(builder: Any, value: Any) -> Any:
    lanes = ir.Constant(VECTOR, ir.Undefined)
    for place in range(LANES):
        lanes = builder.insert_element(lanes, value, INDEX(place))
    return lanes


@operation(vector, vector, vector)
def plus(builder: Any, x: Any, y: Any) -> Any:
    return builder.fadd(x, y)


@operation(vector, vector, vector)
def squared_difference(builder: Any, x: Any, y: Any) -> Any:
    difference = builder.fsub(x, y)
    return builder.fmul(difference, difference)


@operation(vector, vector)
def root(builder: Any, x: Any) -> Any:
    kind = ir.FunctionType(VECTOR, [VECTOR])
    return builder.call(cgutils.get_or_insert_function(builder.module, kind, f"llvm.sqrt.v{LANES}f64"), [x])


@operation(vector, vector, vector)
def smaller(builder: Any, x: Any, y: Any) -> Any:
    return builder.select(builder.fcmp_ordered("<", x, y), x, y)


@operation(uint16, vector, vector)
def exceeds(builder: Any, x: Any, y: Any) -> Any:
    """Bit k says whether lane k of x is greater than lane k of y."""
    return builder.bitcast(builder.fcmp_ordered(">", x, y), ir.IntType(LANES))


@operation(vector, vector, float64)
def pushed(builder: Any, x: Any, value: Any) -> Any:
    """The value in lane 0, every lane of x in the next one; the last lane drops out."""
    single = builder.insert_element(ir.Constant(VECTOR, ir.Undefined), value, INDEX(0))
    order = ir.Constant(ir.VectorType(INDEX, LANES), [LANES, *range(LANES - 1)])
    return builder.shuffle_vector(x, single, order)


@operation(float64, vector, intp)
def lane(builder: Any, x: Any, place: Any) -> Any:
    return builder.extract_element(x, place)


def _loaded(typing: Any, array: Any, row: Any, column: Any) -> Any:
    """Entries ``[row, column : column + LANES]`` of a C-contiguous array."""

    def code(context: Any, builder: Any, signature: Any, values: Any) -> Any:
        kind = signature.args[0]
        entries = context.make_array(kind)(context, builder, values[0])
        place = cgutils.get_item_pointer(context, builder, kind, entries, values[1:], wraparound=False)
        return builder.load(builder.bitcast(place, VECTOR.as_pointer()), align=8)

    return vector(array, intp, intp), code


loaded: Any = intrinsic(_loaded)


@numba.njit(cache=True, nogil=True)
def fill(a: FloatArray, b_reversed: FloatArray, n: int, m: int) -> tuple[float, Directions]:
    """Cost of the cheapest path and the direction of every cell.

    ``a [K, N]`` has its n frames first and is filled up to whole strips; ``b_reversed [K, LANES - 1 + m + LANES - 1]``
    has its m frames, last one first, in the middle. What the fillings hold does not matter. Directions are
    ``[strip, step, 2]``: bit k of the first word says that a side cell is cheaper than the corner for row k of the
    strip, which is at column step - k; bit k of the second that the left cell is cheaper than the upper one.
    """
    n_channels = len(a)
    n_strips = a.shape[1] // LANES
    directions = np.empty((n_strips, m + LANES - 1, 2), dtype=np.uint16)
    row_above = np.full(m + LANES - 1, np.inf)
    endless = everywhere(np.inf)
    for strip in range(n_strips):
        top = strip * LANES
        bottom = min(LANES, n - top) - 1
        corner = pushed(endless, 0.0 if strip == 0 else np.inf)
        left = endless
        for step in range(m + bottom):
            squared = everywhere(0.0)
            for channel in range(n_channels):
                here, there = loaded(a, channel, top), loaded(b_reversed, channel, m + LANES - 2 - step)
                squared = plus(squared, squared_difference(here, there))
            up = pushed(left, row_above[step])
            side = smaller(up, left)
            directions[strip, step, 0] = exceeds(corner, side)
            directions[strip, step, 1] = exceeds(up, left)
            left = plus(smaller(corner, side), root(squared))
            corner = up
            if step >= bottom:
                row_above[step - bottom] = lane(left, bottom)
    return row_above[m - 1], directions


@numba.njit(cache=True, nogil=True)
def trace(directions: Directions, n: int, m: int) -> IntArray:
    """Walk back from the last cell to the first: ``[L, 2]`` index pairs, first pair first."""
    pairs = np.empty((n + m - 1, 2), dtype=np.int64)
    place = n + m - 2
    i, j = n - 1, m - 1
    pairs[place] = (i, j)
    while i > 0 or j > 0:
        strip, row = i // LANES, i % LANES
        from_side = directions[strip, j + row, 0] >> row & 1
        from_left = directions[strip, j + row, 1] >> row & 1
        if not (from_side and from_left):
            i -= 1
        if not from_side or from_left:
            j -= 1
        place -= 1
        pairs[place] = (i, j)
    return pairs[place:]
