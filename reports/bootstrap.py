"""Cluster bootstrap: resampling counts shared by all rows that are compared, so that differences are paired."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy import stats

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


@dataclass(frozen=True, eq=False)
class Layout:
    """How samples were laid out: content takes within contents, and their resampling.

    Tasks have a fixed number of samples of every content (:mod:`bench.protocols.transfer`), so what varies between two
    task lists is the takes, not the mix of contents. Drawing takes from all contents alike would add the differences
    between contents to every interval, and make it far too wide.

    Attributes
    ----------
    cluster : content take of each sample as a number ``[n]``.
    stratum : content of each sample as a number ``[n]``; every stratum has at least two takes.
    """

    cluster: NDArray[np.intp]
    stratum: NDArray[np.intp]

    @classmethod
    def of(cls, clusters: NDArray[Any], strata: NDArray[Any]) -> Layout:
        """From names of takes and contents ``[n]`` each. Contents of a single take are pooled, with the smallest if
        need be: alone they would never change under resampling, and so claim to be known exactly.

        Raises
        ------
        ValueError : fewer than two takes.
        """
        _, first, cluster = np.unique(clusters, return_index=True, return_inverse=True)
        if len(first) < 2:
            raise ValueError(f"a cluster bootstrap needs at least 2 clusters, got {len(first)}")
        _, stratum = np.unique(strata[first], return_inverse=True)
        sizes = np.bincount(stratum)
        by_size = np.argsort(sizes, kind="stable")
        pool = by_size[: max(2, int((sizes < 2).sum()))] if sizes.min() < 2 else by_size[:0]
        stratum = np.where(np.isin(stratum, pool), pool[0], stratum) if pool.size else stratum
        return cls(cluster, np.asarray(np.unique(stratum, return_inverse=True)[1][cluster], dtype=np.intp))

    @property
    def n_clusters(self) -> int:
        """Number of takes."""
        return int(self.cluster.max()) + 1

    def replicates(
        self, values: NDArray[Any], n_replicates: int = N_RECOMPUTED, *, seed: int = 0
    ) -> NDArray[np.float64]:
        """Replicates ``[B]`` of the mean of ``values`` ``[n]`` when takes are drawn again within each content.

        Every content keeps its weight. Deviations from its mean are stretched: drawing m of m takes shrinks the
        variance by (m - 1) / m (Rao and Wu 1988, JASA 83, section 2), and by 1 - sum of squared shares of the values
        where takes are of different size. The draw depends on the layout and ``seed`` only, so rows scored on the same
        samples get the same takes. NaN values do not count; a replicate that leaves a content without a value is NaN.

        Raises
        ------
        ValueError : no value is finite.
        """
        rng = np.random.default_rng(seed)
        mean = np.zeros(n_replicates)
        for part in self._parts(values):
            m = len(part.n)
            places = rng.integers(0, m, size=(n_replicates, m)) + m * np.arange(n_replicates)[:, None]
            drawn = np.bincount(places.reshape(-1), minlength=n_replicates * m).reshape(n_replicates, m)
            if part.weight == 0.0:
                continue
            with np.errstate(invalid="ignore", divide="ignore"):
                deviations = (drawn @ part.offsets) / (drawn @ part.n)
            mean += part.weight * (part.mean + deviations / np.sqrt(part.variance_kept))
        return mean

    def degrees_of_freedom(self, values: NDArray[Any]) -> float:
        """Of the standard error of the mean: Satterthwaite 1946, Biometrics 2, eq. 17, over contents.

        Number of takes less number of contents if all contents have as many takes and vary alike, fewer if one with
        few takes decides.

        Raises
        ------
        ValueError : no value is finite.
        """
        total, squares, most = 0.0, 0.0, 0
        for part in self._parts(values):
            m = int((part.n > 0.0).sum())
            most += max(m - 1, 0)
            if m > 1:
                spread = float((part.offsets**2).sum()) / float(part.n.sum()) ** 2
                variance = part.weight**2 * spread / part.variance_kept
                total += variance
                squares += variance**2 / (m - 1.0)
        return float(max(most, 1)) if squares == 0.0 else total**2 / squares

    def _parts(self, values: NDArray[Any]) -> Iterator[_Stratum]:
        known = np.isfinite(values)
        if not known.any():
            raise ValueError("replicates of no values")
        exact = np.where(known, values, 0.0).astype(np.float64)
        for name in range(int(self.stratum.max()) + 1):
            inside = self.stratum == name
            _, cluster = np.unique(self.cluster[inside], return_inverse=True)
            n = np.bincount(cluster, known[inside]).astype(np.float64)
            weight = float(n.sum() / known.sum())
            mean = float(exact[inside].sum() / n.sum()) if weight else 0.0
            offsets = np.bincount(cluster, exact[inside]) - mean * n
            yield _Stratum(n, offsets, mean, weight)


class _Stratum(NamedTuple):
    """One content.

    Attributes
    ----------
    n : ``[m]`` values that count, of each take.
    offsets : ``[m]`` sum of each take's values less the content's mean.
    mean : of the content.
    weight : its share of all values.
    """

    n: NDArray[np.float64]
    offsets: NDArray[np.float64]
    mean: float
    weight: float

    @property
    def variance_kept(self) -> float:
        """Share of the variance of the mean that is left when takes are drawn again; 1 with a single take."""
        kept = 1.0 - float(((self.n / self.n.sum()) ** 2).sum())
        return kept if kept > 0.0 else 1.0


def interval(
    value: float, replicates: NDArray[np.float64], level: float = 0.95, degrees_of_freedom: float = np.inf
) -> tuple[float, float]:
    """Percentile interval of the replicates, shifted so that their mean lies on ``value``.

    The shift removes the bias that set metrics (Frechet distances above all) pick up from repeated samples. Quantiles
    are placed at ``k / (B + 1)``, which leaves the stated share outside whatever B is. Few degrees of freedom widen the
    interval as Student's quantile is wider than the normal one: the replicates' own spread is an estimate too.
    """
    known = replicates[np.isfinite(replicates)]
    if known.size == 0:
        return float("nan"), float("nan")
    tail = (1.0 - level) / 2.0
    widened = float(stats.t.ppf(1.0 - tail, degrees_of_freedom) / stats.norm.ppf(1.0 - tail))
    low, high = widened * np.quantile(known - known.mean(), [tail, 1.0 - tail], method="weibull")
    return float(value + low), float(value + high)
