"""Kernel distance: by hand, against a double loop and torch-fidelity, replicates, refusals."""

from __future__ import annotations

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics.kernel import (
    LabelledFeatures,
    conditional_kernel,
    conditional_kernel_replicates,
    conditional_kid,
    conditional_kid_replicates,
    kernel_distance,
    kernel_replicates,
)
from tests.metrics.test_frechet import torch_fidelity_function


def double_loop(real: FloatArray, generated: FloatArray, counts: FloatArray) -> float:
    """The estimator written out pair by pair; equal rows of one original sample are never paired."""

    def kernel(a: FloatArray, b: FloatArray) -> float:
        return float((a @ b / len(a) + 1.0) ** 3)

    n, m = len(real), len(generated)
    within_real = np.mean([kernel(real[i], real[j]) for i in range(n) for j in range(n) if i != j])
    pairs = [(i, j) for i in range(m) for j in range(m) if i != j]
    weights = np.array([counts[i] * counts[j] for i, j in pairs])
    within = weights @ np.array([kernel(generated[i], generated[j]) for i, j in pairs]) / weights.sum()
    across = [counts[j] * kernel(real[i], generated[j]) for i in range(n) for j in range(m)]
    return float(within_real + within - 2.0 * np.sum(across) / (n * counts.sum()))


def test_by_hand() -> None:
    # (xy + 1)^3: real pair 1; generated pair (1 * 3 + 1)^3 = 64; cross 1, 1, 8, 64 on average 18.5
    assert kernel_distance([[0.0], [1.0]], [[1.0], [3.0]]) == pytest.approx(1.0 + 64.0 - 2.0 * 18.5, rel=1e-14)


def test_features_are_divided_by_their_number() -> None:
    x, y = np.array([[0.0], [1.0], [2.0]]), np.array([[1.0], [3.0]])
    assert kernel_distance(np.tile(x, 5), np.tile(y, 5)) == pytest.approx(kernel_distance(x, y), rel=1e-14)


def test_same_distribution_scatters_around_zero_at_any_n() -> None:
    rng = np.random.default_rng(0)
    for n in (10, 60):
        values = np.array([kernel_distance(rng.normal(size=(n, 4)), rng.normal(size=(n, 4))) for _ in range(300)])
        assert abs(values.mean()) < 4.0 * values.std() / np.sqrt(300)
        assert (values < 0.0).any()


def test_agrees_with_a_double_loop_and_with_torch_fidelity() -> None:
    rng = np.random.default_rng(1)
    x, y = rng.normal(size=(12, 3)), rng.normal(size=(12, 3)) + 0.4
    value = kernel_distance(x, y)
    assert value == pytest.approx(double_loop(x, y, np.ones(12)), rel=1e-12)
    kernels = [(a @ b.T / 3 + 1.0) ** 3 for a, b in ((x, x), (x, y), (y, y))]
    assert value == pytest.approx(torch_fidelity_function("metric_kid", "mmd2")(*kernels), rel=1e-12)


def test_is_symmetric_and_invariant_to_turns_and_order_but_not_to_scale() -> None:
    rng = np.random.default_rng(2)
    x, y = rng.normal(size=(30, 5)), rng.normal(size=(25, 5)) + 0.5
    turn, _ = np.linalg.qr(rng.normal(size=(5, 5)))
    plain = kernel_distance(x, y)
    assert kernel_distance(y, x) == pytest.approx(plain, rel=1e-12)
    assert kernel_distance(x[::-1] @ turn, y @ turn) == pytest.approx(plain, rel=1e-11)
    assert kernel_distance(2.0 * x, 2.0 * y) > 1.5 * plain


def test_grows_with_the_shift() -> None:
    rng = np.random.default_rng(3)
    x, y = rng.normal(size=(80, 4)), rng.normal(size=(80, 4))
    assert (np.diff([kernel_distance(x, y + shift) for shift in (0.0, 0.5, 1.0, 2.0)]) > 0).all()


def test_replicates_follow_the_counts() -> None:
    rng = np.random.default_rng(4)
    x, y = rng.normal(size=(9, 3)), rng.normal(size=(7, 3)) + 0.3
    counts = rng.integers(0, 4, size=(4, 7)).astype(np.int32)
    counts[0] = 1
    counts[3] = [0, 0, 5, 0, 0, 0, 0]
    replicates = kernel_replicates(x, y, counts)
    assert replicates[0] == pytest.approx(kernel_distance(x, y), rel=1e-12)
    for row in (1, 2):
        assert replicates[row] == pytest.approx(double_loop(x, y, counts[row].astype(np.float64)), rel=1e-12)
    assert np.isnan(replicates[3])


def test_repetition_adds_no_bias() -> None:
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(60, 4)), rng.normal(size=(60, 4)) + 0.2
    counts = rng.multinomial(60, np.full(60, 1 / 60), size=4000).astype(np.int32)
    replicates = kernel_replicates(x, y, counts)
    assert abs(replicates.mean() - kernel_distance(x, y)) < 5.0 * replicates.std() / np.sqrt(4000)


def sides(rng: np.random.Generator, fault_in: str) -> tuple[LabelledFeatures, LabelledFeatures]:
    """Style and content side of 120 samples; ``fault_in`` names the side whose generated labels are wrong."""
    made = []
    for name in ("style", "content"):
        labels = np.repeat([0, 1], 60)
        asked = 1 - labels if name == fault_in else labels
        real = rng.normal(size=(120, 3)) * 0.3 + labels[:, None]
        made.append(LabelledFeatures(real, labels, rng.normal(size=(120, 3)) * 0.3 + labels[:, None], asked))
    return made[0], made[1]


@pytest.mark.parametrize("fault_in", ["style", "content"])
def test_conditional_kid_sees_a_fault_on_either_side(fault_in: str) -> None:
    rng = np.random.default_rng(6)
    clean, faulty = conditional_kid(*sides(rng, "none")), conditional_kid(*sides(rng, fault_in))
    assert abs(clean.value) < 0.3
    assert faulty.value > 1.0
    assert faulty.value == max(faulty.style.value, faulty.content.value)
    assert faulty.value == (faulty.style if fault_in == "style" else faulty.content).value


def test_conditional_is_the_mean_over_labels_and_names_what_it_left_out() -> None:
    rng = np.random.default_rng(7)
    real, labels = rng.normal(size=(55, 2)), np.repeat([4, 2, 9], [30, 20, 5])
    generated, asked = rng.normal(size=(30, 2)) + 0.5, np.repeat([2, 4, 9], 10)
    result = conditional_kernel(real, labels, generated, asked)
    cells = {2: kernel_distance(real[30:50], generated[:10]), 4: kernel_distance(real[:30], generated[10:20])}
    assert result.per_label == cells
    assert result.value == pytest.approx(np.mean(list(cells.values())), rel=1e-14)
    assert result.left_out == {9: 5}
    replicates = conditional_kernel_replicates(real, labels, generated, asked, np.ones((2, 30), dtype=np.int32))
    np.testing.assert_allclose(replicates, result.value, rtol=1e-12)


def test_conditional_kid_replicates_take_the_larger_within_each_replicate() -> None:
    rng = np.random.default_rng(8)
    style, content = sides(rng, "none")
    counts = rng.multinomial(120, np.full(120, 1 / 120), size=50).astype(np.int32)
    replicates = conditional_kid_replicates(style, content, counts)
    alone = [
        conditional_kernel_replicates(s.real_features, s.real_labels, s.generated_features, s.generated_labels, counts)
        for s in (style, content)
    ]
    np.testing.assert_array_equal(replicates, np.maximum(*alone))
    counts[:] = 1
    np.testing.assert_allclose(
        conditional_kid_replicates(style, content, counts), conditional_kid(style, content).value, rtol=1e-11
    )


def test_no_label_scored_is_nan_with_a_reason() -> None:
    rng = np.random.default_rng(9)
    style, content = sides(rng, "none")
    result = conditional_kid(style, content, min_real=500)
    assert np.isnan(result.value)
    assert result.style.reason == "no label has 500 real and 2 generated samples"


def test_refusals() -> None:
    good = np.random.default_rng(10).normal(size=(6, 3))
    with pytest.raises(BadInput, match="real_features must be finite"):
        kernel_distance(good * np.inf, good)
    with pytest.raises(BadInput, match="generated_features must hold at least 2 samples, got 1"):
        kernel_distance(good, good[:1])
    with pytest.raises(BadInput, match="must have 3 features like real_features, got 2"):
        kernel_distance(good, good[:, :2])
    with pytest.raises(BadInput, match="generated_features must have shape"):
        kernel_distance(good, good[0])
    with pytest.raises(BadInput, match="counts must have shape"):
        kernel_replicates(good, good, np.ones(6, dtype=np.int32))
    with pytest.raises(BadInput, match="counts must be non-negative integers"):
        kernel_replicates(good, good, np.ones((1, 6)))  # type: ignore[arg-type]
    with pytest.raises(BadInput, match="real_labels must not be negative"):
        conditional_kernel(good, np.full(6, -1), good, np.zeros(6, dtype=np.int64))
