"""Diversity: worked out by hand on points of a line, against the published estimates, invariances, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.distance import cdist

from bench.arrays import FloatArray, IntArray
from bench.errors import BadInput
from bench.metrics.diversity import (
    coverage,
    coverage_replicates,
    density,
    diversity,
    diversity_replicates,
    expected_coverage,
    multimodality,
    multimodality_replicates,
    real_balls,
)


def line(*places: float) -> FloatArray:
    return np.array(places)[:, None]


def draws(n: int, size: int = 40) -> NDArray[np.int32]:
    """Counts ``[size, n]`` of draws with replacement, the first one of each sample once."""
    drawn = np.random.default_rng(9).multinomial(n, np.full(n, 1.0 / n), size=size)
    return np.vstack([np.ones(n), drawn]).astype(np.int32)


def test_density_and_coverage_by_hand() -> None:
    # With k = 1 the radii of 0, 1, 3, 10 are 1, 1, 2, 7; the ball's edge does not belong to it.
    real, outputs = line(0.0, 1.0, 3.0, 10.0), line(0.5, 1.5, 3.5, 17.0)
    balls = real_balls(real, outputs, k=1)
    np.testing.assert_array_equal(balls, np.array([[1, 1, 0, 0], [0, 1, 1, 0], [0, 0, 1, 1], [0, 0, 0, 0]]) > 0)
    np.testing.assert_allclose(density(balls, k=1), [2.0, 2.0, 2.0, 0.0])
    np.testing.assert_allclose(density(balls, k=2), [1.0, 1.0, 1.0, 0.0])
    assert coverage(balls) == 100.0
    assert coverage(balls[:2]) == 75.0
    assert coverage(balls[3:]) == 0.0


def test_the_ball_reaches_to_the_kth_other_real_sample() -> None:
    real = line(0.0, 1.0, 3.0, 6.0)
    for k, radius in ((1, 1.0), (2, 3.0), (3, 6.0)):
        inside, beyond = real_balls(real, line(radius - 1e-9, -radius - 1e-9), k=k)[:, 0]
        assert inside and not beyond


def test_real_and_outputs_change_places() -> None:
    real, outputs = line(0.0, 1.0, 2.0, 3.0), line(0.5, 0.6, 0.7, 40.0)
    there, back = real_balls(real, outputs, k=1), real_balls(outputs, real, k=1)
    assert there.shape == back.shape == (4, 4)
    assert coverage(there) == 50.0 and coverage(back) == 25.0


def test_outputs_like_real_ones_reach_the_expected_coverage_and_density() -> None:
    rng = np.random.default_rng(0)
    balls = [real_balls(rng.normal(size=(150, 4)), rng.normal(size=(60, 4))) for _ in range(30)]
    expected = expected_coverage(150, 60)
    assert np.mean([coverage(b) for b in balls]) == pytest.approx(expected, abs=1.5)
    assert np.mean([density(b).mean() for b in balls]) == pytest.approx(1.0, abs=0.05)
    # One output, one neighbour, two real samples: the output is the nearer of two with probability 1/2.
    assert expected_coverage(2, 1, k=1) == pytest.approx(50.0)
    assert expected_coverage(10, 10**9) == pytest.approx(100.0)


def test_coverage_falls_with_collapse_and_density_with_noise() -> None:
    rng = np.random.default_rng(1)
    real, fresh = rng.normal(size=(2, 200, 3))
    covered = [coverage(real_balls(real, fresh[:kept])) for kept in (200, 50, 5, 1)]
    assert (np.diff(covered) < 0.0).all()
    dense = [density(real_balls(real, fresh + s * rng.normal(size=fresh.shape))).mean() for s in (0.0, 1.0, 3.0)]
    assert (np.diff(dense) < 0.0).all()


def test_balls_ignore_turns_shifts_scale_and_order() -> None:
    rng = np.random.default_rng(2)
    real, outputs = rng.normal(size=(2, 50, 6))
    turn, _ = np.linalg.qr(rng.normal(size=(6, 6)))
    plain = real_balls(real, outputs)
    np.testing.assert_array_equal(real_balls(3.0 * real @ turn + 5.0, 3.0 * outputs @ turn + 5.0), plain)
    np.testing.assert_array_equal(real_balls(real[::-1], outputs[::-1]), plain[::-1, ::-1])


def test_diversity_by_hand_and_against_random_pairs() -> None:
    assert diversity(line(0.0, 3.0)) == 3.0
    assert diversity(line(0.0, 1.0, 3.0)) == 2.0
    features = np.random.default_rng(3).normal(size=(300, 8))
    rng = np.random.default_rng(4)
    pairs = rng.integers(0, 300, (2, 20000))
    pairs = pairs[:, pairs[0] != pairs[1]]
    estimate = np.linalg.norm(features[pairs[0]] - features[pairs[1]], axis=1).mean()
    assert diversity(features) == pytest.approx(estimate, rel=0.01)


def test_diversity_scales_ignores_shifts_and_order_and_is_zero_where_all_is_the_same() -> None:
    features = np.random.default_rng(5).normal(size=(30, 4))
    plain = diversity(features)
    assert diversity(2.5 * features[::-1] + 7.0) == pytest.approx(2.5 * plain)
    assert diversity(np.ones((5, 3))) == 0.0
    spread = [diversity(s * features) for s in (0.0, 0.5, 1.0)]
    assert (np.diff(spread) > 0.0).all()


def test_multimodality_by_hand() -> None:
    features, labels = line(0.0, 2.0, 100.0, 104.0, 110.0, 7.0), np.array([3, 3, 1, 1, 1, 2])
    # 2 within class 3; 4, 6 and 10 within class 1; class 2 has one output and does not count.
    assert multimodality(features, labels) == pytest.approx((2.0 + 20.0 / 3) / 2)
    assert multimodality(features[::-1], labels[::-1]) == pytest.approx((2.0 + 20.0 / 3) / 2)
    assert multimodality(features, np.zeros(6, dtype=np.int64)) == pytest.approx(diversity(features))
    assert np.isnan(multimodality(features, np.arange(6)))
    assert multimodality(np.repeat([[1.0], [5.0]], 3, axis=0), np.repeat([0, 1], 3)) == 0.0


def test_multimodality_grows_with_the_spread_within_classes_only() -> None:
    rng = np.random.default_rng(6)
    centres, noise, labels = rng.normal(size=(4, 5)), rng.normal(size=(80, 5)), np.arange(80) % 4
    values = [multimodality(centres[labels] + s * noise, labels) for s in (0.0, 0.5, 1.0)]
    assert values[0] == pytest.approx(0.0, abs=1e-6) and (np.diff(values) > 0.0).all()
    assert multimodality(50.0 * centres[labels] + noise, labels) == pytest.approx(values[2])


def test_replicates_are_the_metric_of_the_drawn_outputs() -> None:
    rng = np.random.default_rng(7)
    real, outputs, labels = rng.normal(size=(40, 3)), rng.normal(size=(25, 3)), np.arange(25) % 3
    counts = draws(25)
    balls = real_balls(real, outputs, k=2)
    covered = coverage_replicates(balls, counts)
    spread, within = diversity_replicates(outputs, counts), multimodality_replicates(outputs, labels, counts)
    assert covered[0] == coverage(balls)
    assert spread[0] == pytest.approx(diversity(outputs))
    assert within[0] == pytest.approx(multimodality(outputs, labels))
    for b, row in enumerate(counts):
        drawn = np.repeat(np.arange(25), row)
        assert covered[b] == pytest.approx(coverage(balls[drawn]))
        assert spread[b] == pytest.approx(_pairs_of_different(outputs, drawn))
        per_class = [_pairs_of_different(outputs, drawn[labels[drawn] == c]) for c in range(3)]
        assert within[b] == pytest.approx(np.mean([v for v in per_class if np.isfinite(v)]))


def _pairs_of_different(outputs: FloatArray, drawn: IntArray) -> float:
    different = drawn[:, None] != drawn
    distances = cdist(outputs[drawn], outputs[drawn])
    return float(distances[different].mean()) if different.any() else float("nan")


def test_a_replicate_without_two_different_outputs_is_nan() -> None:
    counts = np.array([[3, 0, 0], [1, 1, 1]], dtype=np.int32)
    for values in (
        diversity_replicates(line(0.0, 1.0, 3.0), counts),
        multimodality_replicates(line(0.0, 1.0, 3.0), np.zeros(3, dtype=np.int64), counts),
    ):
        assert np.isnan(values[0]) and values[1] == 2.0


def test_refusals() -> None:
    points = line(0.0, 1.0, 2.0)
    for k in (0, 3):
        with pytest.raises(BadInput, match=rf"k must lie in 1\.\.2 for 3 real samples, got {k}"):
            real_balls(points, points, k=k)
    with pytest.raises(BadInput, match="real_features must be finite"):
        real_balls(points * np.nan, points, k=1)
    with pytest.raises(BadInput, match=r"generated_features must have shape \[any, 1\], got \[3, 2\]"):
        real_balls(points, np.ones((3, 2)), k=1)
    for measure in (density, coverage):
        with pytest.raises(BadInput, match=r"in_balls must be booleans \[m, n\], got float64 \[2, 2\]"):
            measure(np.ones((2, 2)))
        with pytest.raises(BadInput, match=r"in_balls must be booleans \[m, n\], got bool \[2\]"):
            measure(np.ones(2, dtype=bool))
    with pytest.raises(BadInput, match="k must be positive, got 0"):
        density(np.ones((2, 2), dtype=bool), k=0)
    with pytest.raises(BadInput, match=r"k must lie in 1\.\.4 and outputs must exist, got 5 and 9"):
        expected_coverage(5, 9)
    with pytest.raises(BadInput, match=r"k must lie in 1\.\.8 and outputs must exist, got 5 and 0"):
        expected_coverage(9, 0)
    with pytest.raises(BadInput, match="features must hold at least 2 outputs, got 1"):
        diversity(points[:1])
    with pytest.raises(BadInput, match=r"features must have shape \[any, any\], got \[3\]"):
        multimodality(points[:, 0], [0, 0, 0])
    with pytest.raises(BadInput, match=r"labels must have shape \[3\], got \[2\]"):
        multimodality(points, [0, 0])
    counts = np.ones((1, 2), dtype=np.int32)
    refused: list[Callable[[], object]] = [
        lambda: coverage_replicates(np.ones((3, 2), dtype=bool), counts),
        lambda: diversity_replicates(points, counts),
        lambda: multimodality_replicates(points, [0, 0, 0], counts),
    ]
    for replicates in refused:
        with pytest.raises(BadInput, match=r"counts must have shape \[replicates, 3\], got \[1, 2\]"):
            replicates()
