"""Set distances against the number of samples: how much of a Frechet distance is the size of the set."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray
from bench.metrics.frechet import frechet_distance
from bench.metrics.kernel import kernel_distance
from bench.protocols.base import stable_seed
from reports.trust import Curve

SIZES = (100, 150, 200, 300, 400, 600, 800, 1000)
DRAWS = 20
FEWEST_SAMPLES = 300
"""Fewer leave no curve."""
DISTANCES: dict[str, Callable[[FloatArray, FloatArray], float]] = {
    "fmd[stgcn-content]": lambda real, generated: frechet_distance(real, generated).value,
    "kid[stgcn-content]": kernel_distance,
}


def curve(
    method: str, title: str, metric: str, real: NDArray[np.float32], generated: NDArray[np.float32], draws: int = DRAWS
) -> Curve:
    """Distance of random subsets of ``generated`` ``[S, n, d]`` from all of ``real`` ``[S, m, d]``.

    Subsets are drawn without replacement, the same for every row and judge seed; sizes over n are left out.
    """
    rng = np.random.default_rng(stable_seed("curve", metric))
    n = generated.shape[1]
    sizes = tuple(size for size in SIZES if size <= n)
    exact_real, exact = real.astype(np.float64), generated.astype(np.float64)
    points = np.array(
        [[_over_seeds(metric, exact_real, exact[:, rng.permutation(n)[:size]]) for _ in range(draws)] for size in sizes]
    )
    spread = points.std(axis=1, ddof=1) if draws > 1 else np.zeros(len(sizes))
    return Curve(
        method=method, title=title, metric=metric, n=sizes, mean=tuple(points.mean(axis=1).tolist()),
        sd=tuple(spread.tolist()),
    )  # fmt: skip


def _over_seeds(metric: str, real: FloatArray, generated: FloatArray) -> float:
    return float(np.mean([DISTANCES[metric](a, b) for a, b in zip(real, generated, strict=True)]))
