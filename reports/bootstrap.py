"""Cluster bootstrap: resampling counts shared by all rows that are compared, so that differences are paired."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

N_REPLICATES = 200
"""stored for every number, in its samples file"""
N_RECOMPUTED = 1000
"""drawn anew for numbers that are means of stored per-sample values"""


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


def pooled_strata(strata: NDArray[Any], clusters: NDArray[Any]) -> NDArray[np.intp]:
    """Stratum of every sample as a number ``[n]``, strata of a single cluster pooled (with the smallest if need be).

    A stratum of one cluster would never change under resampling, and so claim to be known exactly.
    """
    _, first, cluster = np.unique(clusters, return_index=True, return_inverse=True)
    _, stratum = np.unique(strata[first], return_inverse=True)
    sizes = np.bincount(stratum)
    pool = [int(name) for name in np.argsort(sizes, kind="stable") if sizes[name] < 2]
    if len(pool) == 1 and len(sizes) > 1:
        pool.append(int(np.argsort(sizes, kind="stable")[1]))
    stratum = np.where(np.isin(stratum, pool), pool[0], stratum) if pool else stratum
    return np.asarray(np.unique(stratum, return_inverse=True)[1][cluster], dtype=np.intp)


def stratified_replicates(
    values: NDArray[Any],
    clusters: NDArray[Any],
    strata: NDArray[np.intp],
    n_replicates: int = N_RECOMPUTED,
    *,
    seed: int = 0,
) -> NDArray[np.float64]:
    """Replicates ``[B]`` of the mean of ``values`` ``[n]`` when content takes are drawn again within each stratum.

    Tasks are laid out with a fixed number of samples of every content (:mod:`bench.protocols.transfer`), so what
    varies between two task lists is the takes, not the mix of contents: each stratum's mean is resampled by its own
    takes and keeps its weight. Deviations from a stratum's mean are stretched by ``sqrt(m / (m - 1))`` for its ``m``
    takes, as drawing m of m shrinks the variance by (m - 1) / m (Rao and Wu 1988, JASA 83, section 2). The draw depends
    on the sorted cluster names, the strata and ``seed`` only, so rows scored on the same samples get the same takes.
    NaN values do not count; a replicate that leaves a stratum without a value is NaN.

    Raises
    ------
    ValueError : no value is finite, or a stratum has a single cluster.
    """
    known = np.isfinite(values)
    if not known.any():
        raise ValueError("replicates of no values")
    rng = np.random.default_rng(seed)
    mean = np.zeros(n_replicates)
    for name in np.unique(strata):
        inside = strata == name
        _, cluster = np.unique(clusters[inside], return_inverse=True)
        m = int(cluster.max()) + 1
        if m < 2:
            raise ValueError("a stratum needs at least 2 clusters: pool the strata first")
        places = rng.integers(0, m, size=(n_replicates, m)) + m * np.arange(n_replicates)[:, None]
        drawn = np.bincount(places.reshape(-1), minlength=n_replicates * m).reshape(n_replicates, m).astype(np.float64)
        n = np.bincount(cluster, known[inside], minlength=m)
        if n.sum() == 0.0:
            continue
        own = float(values[inside][known[inside]].mean(dtype=np.float64))
        offsets = np.bincount(cluster, np.where(known, values - own, 0.0)[inside], minlength=m)
        with np.errstate(invalid="ignore", divide="ignore"):
            deviations = (drawn @ offsets) / (drawn @ n)
        mean += float(n.sum() / known.sum()) * (own + np.sqrt(m / (m - 1.0)) * deviations)
    return mean


def interval(value: float, replicates: NDArray[np.float64], level: float = 0.95) -> tuple[float, float]:
    """Percentile interval of the replicates, shifted so that their mean lies on ``value``.

    The shift removes the bias that set metrics (Frechet distances above all) pick up from repeated samples. Quantiles
    are placed at ``k / (B + 1)``, which leaves the stated share outside whatever B is.
    """
    known = replicates[np.isfinite(replicates)]
    if known.size == 0:
        return float("nan"), float("nan")
    tail = (1.0 - level) / 2.0
    low, high = np.quantile(known - known.mean(), [tail, 1.0 - tail], method="weibull")
    return float(value + low), float(value + high)
