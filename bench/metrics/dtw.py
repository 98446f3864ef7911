"""Dynamic time warping of trajectories, exact and with path; FastDTW as the papers' named backend.

Local cost is the Euclidean distance of two frames, steps are (1, 0), (0, 1) and (1, 1), every step weighs the same and
the path runs from the first pair of frames to the last (Salvador and Chan 2007, section 2). Where predecessors cost the
same, the exact backend goes back along the diagonal first, then up (one frame of ``a``), then left (of ``b``).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import fastdtw
import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, IntArray, finite_array
from bench.errors import BadConfig, BadInput
from bench.metrics import _dtw_kernels

Backend = Literal["exact", "fastdtw"]

FASTDTW_RADIUS = 1
"""FastDTW's own default; the papers that use it state no other."""


@dataclass(frozen=True, eq=False)
class DtwPath:
    """How the frames of two trajectories correspond.

    Attributes
    ----------
    pairs : ``[L, 2]`` index pairs (frame of a, frame of b), from (0, 0) to (n - 1, m - 1), never decreasing.
    cost : sum over the pairs of their Euclidean distance, in the unit of the trajectories.
    backend : which algorithm found it.
    """

    pairs: IntArray
    cost: float
    backend: Backend

    def distances(self, a: FloatArray, b: FloatArray) -> FloatArray:
        """``[L]`` Euclidean distance of every pair; ``a [n, k]`` and ``b [m, k]`` are the trajectories aligned."""
        return np.asarray(np.linalg.norm(a[self.pairs[:, 0]] - b[self.pairs[:, 1]], axis=1))


def dtw(a: ArrayLike, b: ArrayLike, backend: Backend = "exact") -> DtwPath:
    """Align two trajectories in time.

    Swapping ``a`` and ``b`` leaves the exact cost as it is; where several paths cost the same, the tie rule may then
    choose another one. The exact backend needs about n m / 4 bytes.

    Parameters
    ----------
    a, b : ``[n, k]`` and ``[m, k]``, one frame a row.
    backend : ``"exact"``, or ``"fastdtw"`` (radius 1), whose path may cost more and whose ties fall as they fall there.

    Raises
    ------
    BadInput : ``a`` or ``b`` is empty, not finite, not two-dimensional, so large that costs overflow, or k differs.
    BadConfig : no such backend.
    """
    a_array = finite_array(a, "a", (None, None))
    b_array = finite_array(b, "b", (None, a_array.shape[1]))
    if backend == "exact":
        pairs, cost = _exact(a_array, b_array)
    elif backend == "fastdtw":
        pairs, cost = _fast(a_array, b_array)
    else:
        raise BadConfig(f"backend must be exact or fastdtw, got {backend!r}", where="backend")
    if not np.isfinite(cost):
        raise BadInput("a and b are so large that their distances overflow", where="a, b", cause="a broken motion")
    return DtwPath(pairs, cost, backend)


def fastdtw_build() -> Literal["compiled", "pure-python"]:
    """Which form of the ``fastdtw`` package is installed.

    A plain ``pip install fastdtw`` falls back to the pure-Python form without a word where its extension does not
    compile. Both give the same path; only their speed differs.
    """
    return "compiled" if fastdtw.fastdtw.__module__.endswith("._fastdtw") else "pure-python"


def _exact(a: FloatArray, b: FloatArray) -> tuple[IntArray, float]:
    """Lay the frames out as the kernel reads them, channels first: whole strips of ``a``, ``b`` turned round."""
    (n, k), m, lanes = a.shape, len(b), _dtw_kernels.LANES
    strips = np.zeros((k, lanes * -(-n // lanes)))
    strips[:, :n] = a.T
    reversed_b = np.zeros((k, m + 2 * (lanes - 1)))
    reversed_b[:, lanes - 1 : lanes - 1 + m] = b[::-1].T
    cost, directions = _dtw_kernels.fill(strips, reversed_b, n, m)
    if not np.isfinite(cost):
        return np.zeros((0, 2), dtype=np.int64), cost
    return _dtw_kernels.trace(directions, n, m), float(cost)


def _fast(a: FloatArray, b: FloatArray) -> tuple[IntArray, float]:
    cost, pairs = fastdtw.fastdtw(a, b, radius=FASTDTW_RADIUS, dist=2)
    return np.asarray(pairs, dtype=np.int64), float(cost)
