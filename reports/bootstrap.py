"""Cluster bootstrap: resampling counts shared by all methods of a protocol, so that differences are paired."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

N_REPLICATES = 200


def cluster_counts(clusters: NDArray[Any], n_replicates: int = N_REPLICATES, *, seed: int) -> NDArray[np.int32]:
    """How often each sample occurs in each replicate: ``[B, n]``.

    Whole clusters (content takes) are drawn with replacement, as many as there are. The draw depends on the sorted
    cluster names and ``seed`` only, so two methods scored on the same samples get the same replicates.
    """
    names, index = np.unique(clusters, return_inverse=True)
    rng = np.random.default_rng(seed)
    drawn = rng.integers(0, len(names), size=(n_replicates, len(names)))
    per_cluster = np.stack([np.bincount(row, minlength=len(names)) for row in drawn])
    return per_cluster[:, index].astype(np.int32)


def mean_replicates(values: NDArray[Any], counts: NDArray[np.int32]) -> NDArray[np.float64]:
    """Weighted means of ``values`` ``[n]`` under each replicate's ``counts`` ``[B, n]``: ``[B]``.

    Samples whose value is NaN are left out; a replicate without any sample left is NaN.
    """
    known = np.isfinite(values)
    weights = counts[:, known].astype(np.float64)
    total = weights.sum(axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray((weights @ values[known].astype(np.float64)) / total)


def interval(value: float, replicates: NDArray[np.float64], level: float = 0.95) -> tuple[float, float]:
    """Percentile interval of the replicates, shifted so that their mean lies on ``value``.

    The shift removes the bias that set metrics (Frechet distances above all) pick up from repeated samples.
    """
    known = replicates[np.isfinite(replicates)]
    if known.size == 0:
        return float("nan"), float("nan")
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(known - known.mean(), [tail, 1.0 - tail])
    return float(value + low), float(value + high)
