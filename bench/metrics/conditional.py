"""Distances between distributions, label by label.

Conventions: features are ``[n, d]``, labels are integers ``[n]``; the label of a generated sample is the one that was
asked for, never the one a judge saw. Real data comes first.

- ``over_labels``: mean over labels of any distance between two feature sets.
- ``replicates_over_labels``: the same for the replicates of a bootstrap.
- ``WorseOfTwo``: the larger of the mean over styles and the mean over contents (a copy of the source is bad on the
  first, a copy of the style reference on the second).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.arrays import FloatArray, IntArray, finite_array
from bench.errors import BadInput

MIN_REAL = 20
MIN_GENERATED = 2


@dataclass(frozen=True)
class ConditionalResult:
    """Mean over labels of a distance.

    Attributes
    ----------
    value : the mean over ``per_label``; NaN where no label could be scored.
    per_label : distance of each scored label.
    left_out : labels with too few real samples, and how many there were.
    too_few_generated : labels with fewer than 2 generated samples, and how many there were.
    reason : why ``value`` is NaN; empty otherwise.
    warning : what a reader of the number should know; empty otherwise.
    """

    value: float
    per_label: dict[int, float]
    left_out: dict[int, int]
    too_few_generated: dict[int, int]
    reason: str = ""
    warning: str = ""


@dataclass(frozen=True)
class WorseOfTwo:
    """The same distance conditioned on style and on content; ``value`` is the larger (NaN if either is)."""

    style: ConditionalResult
    content: ConditionalResult

    @property
    def value(self) -> float:
        return float(np.maximum(self.style.value, self.content.value))


@dataclass(frozen=True)
class _Cells:
    """Row indices of every scored label, and what was left out."""

    real: dict[int, IntArray]
    generated: dict[int, IntArray]
    left_out: dict[int, int]
    too_few_generated: dict[int, int]


def check_labels(labels: ArrayLike, name: str, n: int) -> IntArray:
    """``labels`` as ``[n]`` int64.

    Raises
    ------
    BadInput : not integers, another length, or a negative label (the mark of an unlabelled take).
    """
    array = np.asarray(labels)
    if array.ndim != 1 or len(array) != n or n == 0:
        raise BadInput(f"{name} must have shape [{n}], got {list(array.shape)}", where=name)
    if array.dtype.kind not in "iu":
        raise BadInput(f"{name} must be integer labels, got {array.dtype}", where=name, remedy="number the labels")
    if (array < 0).any():
        raise BadInput(f"{name} must not be negative, got {int(array.min())}", where=name, cause="an unlabelled take")
    return array.astype(np.int64)


def over_labels(
    distance: Callable[[FloatArray, FloatArray], float],
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    *,
    min_real: int = MIN_REAL,
) -> ConditionalResult:
    """Mean over labels of ``distance(real features of the label, generated features of the label)``.

    Labels with fewer than ``min_real`` real or fewer than 2 generated samples are left out and named. Every label
    counts the same, however many samples it has.

    Raises
    ------
    BadInput : wrong shapes, NaN, labels that are not integers or do not match the features.
    """
    real = finite_array(real_features, "real_features", (None, None))
    generated = finite_array(generated_features, "generated_features", (None, real.shape[1]))
    cells = _cells(real, real_labels, generated, generated_labels, min_real)
    per_label = {label: distance(real[rows], generated[cells.generated[label]]) for label, rows in cells.real.items()}
    value = float(np.mean(list(per_label.values()))) if per_label else float("nan")
    reason = "" if per_label else f"no label has {min_real} real and {MIN_GENERATED} generated samples"
    return ConditionalResult(value, per_label, cells.left_out, cells.too_few_generated, reason)


def replicates_over_labels(
    replicates: Callable[[FloatArray, FloatArray, NDArray[np.int32]], FloatArray],
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    counts: NDArray[np.int32],
    *,
    min_real: int = MIN_REAL,
) -> FloatArray:
    """Replicates ``[B]`` of ``over_labels``; ``counts`` ``[B, n]`` says how often each generated sample is drawn.

    A label that a replicate left without two different samples is NaN there and not counted in that replicate's mean.
    """
    real = finite_array(real_features, "real_features", (None, None))
    generated = finite_array(generated_features, "generated_features", (None, real.shape[1]))
    weights = check_counts(counts, len(generated))
    cells = _cells(real, real_labels, generated, generated_labels, min_real)
    if not cells.real:
        return np.full(len(weights), np.nan)
    rows = [
        replicates(real[rows], generated[cells.generated[label]], weights[:, cells.generated[label]])
        for label, rows in cells.real.items()
    ]
    table = np.stack(rows)
    known = np.isfinite(table)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.where(known, table, 0.0).sum(axis=0) / known.sum(axis=0))


def check_counts(counts: ArrayLike, n: int) -> NDArray[np.int32]:
    """``counts`` as ``[B, n]`` int32: how often each of ``n`` samples occurs in each of ``B`` replicates.

    Raises
    ------
    BadInput : another shape, negative or fractional counts.
    """
    array = np.asarray(counts)
    if array.ndim != 2 or array.shape[1] != n or len(array) == 0:
        raise BadInput(f"counts must have shape [replicates, {n}], got {list(array.shape)}", where="counts")
    if array.dtype.kind not in "iu" or (array < 0).any():
        raise BadInput("counts must be non-negative integers", where="counts", remedy="use reports.bootstrap")
    return array.astype(np.int32)


def _cells(
    real: FloatArray, real_labels: ArrayLike, generated: FloatArray, generated_labels: ArrayLike, min_real: int
) -> _Cells:
    of_real = check_labels(real_labels, "real_labels", len(real))
    of_generated = check_labels(generated_labels, "generated_labels", len(generated))
    cells = _Cells({}, {}, {}, {})
    for label in np.union1d(of_real, of_generated).tolist():
        real_rows, generated_rows = np.flatnonzero(of_real == label), np.flatnonzero(of_generated == label)
        if len(real_rows) < max(min_real, 2):
            cells.left_out[label] = len(real_rows)
        elif len(generated_rows) < MIN_GENERATED:
            cells.too_few_generated[label] = len(generated_rows)
        else:
            cells.real[label], cells.generated[label] = real_rows, generated_rows
    return cells
