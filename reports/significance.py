"""Statistics on plain arrays: paired differences of bootstrap replicates, Holm's correction, ranks with ties."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from reports.bootstrap import interval

LEVEL = 0.95
SIGNIFICANCE = 0.04
"""Level of the tests behind the promise that equal methods share a rank 95 % of the time: on synthetic task lists
(``tests/reports/test_significance.py``) tests at 0.05 separate them in 5.3 %, at 0.04 in 4.3 %."""


@dataclass(frozen=True)
class Difference:
    """A minus B on the same samples."""

    value: float
    low: float
    high: float
    p: float
    """two-sided, not corrected for the number of comparisons"""


def replicate_difference(
    value_a: float,
    value_b: float,
    replicates_a: NDArray[np.float64],
    replicates_b: NDArray[np.float64],
    degrees_of_freedom: float,
) -> Difference:
    """Difference A - B with its 95 % interval and p-value, from paired replicates ``[B]`` each.

    Replicate b of both methods must come from the same resampled clusters. The interval is the percentile interval of
    the replicate differences, shifted onto the measured difference (``bootstrap.interval``). The p-value is Student's,
    with the replicates' standard deviation as standard error: counting among 200 replicates could not go below 0.01 and
    would leave nothing separable after Holm's correction.

    Raises
    ------
    ValueError : shapes differ, less than one degree of freedom, or fewer than half of the replicates are finite.
    """
    if replicates_a.shape != replicates_b.shape or replicates_a.ndim != 1:
        raise ValueError(f"paired replicates must be [B] twice, got {replicates_a.shape} and {replicates_b.shape}")
    if degrees_of_freedom < 1.0:
        raise ValueError(f"a difference needs at least 2 clusters, got {degrees_of_freedom:g} degrees of freedom")
    differences = replicates_a - replicates_b
    differences = differences[np.isfinite(differences)]
    if 2 * differences.size < replicates_a.size or differences.size < 2:
        raise ValueError(f"only {differences.size} of {replicates_a.size} replicate differences are finite")
    value = float(value_a - value_b)
    low, high = interval(value, differences, LEVEL, degrees_of_freedom)
    return Difference(value, low, high, _two_sided_p(value, float(differences.std(ddof=1)), degrees_of_freedom))


def _two_sided_p(value: float, standard_error: float, degrees_of_freedom: float) -> float:
    """Student's two-sided p. Without any spread a difference is either none at all (1) or certain (0)."""
    if standard_error < 1e-12 * max(1.0, abs(value)):
        return 1.0 if abs(value) < 1e-12 else 0.0
    return float(2.0 * stats.t.sf(abs(value) / standard_error, degrees_of_freedom))


def holm(p_values: Sequence[float]) -> NDArray[np.float64]:
    """Holm's step-down adjusted p-values ``[m]``, in the order given (Holm 1979, Scand. J. Statist. 6, p. 65).

    Comparing them with 0.05 keeps the chance of any false separation in the family at 5 % or less.

    Raises
    ------
    ValueError : a p-value is not in [0, 1].
    """
    given = np.asarray(p_values, dtype=np.float64)
    if given.size and not bool(np.all((given >= 0.0) & (given <= 1.0))):
        raise ValueError("p-values must lie in [0, 1] and not be NaN")
    order = np.argsort(given, kind="stable")
    stepped = given[order] * np.arange(given.size, 0, -1)
    adjusted = np.empty_like(given)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(stepped))
    return adjusted


def leader_ranks(separable: NDArray[np.bool_]) -> list[int]:
    """Ranks with ties of methods sorted best first, from the symmetric matrix ``[m, m]`` of who is separable from whom.

    The first method leads rank 1. Going down, each method takes the rank of the best leader it is not separable from;
    one that is separable from every leader so far becomes a leader itself, and its rank is its place (from 1).
    So all of a rank are not separable from that rank's leader; two methods of different ranks need not be separable
    from each other.
    """
    leaders: list[int] = []
    ranks: list[int] = []
    for place in range(len(separable)):
        tied = [leader for leader in leaders if not separable[place, leader]]
        if tied:
            ranks.append(tied[0] + 1)
        else:
            leaders.append(place)
            ranks.append(place + 1)
    return ranks


def pareto_front(points: NDArray[Any]) -> NDArray[np.bool_]:
    """Which of ``points`` ``[m, k]`` (higher is better on every axis) no other point dominates: ``[m]``.

    A point is dominated if another is at least as good on every axis and better on one. Points with NaN are never on
    the front and dominate nothing.
    """
    values = np.asarray(points, dtype=np.float64)
    known = np.isfinite(values).all(axis=1)
    others, own = values[None, :, :], values[:, None, :]
    at_least = np.all(others >= own, axis=2)
    better = np.any(others > own, axis=2)
    dominated = np.any(at_least & better & known, axis=1)
    return np.asarray(known & ~dominated)


def mean_and_sd(values: Sequence[float]) -> tuple[float, float | None]:
    """Mean and sample standard deviation (None for a single value) of trials or seeds.

    Raises
    ------
    ValueError : no values.
    """
    if not values:
        raise ValueError("mean of no values")
    array = np.asarray(values, dtype=np.float64)
    return float(array.mean()), float(array.std(ddof=1)) if array.size > 1 else None
