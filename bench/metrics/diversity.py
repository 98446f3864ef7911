"""Diversity: do outputs fill the space that real motion fills, and do they differ from each other?

Conventions: features are ``[n, d]``, real ones first; distances are Euclidean.

- ``real_balls``: the balls around real samples that reach to their k-th real neighbour.
- ``density``, ``coverage``: how deep in those balls outputs lie, and how many balls hold an output (Naeem 2020).
- ``diversity``, ``multimodality``: distance between outputs, over all and within a class (Guo 2020).
- ``*_replicates``: the same for the replicates of a bootstrap over outputs.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.spatial.distance import cdist

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import check_counts, check_labels

NEAREST_K = 5


def real_balls(real_features: ArrayLike, generated_features: ArrayLike, *, k: int = NEAREST_K) -> BoolArray:
    """Which output lies in which real ball: ``[m, n]`` for ``m`` outputs and ``n`` real samples.

    The ball of a real sample reaches to its ``k``-th nearest other real sample, that one left out.

    Parameters
    ----------
    real_features : ``[n, d]``.
    generated_features : ``[m, d]``.

    Raises
    ------
    BadInput : another shape, NaN, k outside 1..n-1.
    """
    real = finite_array(real_features, "real_features", (None, None))
    generated = finite_array(generated_features, "generated_features", (None, real.shape[1]))
    if not 1 <= k < len(real):
        raise BadInput(f"k must lie in 1..{len(real) - 1} for {len(real)} real samples, got {k}", where="k")
    radii = np.partition(cdist(real, real), k, axis=1)[:, k]
    return np.asarray(cdist(generated, real) < radii)


def density(in_balls: ArrayLike, *, k: int = NEAREST_K) -> FloatArray:
    """Real balls that hold each output, over ``k``: ``[m]``; the mean is the density (Naeem 2020, eq. 4).

    Parameters
    ----------
    in_balls : ``[m, n]``, see ``real_balls``.

    Raises
    ------
    BadInput : not booleans ``[m, n]``, k not positive.
    """
    if k < 1:
        raise BadInput(f"k must be positive, got {k}", where="k")
    return np.asarray(_checked_balls(in_balls).sum(axis=1) / k)


def coverage(in_balls: ArrayLike) -> float:
    """Share of real samples whose ball holds an output, in percent (Naeem 2020, eq. 5).

    Raises
    ------
    BadInput : not booleans ``[m, n]``.
    """
    return float(100.0 * _checked_balls(in_balls).any(axis=0).mean())


def coverage_replicates(in_balls: ArrayLike, counts: NDArray[np.int32]) -> FloatArray:
    """Coverage of every bootstrap replicate: ``[B]`` percent.

    Parameters
    ----------
    in_balls : ``[m, n]``.
    counts : ``[B, m]`` how often each output occurs.

    Raises
    ------
    BadInput : as ``coverage``, or counts that do not fit.
    """
    inside = _checked_balls(in_balls)
    drawn = check_counts(counts, len(inside)) > 0
    return np.asarray(100.0 * ((drawn.astype(np.float32) @ inside.astype(np.float32)) > 0.0).mean(axis=1))


def expected_coverage(n_real: int, n_generated: int, k: int = NEAREST_K) -> float:
    """Coverage in percent of outputs from the real distribution itself (Naeem 2020, appendix).

    ``1 - prod_{i<k} (n - 1 - i) / (n + m - 1 - i)`` for n real samples and m outputs: among its n + m - 1 neighbours a
    real sample's k nearest are all real with that product's probability.

    Raises
    ------
    BadInput : k outside 1..n_real-1, no outputs.
    """
    if not 1 <= k < n_real or n_generated < 1:
        raise BadInput(f"k must lie in 1..{n_real - 1} and outputs must exist, got {k} and {n_generated}", where="k")
    drawn = np.arange(k)
    return float(100.0 * (1.0 - np.prod((n_real - 1.0 - drawn) / (n_real + n_generated - 1.0 - drawn))))


def diversity(features: ArrayLike) -> float:
    """Mean distance of two different outputs ``[n, d]``.

    Guo 2020 (Action2Motion, section 5.1) estimates it from 200 random pairs; here all pairs count, so that nothing is
    drawn.

    Raises
    ------
    BadInput : fewer than 2 outputs, NaN.
    """
    distances = _pairwise(features)
    return float(distances.sum() / (len(distances) * (len(distances) - 1)))


def diversity_replicates(features: ArrayLike, counts: NDArray[np.int32]) -> FloatArray:
    """Diversity of every bootstrap replicate ``[B]``; pairs of an output with itself are left out.

    Raises
    ------
    BadInput : as ``diversity``, or counts that do not fit.
    """
    distances = _pairwise(features)
    sums, pairs = _weighted(distances, check_counts(counts, len(distances)))
    with np.errstate(invalid="ignore"):
        return np.asarray(sums / pairs)


def multimodality(features: ArrayLike, labels: ArrayLike) -> float:
    """Mean over classes of the mean distance of two different outputs of the class; NaN where no class has two.

    Guo 2020 (Action2Motion, section 5.1) estimates it from 20 random pairs a class; here all pairs count. Classes with
    a single output are left out.

    Parameters
    ----------
    features : ``[n, d]``.
    labels : ``[n]`` the classes that were asked for.

    Raises
    ------
    BadInput : NaN, labels that are not integers or of another length.
    """
    found, classes = _checked_classes(features, labels)
    values = [diversity(found[classes == c]) for c in np.unique(classes) if (classes == c).sum() > 1]
    return float(np.mean(values)) if values else float("nan")


def multimodality_replicates(features: ArrayLike, labels: ArrayLike, counts: NDArray[np.int32]) -> FloatArray:
    """Multimodality of every bootstrap replicate ``[B]``; a class with fewer than two different outputs is left out.

    Raises
    ------
    BadInput : as ``multimodality``, or counts that do not fit.
    """
    found, classes = _checked_classes(features, labels)
    weights = check_counts(counts, len(found))
    total, scored = np.zeros(len(weights)), np.zeros(len(weights))
    for label in np.unique(classes):
        members = classes == label
        sums, pairs = _weighted(cdist(found[members], found[members]), weights[:, members])
        total += np.divide(sums, pairs, out=np.zeros(len(weights)), where=pairs > 0)
        scored += pairs > 0
    with np.errstate(invalid="ignore"):
        return np.asarray(total / scored)


def _weighted(distances: FloatArray, counts: NDArray[np.int32]) -> tuple[FloatArray, FloatArray]:
    """Sum of distances ``[B]`` over the ordered pairs of different outputs, and how many pairs there are."""
    weights = counts.astype(np.float64)
    sums = np.einsum("bi,bi->b", weights @ distances, weights)
    return sums, weights.sum(axis=1) ** 2 - (weights**2).sum(axis=1)


def _pairwise(features: ArrayLike) -> FloatArray:
    found = finite_array(features, "features", (None, None))
    if len(found) < 2:
        raise BadInput("features must hold at least 2 outputs, got 1", where="features")
    return np.asarray(cdist(found, found))


def _checked_classes(features: ArrayLike, labels: ArrayLike) -> tuple[FloatArray, NDArray[np.int64]]:
    found = finite_array(features, "features", (None, None))
    return found, check_labels(labels, "labels", len(found))


def _checked_balls(in_balls: ArrayLike) -> BoolArray:
    inside = np.asarray(in_balls)
    if inside.dtype != np.bool_ or inside.ndim != 2 or 0 in inside.shape:
        raise BadInput(f"in_balls must be booleans [m, n], got {inside.dtype} {list(inside.shape)}", where="in_balls")
    return inside
