"""Numbers of rows from records and samples files: estimates, paired differences, ranks with ties, variance split."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from reports.bootstrap import interval
from reports.draws import draws_of, paired_draws
from reports.records import BadRecord, Better, Measurement
from reports.rows import Row, StoredRecord, check_comparable, groups, load_run, rows_of
from reports.significance import (
    LEVEL,
    SIGNIFICANCE,
    Difference,
    holm,
    leader_ranks,
    mean_and_sd,
    pareto_front,
    replicate_difference,
)

__all__ = [
    "Estimate",
    "Row",
    "StoredRecord",
    "VarianceSplit",
    "badness",
    "check_comparable",
    "estimate",
    "front",
    "groups",
    "holm",
    "load_run",
    "paired_difference",
    "ranked_order",
    "rows_of",
    "sorted_rows",
    "tie_groups",
    "variance_split",
]


@dataclass(frozen=True)
class Estimate:
    """One number of one row: the mean over the row's seeds and trials."""

    value: float | None
    low: float | None
    high: float | None
    n: int
    unit: str
    better: Better
    floor: float | None
    seeds: int
    """how many records the mean is taken over"""
    seed_sd: float | None
    """standard deviation between those records; None for a single one"""
    judge_sd: float | None
    """standard deviation between judge seeds, averaged over the records"""
    reason: str | None
    """why the value is undefined, or a warning that belongs beside it"""


@dataclass(frozen=True)
class VarianceSplit:
    """Standard deviations that one number would show if only that one source were drawn again; None if unknown."""

    judge_seed: float | None
    method_seed: float | None
    task_sampling: float | None


def estimate(row: Row, metric: str, slice_name: str) -> Estimate | None:
    """Mean over the row's records with its interval, or None if no record has the measurement.

    The interval says how far the number would move on other tasks with the same trained weights
    (:func:`reports.draws.draws_of`). With several seeds it comes from the replicates averaged over seeds; ``seed_sd``
    stands beside it and is not part of it.
    """
    found = row.measurements(metric, slice_name)
    if not found:
        return None
    known = [measurement for measurement in found if measurement.value is not None]
    values = [measurement.value for measurement in known if measurement.value is not None]
    value, seed_sd = mean_and_sd(values) if values else (None, None)
    low, high = _inside_unit(*_interval(row, known, metric, slice_name, value), found[0])
    floors = [measurement.floor for measurement in found if measurement.floor is not None]
    reasons = [measurement.reason for measurement in found if measurement.reason]
    return Estimate(
        value=value,
        low=low,
        high=high,
        n=min(measurement.n for measurement in (known or found)),
        unit=found[0].unit,
        better=found[0].better,
        floor=float(np.mean(floors)) if floors else None,
        seeds=len(values),
        seed_sd=seed_sd,
        judge_sd=_judge_sd(known),
        reason=reasons[0] if reasons else None,
    )


def _interval(
    row: Row, known: Sequence[Measurement], metric: str, slice_name: str, value: float | None
) -> tuple[float | None, float | None]:
    if value is None:
        return None, None
    draws = draws_of(row, metric, slice_name)
    if draws is None:
        return (known[0].low, known[0].high) if len(known) == 1 else (None, None)
    low, high = interval(value, draws.replicates, LEVEL, draws.degrees_of_freedom)
    return (low, high) if np.isfinite(low) else (None, None)


def _inside_unit(low: float | None, high: float | None, kind: Measurement) -> tuple[float | None, float | None]:
    """Shifting an interval onto its value can push it out of what a percentage can be."""
    if kind.unit != "%" or low is None or high is None:
        return low, high
    # Only shares of samples end at 100; bone drift does not.
    return max(low, 0.0), min(high, 100.0) if kind.better == "higher" else high


def _judge_sd(known: Sequence[Measurement]) -> float | None:
    spreads = [mean_and_sd(measurement.judge_values)[1] for measurement in known if measurement.judge_values]
    defined = [spread for spread in spreads if spread is not None]
    return float(np.sqrt(np.mean(np.square(defined)))) if defined else None


def paired_difference(row_a: Row, row_b: Row, metric: str, slice_name: str) -> Difference | None:
    """A minus B on the same samples (each averaged over its seeds), or None where either has no value or replicates.

    Raises
    ------
    BadRecord : the two rows were not scored on the same samples.
    """
    a, b = estimate(row_a, metric, slice_name), estimate(row_b, metric, slice_name)
    if a is None or b is None or a.value is None or b.value is None:
        return None
    draws_a, draws_b = (draws_of(row, metric, slice_name) for row in (row_a, row_b))
    if draws_a is None or draws_b is None:
        return None
    _check_same_samples(row_a, row_b)
    try:
        return replicate_difference(a.value, b.value, *paired_draws(draws_a, draws_b))
    except ValueError as error:
        raise BadRecord(f"{row_a.method.name} against {row_b.method.name}, {metric}|{slice_name}: {error}") from error


def _check_same_samples(row_a: Row, row_b: Row) -> None:
    first = row_a.samples[0]
    for row in (row_a, row_b):
        for samples in row.samples:
            for name in ("sample_id", "cluster"):
                if not np.array_equal(first[name], samples[name]):
                    raise BadRecord(
                        f"{row_a.method.name} and {row_b.method.name} were not scored on the same samples ({name}): "
                        "their difference is not paired; run both with the same protocol and profile"
                    )


def tie_groups(rows: Sequence[Row], metric: str, slice_name: str) -> dict[str, int]:
    """Rank of each method that can carry one, by row name; methods that are not separable share a rank.

    Ranked are rows of kind method with status ok, not marked ``copies``, with a value and replicates. Every two of
    them are compared (:func:`paired_difference`); two are *separable* if Holm's adjusted p over all these comparisons
    is below ``SIGNIFICANCE``. Sorted by value, best first, each method takes the rank of the best group leader it is
    not separable from, or leads a new group whose rank is its place (:func:`reports.significance.leader_ranks`).
    """
    ranked = ranked_order(rows, metric, slice_name)
    pairs = list(combinations(range(len(ranked)), 2))
    found = [paired_difference(ranked[a], ranked[b], metric, slice_name) for a, b in pairs]
    adjusted = holm([1.0 if difference is None else difference.p for difference in found])
    separable = np.zeros((len(ranked), len(ranked)), dtype=np.bool_)
    for (a, b), p in zip(pairs, adjusted, strict=True):
        separable[a, b] = separable[b, a] = p < SIGNIFICANCE
    return {row.method.row_name: rank for row, rank in zip(ranked, leader_ranks(separable), strict=True)}


def ranked_order(rows: Sequence[Row], metric: str, slice_name: str) -> list[Row]:
    """The rows that can carry a rank, best first; equal values in order of method name."""
    able = [row for row in rows if row.can_rank and draws_of(row, metric, slice_name) is not None]
    return [row for row in sorted_rows(able, metric, slice_name) if badness(row, metric, slice_name) < np.inf]


def sorted_rows(rows: Iterable[Row], metric: str, slice_name: str) -> list[Row]:
    """Rows best first by one metric; rows without a value last; ties in order of method name."""
    return sorted(rows, key=lambda row: (badness(row, metric, slice_name), row.method.row_name))


def badness(row: Row, metric: str, slice_name: str) -> float:
    """A number that is lower for better rows, infinite where the value is undefined."""
    found = row.measurements(metric, slice_name)
    values = [measurement.value for measurement in found if measurement.value is not None]
    if not values:
        return float("inf")
    value, _ = mean_and_sd(values)
    return {"higher": -value, "lower": value, "one": abs(value - 1.0), "none": 0.0}[found[0].better]


def variance_split(row: Row, metric: str, slice_name: str) -> VarianceSplit:
    """How much a row's number owes to the judge seed, the method's own seed and the sampling of tasks."""
    found = estimate(row, metric, slice_name)
    if found is None or found.value is None:
        return VarianceSplit(None, None, None)
    draws = draws_of(row, metric, slice_name)
    return VarianceSplit(
        judge_seed=found.judge_sd,
        method_seed=found.seed_sd,
        task_sampling=float(np.nanstd(draws.replicates, ddof=1)) if draws else None,
    )


def front(rows: Sequence[Row], metrics: Sequence[str], slice_name: str) -> tuple[str, ...]:
    """Names of the rows no other of ``rows`` beats on all ``metrics`` at once (Pareto front), in the order given."""
    points = np.array([[-badness(row, metric, slice_name) for metric in metrics] for row in rows]).reshape(
        len(rows), len(metrics)
    )
    return tuple(row.method.row_name for row, on_front in zip(rows, pareto_front(points), strict=True) if on_front)
