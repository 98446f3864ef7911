"""Recognition by judges: does a classifier see the content and the style that were asked for?

Conventions: labels are integer indices ``[n]``; ``true`` is what was asked for, ``predicted`` what the judge saw, and
``true`` comes first. The primary product is one value a sample (so that bootstraps can be made); numbers are means of
those in percent.

- ``correct``, ``top_k_correct``: CRA and SRA of the papers (Park 2021, section 7), one boolean a sample.
- ``joint_correct``: content and style both right on the same sample. The primary number.
- ``kept_source_style``: still judged to have the source's style (source-style residue).
- ``percent``: the mean of any of these.
- ``balanced_accuracy_percent``: mean over classes of recall.
- ``majority_rate_percent``, ``chance_percent``: what a judge that knows nothing gets.
- ``confusion_matrix``, ``per_class``, ``per_condition``: tables.
- ``over_judges``: mean and spread over judge seeds.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.arrays import BoolArray, FloatArray, IntArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import check_counts, check_labels


@dataclass(frozen=True)
class Share:
    """A share of ``n`` samples in percent; NaN where n is 0."""

    percent: float
    n: int


@dataclass(frozen=True)
class EnsembleResult:
    """Mean over judges and their standard deviation (ddof 1; NaN for one judge, where a spread is undefined)."""

    mean: float
    sd: float
    n_judges: int


def correct(true: ArrayLike, predicted: ArrayLike) -> BoolArray:
    """Whether each sample was recognised: ``[n]``.

    Raises
    ------
    BadInput : not integer labels, negative labels, different lengths, no samples.
    """
    asked, seen = _checked_pair(true, predicted)
    return np.asarray(asked == seen)


def top_k_correct(true: ArrayLike, log_probabilities: ArrayLike, k: int) -> BoolArray:
    """Whether the true class ``[n]`` is among the ``k`` most probable of ``log_probabilities`` ``[n, C]``: ``[n]``.

    Of equally probable classes the one with the lower index counts as the more probable, as in ``argmax``.

    Raises
    ------
    BadInput : not ``[n, C]``, NaN (minus infinity is allowed), another number of labels, labels that are not integers
        in 0..C-1, k outside 1..C.
    """
    scores = np.asarray(log_probabilities, dtype=np.float64)
    if scores.ndim != 2 or 0 in scores.shape:
        raise BadInput(
            f"log_probabilities must have shape [n, classes], got {list(scores.shape)}", where="log_probabilities"
        )
    if n_bad := int((np.isnan(scores) | np.isposinf(scores)).sum()):
        raise BadInput(
            f"log_probabilities must be finite or -Inf, got {n_bad} NaN or +Inf of {scores.size} values",
            where="log_probabilities",
        )
    labels = check_labels(true, "true", len(scores))
    _check_range(labels, "true", scores.shape[1])
    if not 1 <= k <= scores.shape[1]:
        raise BadInput(f"k must lie in 1..{scores.shape[1]}, got {k}", where="k")
    own = scores[np.arange(len(scores)), labels][:, None]
    ahead = (scores > own) | ((scores == own) & (np.arange(scores.shape[1]) < labels[:, None]))
    return np.asarray(ahead.sum(axis=1) < k)


def joint_correct(content_correct: ArrayLike, style_correct: ArrayLike) -> BoolArray:
    """Whether content and style are both right on the same sample: ``[n]``.

    Raises
    ------
    BadInput : not booleans, different lengths.
    """
    content, style = _checked_bools(content_correct, "content_correct"), _checked_bools(style_correct, "style_correct")
    if len(content) != len(style):
        raise BadInput(f"style_correct must have length {len(content)}, got {len(style)}", where="style_correct")
    return np.asarray(content & style)


def kept_source_style(source_styles: ArrayLike, target_styles: ArrayLike, predicted_styles: ArrayLike) -> FloatArray:
    """1 where a sample is still judged to have its source's style, else 0: ``[n]``.

    NaN where source and target style are the same: nothing was to be removed. ``percent`` leaves those out.

    Raises
    ------
    BadInput : not integer labels, negative labels, different lengths.
    """
    source, target = _checked_pair(source_styles, target_styles, names=("source_styles", "target_styles"))
    predicted = check_labels(predicted_styles, "predicted_styles", len(source))
    return np.where(source == target, np.nan, (predicted == source).astype(np.float64))


def percent(values: ArrayLike) -> Share:
    """Mean of per-sample values ``[n]`` (booleans, or floats in 0..1) in percent; NaN samples are left out of n.

    Raises
    ------
    BadInput : not one axis, no samples, values outside 0..1.
    """
    checked = _checked_shares(values)
    known = checked[np.isfinite(checked)]
    return Share(100.0 * float(known.mean()) if known.size else float("nan"), int(known.size))


def balanced_accuracy_percent(true: ArrayLike, predicted: ArrayLike) -> float:
    """Mean over the classes that occur in ``true`` of the share of them that was recognised, in percent.

    Raises
    ------
    BadInput : as ``correct``.
    """
    asked, seen = _checked_pair(true, predicted)
    return float(np.mean([share.percent for share in per_class(asked, asked == seen).values()]))


def balanced_accuracy_replicates(true: ArrayLike, predicted: ArrayLike, counts: NDArray[np.int32]) -> FloatArray:
    """``balanced_accuracy_percent`` of every bootstrap replicate ``[B]``; ``counts`` is ``[B, n]``.

    A class that a replicate lacks is not counted in it; a replicate without samples is NaN.
    """
    asked, seen = _checked_pair(true, predicted)
    weights = check_counts(counts, len(asked)).astype(np.float64)
    classes, index = np.unique(asked, return_inverse=True)
    member = (index[:, None] == np.arange(len(classes))).astype(np.float64)
    n = weights @ member
    with np.errstate(invalid="ignore", divide="ignore"):
        recall = (weights @ (member * (asked == seen)[:, None])) / n
        return np.asarray(100.0 * np.where(n > 0, recall, 0.0).sum(axis=1) / (n > 0).sum(axis=1))


def majority_rate_percent(true: ArrayLike) -> float:
    """Accuracy of always answering the most frequent class of ``true`` ``[n]``, in percent."""
    labels = check_labels(true, "true", np.asarray(true).size)
    return 100.0 * float(np.bincount(labels).max() / len(labels))


def chance_percent(n_classes: int) -> float:
    """Accuracy of a uniform guess among ``n_classes``, in percent."""
    if n_classes < 1:
        raise BadInput(f"n_classes must be at least 1, got {n_classes}", where="n_classes")
    return 100.0 / n_classes


def confusion_matrix(true: ArrayLike, predicted: ArrayLike, n_classes: int) -> IntArray:
    """Counts ``[n_classes, n_classes]``: row = true class, column = predicted class.

    Raises
    ------
    BadInput : as ``correct``, or labels outside 0..n_classes-1.
    """
    asked, seen = _checked_pair(true, predicted)
    _check_range(asked, "true", n_classes)
    _check_range(seen, "predicted", n_classes)
    return np.bincount(asked * n_classes + seen, minlength=n_classes**2).reshape(n_classes, n_classes)


def per_class(true: ArrayLike, values: ArrayLike) -> dict[int, Share]:
    """``percent`` of per-sample ``values`` ``[n]`` for every class that occurs in ``true`` ``[n]``."""
    checked = _checked_shares(values)
    labels = check_labels(true, "true", len(checked))
    return {label: percent(checked[labels == label]) for label in np.unique(labels).tolist()}


def per_condition(values: ArrayLike, conditions: Mapping[str, ArrayLike]) -> dict[str, Share]:
    """``percent`` of per-sample ``values`` ``[n]`` within each named boolean mask ``[n]``; an empty mask gives NaN, 0.

    Raises
    ------
    BadInput : a mask that is not boolean or has another length.
    """
    checked = _checked_shares(values)
    table: dict[str, Share] = {}
    for name, mask in conditions.items():
        kept = _checked_bools(mask, f"conditions[{name!r}]")
        if len(kept) != len(checked):
            raise BadInput(f"the mask must have length {len(checked)}, got {len(kept)}", where=f"conditions[{name!r}]")
        table[name] = percent(checked[kept]) if kept.any() else Share(float("nan"), 0)
    return table


def over_judges(values: ArrayLike) -> EnsembleResult:
    """Mean and spread of one number over judge seeds: ``values`` ``[S]``.

    Raises
    ------
    BadInput : no judges, NaN.
    """
    checked = finite_array(values, "values", (None,))
    sd = float(checked.std(ddof=1)) if len(checked) > 1 else float("nan")
    return EnsembleResult(float(checked.mean()), sd, len(checked))


def share_of_judges(values: ArrayLike) -> FloatArray:
    """Mean over judges of per-sample values ``[S, n]``: ``[n]``, the share of judges that recognised each sample.

    A sample that is NaN for a judge (``kept_source_style``) stays NaN.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 2 or array.size == 0:
        raise BadInput(f"values must have shape [judges, n], got {list(array.shape)}", where="values")
    return np.asarray(np.mean([_checked_shares(row) for row in array], axis=0))


def _checked_pair(
    first: ArrayLike, second: ArrayLike, *, names: tuple[str, str] = ("true", "predicted")
) -> tuple[IntArray, IntArray]:
    checked = check_labels(first, names[0], np.asarray(first).size)
    return checked, check_labels(second, names[1], len(checked))


def _checked_bools(values: ArrayLike, name: str) -> BoolArray:
    array = np.asarray(values)
    if array.ndim != 1 or array.size == 0 or array.dtype != np.bool_:
        raise BadInput(f"{name} must be booleans [n], got {array.dtype} {list(array.shape)}", where=name)
    return array


def _checked_shares(values: ArrayLike) -> FloatArray:
    array = np.asarray(values, dtype=np.float64)
    if array.ndim != 1 or array.size == 0:
        raise BadInput(f"values must have shape [any], got {list(array.shape)}", where="values")
    known = array[~np.isnan(array)]
    if ((known < 0.0) | (known > 1.0)).any():
        raise BadInput("values must lie in 0..1", where="values", cause="values that are already in percent")
    return array


def _check_range(labels: IntArray, name: str, n_classes: int) -> None:
    if labels.max() >= n_classes:
        raise BadInput(f"{name} must lie in 0..{n_classes - 1}, got {int(labels.max())}", where=name)
