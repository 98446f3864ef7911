"""Frechet distance between two sets of features (FID of Heusel 2017, section 3, eq. 6; FMD in the papers on motion).

Conventions: features are ``[n, d]``, one row a sample; real data comes first; all arithmetic is float64. The number is
in squared feature units, so it says nothing across feature extractors.

- ``frechet_distance``: the exact path, valid for any finite input, also with fewer samples than features.
- ``frechet_replicates``: the same number for every replicate of a bootstrap, by a Cholesky factor.
- ``frechet_floor``: real against real at the same n: what a perfect method would get.
- ``conditional_frechet``: mean over labels.
- ``PrincipalComponents``: the leading components in which the conditional form and ``fmd[dae]`` are taken.

Seams: features -> ``feature_statistics`` -> ``frechet_between`` -> number. A statistic keeps a factor R of the
covariance (R'R = S) instead of the covariance itself: the trace of the root of S_x S_y is the nuclear norm of R_x R_y',
which needs no matrix root and loses no digits on rank-deficient sets.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import (
    MIN_REAL,
    ConditionalResult,
    check_counts,
    over_labels,
    replicates_over_labels,
)

EPS = float(np.finfo(np.float64).eps)
EXACT_TOLERANCE, FAST_TOLERANCE = 4e-13, 1e-11
"""Largest bound on the rounding of a sum of root eigenvalues, per trace. The rounding itself stayed below a quarter of
every bound accepted so (spectra of two and three levels, powers, logarithmic ones): single errors go either way."""
SAFE_PIVOT_RATIO = 1e-5
LARGE = 256


@dataclass(frozen=True)
class FeatureStatistics:
    """Mean ``[d]``, factor ``[k, d]`` with factor' factor = covariance (k = min(n - 1, d)), and sample count n."""

    mean: FloatArray
    factor: FloatArray
    n: int


@dataclass(frozen=True)
class FrechetResult:
    """A Frechet distance with what is needed to read it.

    Attributes
    ----------
    value : squared feature units. Rounding can leave it below zero by at most 1e-13 of the trace.
    d : number of features.
    rank : number of dimensions in which both sets vary together (numerical rank of R_x R_y').
    n_real, n_generated : sample counts.
    trace : sum of both covariance traces, the scale of the rounding error.
    warning : why the number should not be shown (fewer than 2 d samples); empty otherwise.
    """

    value: float
    d: int
    rank: int
    n_real: int
    n_generated: int
    trace: float
    warning: str = ""

    @property
    def shown(self) -> float | None:
        """The number a table may print: None where there is a warning."""
        return None if self.warning else self.value


@dataclass(frozen=True)
class FloorResult:
    """Mean and standard deviation (NaN for one draw) of real-against-real distances over ``n_draws`` draws of ``n``."""

    value: float
    sd: float
    n: int
    n_draws: int
    with_replacement: bool


@dataclass(frozen=True)
class PrincipalComponents:
    """Leading principal components of a feature set.

    Attributes
    ----------
    mean : ``[D]``.
    directions : ``[d, D]`` orthonormal rows, largest variance first; the entry of largest magnitude is positive.
    explained_share : share of the variance that the d components hold.
    """

    mean: FloatArray
    directions: FloatArray
    explained_share: float

    @classmethod
    def fit(cls, features: ArrayLike, n_components: int) -> PrincipalComponents:
        """Fit on ``features`` ``[n, D]``.

        Raises
        ------
        BadInput : NaN, or fewer than ``n_components`` directions of non-zero variance.
        """
        statistics = feature_statistics(_checked(features, "features"))
        _, singular, rows = np.linalg.svd(statistics.factor, full_matrices=False)
        rank = _numerical_rank(singular, max(statistics.factor.shape))
        if not 1 <= n_components <= rank:
            raise BadInput(
                f"n_components must lie in 1..{rank} (the rank of features), got {n_components}", where="n_components"
            )
        rows = rows[:n_components]
        peak = np.take_along_axis(rows, np.abs(rows).argmax(axis=1)[:, None], axis=1)
        variance = singular**2
        return cls(statistics.mean, rows * np.sign(peak), float(variance[:n_components].sum() / variance.sum()))

    def apply(self, features: ArrayLike) -> FloatArray:
        """Coordinates ``[n, d]`` of ``features`` ``[n, D]``; not whitened, so distances keep their units."""
        checked = finite_array(features, "features", (None, len(self.mean)))
        return np.asarray((checked - self.mean) @ self.directions.T)


def feature_statistics(features: ArrayLike, counts: NDArray[np.int32] | None = None) -> FeatureStatistics:
    """Statistics of ``features`` ``[n, d]``, each row taken ``counts`` ``[n]`` times (once by default).

    Raises
    ------
    BadInput : not ``[n, d]``, NaN or Inf, fewer than two samples.
    """
    checked = _checked(features, "features")
    if counts is None:
        return _statistics(checked, np.ones(len(checked)))
    kept = check_counts(np.asarray(counts)[None], len(checked))[0]
    if kept.sum() < 2:
        raise BadInput(f"counts must keep at least 2 samples, got {kept.sum()}", where="counts")
    return _statistics(checked[kept > 0], kept[kept > 0].astype(np.float64))


def frechet_between(real: FeatureStatistics, generated: FeatureStatistics) -> FrechetResult:
    """Frechet distance of two Gaussians: |mu_x - mu_y|^2 + tr S_x + tr S_y - 2 |R_x R_y'|_nuclear."""
    d = len(real.mean)
    trace = float(np.vdot(real.factor, real.factor) + np.vdot(generated.factor, generated.factor))
    fewer, more = sorted((real.factor, generated.factor), key=len)
    singular = _singular_values(more @ fewer.T, trace)
    value = float(np.sum((real.mean - generated.mean) ** 2) + trace - 2.0 * singular.sum())
    fewest = min(real.n, generated.n)
    warning = f"n = {fewest} is below 2 d = {2 * d}: the number would be mostly bias" if fewest < 2 * d else ""
    return FrechetResult(value, d, _numerical_rank(singular, d), real.n, generated.n, trace, warning)


def frechet_distance(real_features: ArrayLike, generated_features: ArrayLike) -> FrechetResult:
    """Frechet distance between ``real_features`` ``[n, d]`` and ``generated_features`` ``[m, d]``.

    Exact for any finite input: n below d, dead features and any scale (Heusel 2017, eq. 6).

    Raises
    ------
    BadInput : NaN or Inf, different d, fewer than two samples.
    """
    real, generated = (_statistics(x, np.ones(len(x))) for x in _checked_pair(real_features, generated_features))
    return frechet_between(real, generated)


def frechet_replicates(
    real_features: ArrayLike, generated_features: ArrayLike, counts: NDArray[np.int32]
) -> FloatArray:
    """Frechet distance of every bootstrap replicate: ``[B]``.

    With S_x = L L', the trace of the root of S_x S_y is the sum of root eigenvalues of L' S_y L. Where the real
    covariance is not safely positive definite, or the eigenvalues of a replicate are too small for 1e-10 of the trace,
    the exact path is taken instead.

    Parameters
    ----------
    real_features : ``[n, d]``, the same in every replicate.
    generated_features : ``[m, d]``.
    counts : ``[B, m]`` how often each generated sample occurs. A replicate with fewer than two different samples is
        NaN.

    Raises
    ------
    BadInput : as ``frechet_distance``, or counts that do not fit.
    """
    real, generated = _checked_pair(real_features, generated_features)
    weights = check_counts(counts, len(generated))
    fast = _FastPath.prepare(real, generated)
    exact: FeatureStatistics | None = None
    values = np.full(len(weights), np.nan)
    for b, row in enumerate(weights):
        if np.count_nonzero(row) < 2:
            continue
        value = fast.distance(row) if fast else None
        if value is None:
            exact = exact or feature_statistics(real)
            value = frechet_between(exact, feature_statistics(generated, row)).value
        values[b] = value
    return values


def frechet_floor(
    real_features: ArrayLike,
    disjoint_features: ArrayLike,
    n: int,
    *,
    n_draws: int = 10,
    rng: np.random.Generator,
) -> FloorResult:
    """Distance from ``real_features`` to ``n`` samples of other real motion, mean over ``n_draws`` draws.

    Draws are without replacement where ``disjoint_features`` has n rows, with replacement otherwise (the result says
    so: repeated rows add no information and the floor is then a little too high).

    Raises
    ------
    BadInput : as ``frechet_distance``; n below 2; n_draws below 1.
    """
    real, disjoint = _checked_pair(real_features, disjoint_features, second_name="disjoint_features")
    if n < 2 or n_draws < 1:
        raise BadInput(f"n must be at least 2 and n_draws at least 1, got {n} and {n_draws}", where="n, n_draws")
    with_replacement = n > len(disjoint)
    reference = feature_statistics(real)
    drawn = [disjoint[rng.choice(len(disjoint), n, replace=with_replacement)] for _ in range(n_draws)]
    values = [frechet_between(reference, feature_statistics(rows)).value for rows in drawn]
    sd = float(np.std(values, ddof=1)) if n_draws > 1 else float("nan")
    return FloorResult(float(np.mean(values)), sd, n, n_draws, with_replacement)


def conditional_frechet(
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    *,
    min_real: int = MIN_REAL,
) -> ConditionalResult:
    """Mean over labels of the Frechet distance between real and generated samples of that label.

    Labels with fewer than ``min_real`` real samples are left out and named; labels scored on fewer than 2 d samples
    are named in ``warning``. Meant for few features: take ``PrincipalComponents`` first.

    Raises
    ------
    BadInput : wrong shapes, NaN, labels that are not integers.
    """
    thin: list[str] = []

    def distance(real: FloatArray, generated: FloatArray) -> float:
        result = frechet_distance(real, generated)
        thin.extend([result.warning] if result.warning else [])
        return result.value

    result = over_labels(distance, real_features, real_labels, generated_features, generated_labels, min_real=min_real)
    if not thin:
        return result
    return replace(result, warning=f"{len(thin)} of {len(result.per_label)} labels have fewer than 2 d samples")


def conditional_frechet_replicates(
    real_features: ArrayLike,
    real_labels: ArrayLike,
    generated_features: ArrayLike,
    generated_labels: ArrayLike,
    counts: NDArray[np.int32],
    *,
    min_real: int = MIN_REAL,
) -> FloatArray:
    """``conditional_frechet`` of every bootstrap replicate: ``[B]``."""
    return replicates_over_labels(
        frechet_replicates,
        real_features,
        real_labels,
        generated_features,
        generated_labels,
        counts,
        min_real=min_real,
    )


@dataclass(frozen=True)
class _FastPath:
    """Everything about a pair of feature sets that no replicate changes."""

    real_trace: float
    mean_gap: FloatArray
    centred: FloatArray
    mapped: FloatArray
    squared_norms: FloatArray

    @classmethod
    def prepare(cls, real: FloatArray, generated: FloatArray) -> _FastPath | None:
        """None where the real covariance is not safely positive definite."""
        real_mean = real.mean(axis=0)
        deviation = real - real_mean
        covariance = scipy.linalg.blas.dsyrk(1.0 / (len(real) - 1), deviation.T, lower=1)
        trace = float(np.trace(covariance))
        try:
            lower = scipy.linalg.cholesky(covariance, lower=True, overwrite_a=True, check_finite=False)
        except np.linalg.LinAlgError:
            return None
        pivots = np.diag(lower)
        if pivots.min() < SAFE_PIVOT_RATIO * pivots.max():
            return None
        mean = generated.mean(axis=0)
        centred = generated - mean
        norms = np.einsum("nd,nd->n", centred, centred)
        mapped = scipy.linalg.blas.dtrmm(1.0, lower, centred.T, lower=1, trans_a=1).T
        return cls(trace, mean - real_mean, centred, mapped, norms)

    def distance(self, counts: NDArray[np.int32]) -> float | None:
        """The distance with each generated row taken ``counts`` times; None where rounding would show."""
        rows = np.flatnonzero(counts)
        if len(rows) <= self.mapped.shape[1]:
            return None
        weights = counts.astype(np.float64)
        n = weights.sum()
        shift = weights @ self.centred / n
        trace = self.real_trace + (weights @ self.squared_norms - n * (shift @ shift)) / (n - 1)
        scaled = self.mapped[rows]
        scaled -= weights @ self.mapped / n
        scaled *= np.sqrt(weights[rows] / (n - 1))[:, None]
        roots, rounding = _root_eigenvalues(scaled)
        if rounding > FAST_TOLERANCE * trace:
            return None
        gap = self.mean_gap + shift
        return float(gap @ gap + trace - 2.0 * roots.sum())


def _statistics(features: FloatArray, weights: FloatArray) -> FeatureStatistics:
    """Statistics of checked ``features`` ``[n, d]`` with positive whole ``weights`` ``[n]``.

    Centred rows are orthogonal to the roots of their weights. The reflection that takes those roots to the first axis
    leaves the covariance as it is and the first row zero; without it the factor has full rank.
    """
    n = round(float(weights.sum()))
    factor = features[1:] - features[0]
    shift = weights[1:] @ factor / n
    factor -= shift / (1.0 + np.sqrt(weights[0] / n))
    factor *= np.sqrt(weights[1:] / (n - 1))[:, None]
    if factor.shape[0] > factor.shape[1]:
        factor = np.linalg.qr(factor, mode="r")
    return FeatureStatistics(features[0] + shift, factor, n)


def _singular_values(tall: FloatArray, trace: float) -> FloatArray:
    """Singular values of ``tall`` ``[m, k]`` with m >= k, descending.

    The bidiagonal reduction of a large matrix waits for memory: root eigenvalues of its Gram matrix take a third of the
    time, and are used where a bound says that their rounding does not show.
    """
    if tall.shape[1] >= LARGE:
        roots, rounding = _root_eigenvalues(tall)
        if rounding <= EXACT_TOLERANCE * trace:
            return roots[::-1]
    return np.asarray(np.linalg.svd(tall, compute_uv=False), dtype=np.float64)


def _root_eigenvalues(tall: FloatArray) -> tuple[FloatArray, float]:
    """Root eigenvalues of the Gram matrix of ``tall`` ``[m, k]``, ascending, and a bound on the rounding of their sum.

    An eigenvalue, however small, is off by up to the rounding of the whole matrix; the bound is what that means for its
    root. LAPACK is called directly for the width of its blocks: below about 1000 columns, 16 are faster than its 32.
    """
    gram = scipy.linalg.blas.dsyrk(1.0, tall.T, lower=1)
    work = ((16 if len(gram) < 1000 else 32) + 2) * len(gram)
    eigenvalues, _, info = scipy.linalg.lapack.dsyev(gram, compute_v=0, lower=1, lwork=work, overwrite_a=1)
    if info:
        raise np.linalg.LinAlgError(f"eigenvalues did not converge (dsyev returned {info})")
    eigenvalues = np.clip(eigenvalues, 0.0, None)
    roots = np.sqrt(eigenvalues)
    slack = EPS * float(np.linalg.norm(eigenvalues))
    if slack == 0.0:
        return roots, 0.0
    return roots, float(np.sum(slack / (np.sqrt(eigenvalues + slack) + roots)))


def _numerical_rank(singular: FloatArray, size: int) -> int:
    return int(np.sum(singular > singular.max(initial=0.0) * size * np.finfo(np.float64).eps))


def _checked(features: ArrayLike, name: str) -> FloatArray:
    checked = finite_array(features, name, (None, None))
    if len(checked) < 2:
        raise BadInput(f"{name} must hold at least 2 samples, got {len(checked)}", where=name)
    return checked


def _checked_pair(
    real_features: ArrayLike, other_features: ArrayLike, *, second_name: str = "generated_features"
) -> tuple[FloatArray, FloatArray]:
    real, other = _checked(real_features, "real_features"), _checked(other_features, second_name)
    if real.shape[1] != other.shape[1]:
        raise BadInput(
            f"{second_name} must have {real.shape[1]} features like real_features, got {other.shape[1]}",
            where=second_name,
            cause="features of two different judges",
        )
    return real, other
