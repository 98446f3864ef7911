"""Kernel distance between two sets of features (KID of Binkowski 2018, section 4; KMD in the papers on motion).

Conventions: features are ``[n, d]``, one row a sample; real data comes first; float64. The kernel is the cubic
polynomial (x.y / d + 1)^3. Features are used as given: the kernel is not invariant to their scale, so numbers of two
feature extractors, or of features in other units, cannot be compared. Smaller is better; the estimate is unbiased, so
it scatters around 0 (also below) for two sets of the same distribution, at any n.

- ``kernel_distance``: unbiased MMD^2 over all pairs (no subset averaging, so no randomness).
- ``kernel_replicates``: the same for every replicate of a bootstrap.
- ``conditional_kernel`` and its replicates: mean over labels.
- ``conditional_kid`` and its replicates: the larger of the mean over styles and the mean over contents.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import (
    MIN_REAL,
    ConditionalResult,
    WorseOfTwo,
    check_counts,
    over_labels,
    replicates_over_labels,
)


@dataclass(frozen=True)
class LabelledFeatures:
    """Real and generated features with their labels: one side (style or content) of a conditional distance.

    Attributes
    ----------
    real_features : ``[n, d]``.  real_labels : ``[n]`` integers.
    generated_features : ``[m, d]``.  generated_labels : ``[m]`` integers, the labels that were asked for.
    """

    real_features: ArrayLike
    real_labels: ArrayLike
    generated_features: ArrayLike
    generated_labels: ArrayLike


def kernel_distance(real_features: ArrayLike, generated_features: ArrayLike) -> float:
    """Unbiased squared maximum mean discrepancy under the cubic kernel (Binkowski 2018, eq. 3 and section 4).

    Parameters
    ----------
    real_features : ``[n, d]``.
    generated_features : ``[m, d]``.

    Raises
    ------
    BadInput : NaN or Inf, different d, fewer than two samples.
    """
    real, generated = _checked_pair(real_features, generated_features)
    return _mean_of_pairs(real) + _mean_of_pairs(generated) - 2.0 * float(_cubic(real, generated).mean())


def kernel_replicates(real_features: ArrayLike, generated_features: ArrayLike, counts: NDArray[np.int32]) -> FloatArray:
    """Kernel distance of every bootstrap replicate: ``[B]``.

    A sample that a replicate draws twice is never paired with itself: pairs are weighted w_i w_j over i != j, so
    repetition adds no bias.

    Parameters
    ----------
    real_features : ``[n, d]``, the same in every replicate.
    generated_features : ``[m, d]``.
    counts : ``[B, m]`` how often each generated sample occurs. A replicate with fewer than two different samples is
        NaN.

    Raises
    ------
    BadInput : as ``kernel_distance``, or counts that do not fit.
    """
    real, generated = _checked_pair(real_features, generated_features)
    weights = check_counts(counts, len(generated)).astype(np.float64)
    kernel = _cubic(generated, generated)
    np.fill_diagonal(kernel, 0.0)
    total = weights.sum(axis=1)
    n_pairs = total**2 - np.sum(weights**2, axis=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        within = np.einsum("bn,bn->b", weights @ kernel, weights) / n_pairs
        across = weights @ _cubic(real, generated).mean(axis=0) / total
    values = _mean_of_pairs(real) + within - 2.0 * across
    return np.asarray(np.where(n_pairs > 0, values, np.nan))


def conditional_kernel(
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    *,
    min_real: int = MIN_REAL,
) -> ConditionalResult:
    """Mean over labels of the kernel distance between real and generated samples of that label.

    Labels with fewer than ``min_real`` real samples are left out and named.

    Raises
    ------
    BadInput : wrong shapes, NaN, labels that are not integers.
    """
    return over_labels(
        kernel_distance, real_features, real_labels, generated_features, generated_labels, min_real=min_real
    )


def conditional_kernel_replicates(
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    counts: NDArray[np.int32],
    *,
    min_real: int = MIN_REAL,
) -> FloatArray:
    """``conditional_kernel`` of every bootstrap replicate: ``[B]``."""
    return replicates_over_labels(
        kernel_replicates,
        real_features,
        real_labels,
        generated_features,
        generated_labels,
        counts,
        min_real=min_real,
    )


def conditional_kid(style: LabelledFeatures, content: LabelledFeatures, *, min_real: int = MIN_REAL) -> WorseOfTwo:
    """The larger of (mean over styles, style features) and (mean over contents, content features).

    A copy of the source does well on the second and badly on the first, a copy of the style reference the other way
    round; only motion with both right does well on both.

    Raises
    ------
    BadInput : as ``conditional_kernel``.
    """
    return WorseOfTwo(_conditional(style, min_real), _conditional(content, min_real))


def conditional_kid_replicates(
    style: LabelledFeatures, content: LabelledFeatures, counts: NDArray[np.int32], *, min_real: int = MIN_REAL
) -> FloatArray:
    """``conditional_kid`` of every bootstrap replicate: ``[B]``; the larger is taken within each replicate."""
    sides = [
        conditional_kernel_replicates(
            side.real_features,
            side.real_labels,
            side.generated_features,
            side.generated_labels,
            counts,
            min_real=min_real,
        )
        for side in (style, content)
    ]
    return np.asarray(np.maximum(sides[0], sides[1]))


def _conditional(side: LabelledFeatures, min_real: int) -> ConditionalResult:
    return conditional_kernel(
        side.real_features, side.real_labels, side.generated_features, side.generated_labels, min_real=min_real
    )


def _cubic(first: FloatArray, second: FloatArray) -> FloatArray:
    base = first @ second.T
    base /= first.shape[1]
    base += 1.0
    cube = base * base
    cube *= base
    return cube


def _mean_of_pairs(features: FloatArray) -> float:
    """Mean of the kernel over all pairs of different rows."""
    kernel = _cubic(features, features)
    n = len(features)
    return float((kernel.sum() - np.trace(kernel)) / (n * (n - 1)))


def _checked_pair(real_features: ArrayLike, generated_features: ArrayLike) -> tuple[FloatArray, FloatArray]:
    real = finite_array(real_features, "real_features", (None, None))
    generated = finite_array(generated_features, "generated_features", (None, None))
    for features, name in ((real, "real_features"), (generated, "generated_features")):
        if len(features) < 2:
            raise BadInput(f"{name} must hold at least 2 samples, got {len(features)}", where=name)
    if real.shape[1] != generated.shape[1]:
        raise BadInput(
            f"generated_features must have {real.shape[1]} features like real_features, got {generated.shape[1]}",
            where="generated_features",
            cause="features of two different judges",
        )
    return real, generated
