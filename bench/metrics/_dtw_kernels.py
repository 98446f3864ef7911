"""Compiled loops of dynamic time warping (numba, cached on disk). Inputs are checked by their callers.

The table is filled diagonal by diagonal: the cells of one anti-diagonal do not depend on each other, so the loops
vectorise, and three diagonals of costs are all that is kept. Of every cell two bits stay, which say where it came from:
those of row i on diagonal d lie in byte ``[d // 4, i]`` at bit ``2 * (d % 4)``.
"""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray

Directions = NDArray[np.uint8]


@numba.njit(cache=True, nogil=True)
def fill(a: FloatArray, b_reversed: FloatArray) -> tuple[float, Directions]:
    """Cost of the cheapest path and the direction of every cell.

    Takes ``a [K, N]`` and ``b_reversed [K, M]`` (last frame first), K a multiple of 3. Bit 0 of a direction says that a
    side cell is cheaper than the corner, bit 1 that the left cell is cheaper than the upper one.
    """
    n_channels, n = a.shape
    m = b_reversed.shape[1]
    directions = np.zeros(((n + m + 2) // 4, n), dtype=np.uint8)
    squared = np.empty(n)
    # Entry i + 1 belongs to row i; entry 0 and rows not reached yet are the border, infinitely dear.
    before_last = np.full(n + 1, np.inf)
    last = np.full(n + 1, np.inf)
    current = np.full(n + 1, np.inf)
    before_last[0] = 0.0
    for diagonal in range(n + m - 1):
        low = max(0, diagonal - m + 1)
        length = min(n - 1, diagonal) - low + 1
        shift = m - 1 - diagonal + low
        local = squared[:length]
        local[:] = 0.0
        # Three channels at a time: fewer passes over `local`, and few enough arrays for the compiler to vectorise.
        for channel in range(0, n_channels, 3):
            ax = a[channel, low : low + length]
            ay = a[channel + 1, low : low + length]
            az = a[channel + 2, low : low + length]
            bx = b_reversed[channel, shift : shift + length]
            by = b_reversed[channel + 1, shift : shift + length]
            bz = b_reversed[channel + 2, shift : shift + length]
            for q in range(length):
                local[q] += (ax[q] - bx[q]) ** 2 + (ay[q] - by[q]) ** 2 + (az[q] - bz[q]) ** 2
        corner = before_last[low : low + length]
        up = last[low : low + length]
        left = last[low + 1 : low + 1 + length]
        total = current[low + 1 : low + 1 + length]
        direction = directions[diagonal // 4, low : low + length]
        not_corner = np.uint8(1 << (2 * (diagonal % 4)))
        not_up = np.uint8(2 << (2 * (diagonal % 4)))
        none = np.uint8(0)
        for q in range(length):
            side = min(up[q], left[q])
            total[q] = min(corner[q], side) + np.sqrt(local[q])
            direction[q] |= (not_corner if corner[q] > side else none) | (not_up if up[q] > left[q] else none)
        before_last, last, current = last, current, before_last
        current[0] = np.inf
    return float(last[n]), directions


@numba.njit(cache=True, nogil=True)
def trace(directions: Directions, n: int, m: int) -> IntArray:
    """Walk back from the last cell to the first: ``[L, 2]`` index pairs, first pair first."""
    pairs = np.empty((n + m - 1, 2), dtype=np.int64)
    place = n + m - 2
    i, j = n - 1, m - 1
    pairs[place] = (i, j)
    while i > 0 or j > 0:
        diagonal = i + j
        direction = directions[diagonal // 4, i] >> (2 * (diagonal % 4))
        from_side = direction & 1
        from_left = direction & 2
        if not (from_side and from_left):
            i -= 1
        if not from_side or from_left:
            j -= 1
        place -= 1
        pairs[place] = (i, j)
    return pairs[place:]
