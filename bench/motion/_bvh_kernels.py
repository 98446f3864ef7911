"""Compiled loops of the BVH reader (numba, cached on disk). Inputs are checked by their callers."""

from __future__ import annotations

import numba
import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray

END_OF_BLOCK, ODD_TOKENS_FULL, SHORT_ROW, LONG_ROW, TOO_MANY_ROWS = 0, 1, 2, 3, 4

# A mantissa below 2^53 and a power of ten up to 10^22 are both exact, so one division rounds once: the result is the
# same as that of a correctly rounded parser (Clinger 1990).
_EXACT_MANTISSA = 1 << 53
_POWERS_OF_TEN = np.array([float(10**k) for k in range(23)])
_SPACE, _TAB, _NEWLINE, _CARRIAGE_RETURN = 32, 9, 10, 13
_PLUS, _MINUS, _DOT, _ZERO, _NINE = 43, 45, 46, 48, 57


# Eight characters at a time, the first in the lowest byte (after Lemire's and Mula's digit tricks): "0" to "9" become
# 0 to 9, adding 118 sets the top bit of every other byte, and three multiplications add up the digits.
_ASCII_ZEROS, _ABOVE_NINE = np.uint64(0x3030303030303030), np.uint64(0x7676767676767676)
_TOP_BITS, _PLACES = np.uint64(0x8080808080808080), np.uint64(0x0001020304050607)
_TENS, _PAIRS = np.uint64(2561), np.uint64(0x00FF00FF00FF00FF)
_HUNDREDS, _FOURS = np.uint64(6553601), np.uint64(0x0000FFFF0000FFFF)
_TEN_THOUSANDS = np.uint64(42949672960001)
_NOTHING, _SEVEN, _EIGHT = np.uint64(0), np.uint64(7), np.uint64(8)
_SIXTEEN, _THIRTY_TWO, _FIFTY_SIX, _SIXTY_FOUR = np.uint64(16), np.uint64(32), np.uint64(56), np.uint64(64)
_WHOLE_POWERS_OF_TEN = np.array([10**k for k in range(8)])
_FAST_BYTES = 25
"""Sign, seven digits, point, seven digits and a space, and what loads of eight characters read beyond them."""


@numba.njit(cache=True, nogil=True, inline="always")
def _leading_digits(characters: np.uint64) -> tuple[np.int64, np.int64]:
    """How many of eight characters are digits before the first other one, and their value; 0, 0 for none or eight."""
    digits = characters ^ _ASCII_ZEROS
    others = ((digits + _ABOVE_NINE) | digits) & _TOP_BITS
    first = others & (_NOTHING - others)
    count = ((first >> _SEVEN) * _PLACES) >> _FIFTY_SIX
    if count == _NOTHING:
        return np.int64(0), np.int64(0)
    digits = digits << (_SIXTY_FOUR - count * _EIGHT)
    digits = (digits * _TENS) >> _EIGHT
    digits = ((digits & _PAIRS) * _HUNDREDS) >> _SIXTEEN
    digits = ((digits & _FOURS) * _TEN_THOUSANDS) >> _THIRTY_TWO
    return np.int64(count), np.int64(digits)


@numba.njit(cache=True, nogil=True, inline="always")
def _is_space(byte: np.uint8) -> bool:
    return bool(byte == _SPACE or (byte >= _TAB and byte <= _CARRIAGE_RETURN))


@numba.njit(cache=True, nogil=True)
def parse_rows(
    text: NDArray[np.uint8],
    words: NDArray[np.uint64],
    position: int,
    values: FloatArray,
    index: int,
    on_line: int,
    columns: int,
    odd: IntArray,
) -> tuple[int, int, int, int, int]:
    """Read numbers from ``text[position:]`` into ``values[index:]``, exactly ``columns`` of them on each line.

    ``words[i]`` holds the eight bytes ``text[i:i + 8]``, the first one lowest.

    Tokens that are not plain decimals of at most 53 bits are left to the caller: their start, end and index are put
    into ``odd`` ``[K, 3]``. Resumable: ``on_line`` counts the numbers seen on the current line.

    Returns (status, position, index, on_line, odd tokens written).
    """
    size, n_odd = text.size, 0
    while position < size:
        byte = text[position]
        if _is_space(byte):
            if byte == _NEWLINE:
                if on_line != 0 and on_line != columns:
                    return SHORT_ROW, position, index, on_line, n_odd
                on_line = 0
            position += 1
            continue
        if on_line == columns:
            return LONG_ROW, position, index, on_line, n_odd
        if index == values.size:
            return TOO_MANY_ROWS, position, index, on_line, n_odd
        if n_odd == odd.shape[0]:
            return ODD_TOKENS_FULL, position, index, on_line, n_odd
        start = position
        negative = byte == _MINUS
        if position + _FAST_BYTES <= size:
            point = position + negative
            whole_digits, whole = _leading_digits(words[point])
            point += whole_digits
            fraction_digits, fraction = _leading_digits(words[point + 1])
            end = point + 1 + fraction_digits
            if whole_digits > 0 and fraction_digits > 0 and text[point] == _DOT and _is_space(text[end]):
                value = (whole * _WHOLE_POWERS_OF_TEN[fraction_digits] + fraction) / _POWERS_OF_TEN[fraction_digits]
                values[index] = -value if negative else value
                position = end
                index += 1
                on_line += 1
                continue
        if negative or byte == _PLUS:
            position += 1
        mantissa, digits, decimals, seen_dot = 0, 0, 0, False
        while position < size:
            byte = text[position]
            if byte >= _ZERO and byte <= _NINE:
                if mantissa < _EXACT_MANTISSA:
                    mantissa = mantissa * 10 + (byte - _ZERO)
                digits += 1
                if seen_dot:
                    decimals += 1
            elif byte == _DOT and not seen_dot:
                seen_dot = True
            else:
                break
            position += 1
        if (
            digits > 0
            and mantissa < _EXACT_MANTISSA
            and decimals < 23
            and (position == size or _is_space(text[position]))
        ):
            value = mantissa / _POWERS_OF_TEN[decimals]
            values[index] = -value if negative else value
        else:
            while position < size and not _is_space(text[position]):
                position += 1
            odd[n_odd, 0], odd[n_odd, 1], odd[n_odd, 2] = start, position, index
            n_odd += 1
        index += 1
        on_line += 1
    if on_line != 0 and on_line != columns:
        return SHORT_ROW, position, index, on_line, n_odd
    return END_OF_BLOCK, position, index, on_line, n_odd


@numba.njit(cache=True, nogil=True)
def local_motion(
    values: FloatArray, offsets: FloatArray, rotation_axes: IntArray, rotation_columns: IntArray, columns: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Channel values ``[F, C]`` to local rotations ``[F, J, 4]`` and translations ``[F, J, 3]``; degrees, file units.

    ``rotation_axes`` and ``rotation_columns`` ``[J, 3]`` list the Euler angles of each joint as they are applied, -1
    where there is none; ``columns`` ``[J, 3]`` the columns of its X, Y, Z position, -1 where OFFSET holds.
    """
    frames, joints = values.shape[0], offsets.shape[0]
    rotations = np.empty((frames, joints, 4))
    translations = np.empty((frames, joints, 3))
    half_degree = np.pi / 360.0
    for f in range(frames):
        for j in range(joints):
            for k in range(3):
                column = columns[j, k]
                translations[f, j, k] = offsets[j, k] if column < 0 else values[f, column]
            w, x, y, z = 1.0, 0.0, 0.0, 0.0
            for k in range(3):
                axis = rotation_axes[j, k]
                if axis < 0:
                    break
                half = values[f, rotation_columns[j, k]] * half_degree
                c, s = np.cos(half), np.sin(half)
                if axis == 0:
                    w, x, y, z = w * c - x * s, w * s + x * c, y * c + z * s, z * c - y * s
                elif axis == 1:
                    w, x, y, z = w * c - y * s, x * c - z * s, w * s + y * c, z * c + x * s
                else:
                    w, x, y, z = w * c - z * s, x * c + y * s, y * c - x * s, w * s + z * c
            rotations[f, j, 0], rotations[f, j, 1], rotations[f, j, 2], rotations[f, j, 3] = w, x, y, z
    return rotations, translations


@numba.njit(cache=True, nogil=True)
def world_motion(rotations: FloatArray, translations: FloatArray, parents: IntArray) -> tuple[FloatArray, FloatArray]:
    """Local rotations ``[F, J, 4]`` and translations ``[F, J, 3]`` to world positions and world rotations."""
    frames, joints = rotations.shape[0], rotations.shape[1]
    positions = np.empty((frames, joints, 3))
    world = np.empty((frames, joints, 4))
    for f in range(frames):
        for j in range(joints):
            p = parents[j]
            if p < 0:
                positions[f, j] = translations[f, j]
                world[f, j] = rotations[f, j]
                continue
            w, x, y, z = world[f, p, 0], world[f, p, 1], world[f, p, 2], world[f, p, 3]
            a, b, c = translations[f, j, 0], translations[f, j, 1], translations[f, j, 2]
            tx, ty, tz = 2.0 * (y * c - z * b), 2.0 * (z * a - x * c), 2.0 * (x * b - y * a)
            positions[f, j, 0] = positions[f, p, 0] + a + w * tx + y * tz - z * ty
            positions[f, j, 1] = positions[f, p, 1] + b + w * ty + z * tx - x * tz
            positions[f, j, 2] = positions[f, p, 2] + c + w * tz + x * ty - y * tx
            rw, rx, ry, rz = rotations[f, j, 0], rotations[f, j, 1], rotations[f, j, 2], rotations[f, j, 3]
            world[f, j, 0] = w * rw - x * rx - y * ry - z * rz
            world[f, j, 1] = w * rx + x * rw + y * rz - z * ry
            world[f, j, 2] = w * ry - x * rz + y * rw + z * rx
            world[f, j, 3] = w * rz + x * ry - y * rx + z * rw
    return positions, world
