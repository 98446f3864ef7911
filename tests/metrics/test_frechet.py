"""Frechet distance: closed forms on Gaussians built at data level, outside implementations, refusals."""

from __future__ import annotations

import ast
import importlib.util
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics import frechet
from bench.metrics.frechet import (
    PrincipalComponents,
    conditional_frechet,
    conditional_frechet_replicates,
    feature_statistics,
    frechet_distance,
    frechet_floor,
    frechet_replicates,
)


def with_exact_statistics(scales: FloatArray, mean: FloatArray, n: int, rng: np.random.Generator) -> FloatArray:
    """``[n, d]`` samples whose mean is ``mean`` and whose covariance is diag(scales^2), both to rounding."""
    noise = rng.normal(size=(n, len(scales)))
    noise -= noise.mean(axis=0)
    orthonormal, _ = np.linalg.qr(noise)
    return np.asarray(orthonormal * np.sqrt(n - 1) * scales + mean)


def torch_fidelity_function(module: str, name: str) -> Callable[..., Any]:
    """A function from torch-fidelity's source; its package import needs torchvision, the arithmetic does not."""
    spec = importlib.util.find_spec("torch_fidelity")
    if spec is None or spec.origin is None:
        pytest.skip("torch-fidelity is not installed (pip install --no-deps torch-fidelity)")
    tree = ast.parse((Path(spec.origin).parent / f"{module}.py").read_text())
    kept: list[ast.stmt] = [node for node in tree.body if isinstance(node, ast.FunctionDef) and node.name == name]
    kept += [node for node in tree.body if isinstance(node, ast.Assign)]
    scope: dict[str, Any] = {"np": np, "vprint": lambda *_: None, "vassert": lambda *_: None}
    exec(compile(ast.Module(body=kept, type_ignores=[]), module, "exec"), scope)
    function: Callable[..., Any] = scope[name]
    return function


def test_by_hand_one_feature() -> None:
    # means 1 and 4, standard deviations 1 and sqrt 2 * 2: 9 + (1 - 2 sqrt 2)^2
    real, generated = np.array([[0.0], [1.0], [2.0]]), np.array([[2.0], [6.0]])
    result = frechet_distance(real, generated)
    assert result.value == pytest.approx(9.0 + (1.0 - np.sqrt(8.0)) ** 2, rel=1e-14)
    assert (result.d, result.rank, result.n_real, result.n_generated) == (1, 1, 3, 2)


@pytest.mark.parametrize(("n", "d"), [(2, 40), (5, 40), (40, 40), (400, 40), (300, 512)])
@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_perfect_input_is_zero(n: int, d: int, scale: float) -> None:
    features = np.random.default_rng(n).normal(size=(n, d)) * scale
    result = frechet_distance(features, features)
    assert abs(result.value) <= 1e-13 * result.trace


@pytest.mark.parametrize("condition", [1.0, 1e3, 1e10])
@pytest.mark.parametrize("d", [8, 64, 256])
def test_commuting_gaussians_closed_form(d: int, condition: float) -> None:
    rng = np.random.default_rng(d)
    scales_x = np.logspace(0.0, -0.5 * np.log10(condition), d)
    scales_y = rng.permutation(scales_x) * 1.5
    turn, _ = np.linalg.qr(rng.normal(size=(d, d)))
    shift = rng.normal(size=d)
    x = with_exact_statistics(scales_x, np.zeros(d), 3 * d, rng) @ turn
    y = with_exact_statistics(scales_y, shift, 4 * d, rng) @ turn
    expected = float(shift @ shift + np.sum((scales_x - scales_y) ** 2))
    result = frechet_distance(x, y)
    assert abs(result.value - expected) <= 1e-13 * result.trace


@pytest.mark.parametrize("condition", [1.0, 1e4, 1e10])
def test_closed_form_where_the_gram_matrix_may_be_used(condition: float) -> None:
    rng = np.random.default_rng(21)
    scales = np.logspace(0.0, -0.5 * np.log10(condition), 300)
    x = with_exact_statistics(scales, np.zeros(300), 360, rng)
    y = with_exact_statistics(scales[::-1], np.full(300, 0.1), 400, rng)
    result = frechet_distance(x, y)
    assert abs(result.value - (3.0 + np.sum((scales - scales[::-1]) ** 2))) <= 1e-13 * result.trace
    itself = frechet_distance(x, x)
    assert abs(itself.value) <= 1e-13 * itself.trace


@pytest.mark.parametrize("share", [0.02, 0.5, 0.99])
@pytest.mark.parametrize("small", [1e-1, 1e-3, 1e-5, 0.0])
def test_root_eigenvalues_stand_in_for_singular_values_only_where_they_agree(small: float, share: float) -> None:
    """Two levels of singular values: the spectrum whose small ones suffer most from being squared."""
    turns = [np.linalg.qr(np.random.default_rng(seed).normal(size=(260, 260)))[0] for seed in (0, 1)]
    singular = np.where(np.arange(260) < share * 260, 1.0, small)
    trace = float(2.0 * singular.sum())
    found = frechet._singular_values((turns[0] * singular) @ turns[1], trace)
    assert abs(found.sum() - singular.sum()) <= 1e-13 * trace


def test_fewer_samples_than_features() -> None:
    # Two orthonormal sets of 30 in 200 dimensions that share 10 directions: the cross term is known.
    rng = np.random.default_rng(3)
    basis, _ = np.linalg.qr(rng.normal(size=(200, 50)))
    x = with_exact_statistics(np.ones(30), np.zeros(30), 31, rng) @ basis[:, :30].T
    y = with_exact_statistics(np.ones(30), np.zeros(30), 31, rng) @ basis[:, 20:].T
    for scale in (1.0, 1e3):
        result = frechet_distance(scale * x, scale * y)
        assert abs(result.value - scale**2 * 40.0) <= 1e-13 * result.trace
        assert result.rank == 10
        assert result.shown is None
        assert "below 2 d = 400" in result.warning


def test_is_symmetric_and_invariant_to_turns_order_and_common_shifts() -> None:
    rng = np.random.default_rng(5)
    x, y = rng.normal(size=(90, 12)), rng.normal(size=(70, 12)) * 2.0
    turn, _ = np.linalg.qr(rng.normal(size=(12, 12)))
    plain = frechet_distance(x, y)
    for other in (frechet_distance(y, x), frechet_distance(x @ turn + 7.0, y[::-1] @ turn + 7.0)):
        assert other.value == pytest.approx(plain.value, rel=1e-11)
    assert frechet_distance(1e3 * x, 1e3 * y).value == pytest.approx(1e6 * plain.value, rel=1e-11)


def test_argument_order_is_recorded() -> None:
    rng = np.random.default_rng(6)
    result = frechet_distance(rng.normal(size=(30, 2)), rng.normal(size=(50, 2)))
    assert (result.n_real, result.n_generated) == (30, 50)


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.floats(0.1, 2.0))
def test_grows_with_shift_and_with_spread(seed: int, step: float) -> None:
    x = np.random.default_rng(seed).normal(size=(60, 5))
    shifted = [frechet_distance(x, x + k * step).value for k in range(4)]
    spread = [frechet_distance(x, x * (1.0 + k * step)).value for k in range(4)]
    assert (np.diff(shifted) > 0).all()
    assert (np.diff(spread) > 0).all()
    assert shifted[1] == pytest.approx(5 * step**2, rel=1e-9)


def test_agrees_with_torch_fidelity() -> None:
    to_metric = torch_fidelity_function("metric_fid", "fid_statistics_to_metric")
    rng = np.random.default_rng(7)
    x, y = rng.normal(size=(800, 64)), rng.normal(size=(900, 64)) @ rng.normal(size=(64, 64)) + 0.5
    statistics = [{"mu": z.mean(axis=0), "sigma": np.cov(z, rowvar=False)} for z in (x, y)]
    theirs = to_metric(*statistics, False)["frechet_inception_distance"]
    assert frechet_distance(x, y).value == pytest.approx(theirs, rel=1e-6)


def test_agrees_with_square_root_form() -> None:
    rng = np.random.default_rng(8)
    x, y = rng.normal(size=(300, 20)), rng.normal(size=(300, 20)) * 1.3 + 0.2
    covariances = np.cov(x, rowvar=False), np.cov(y, rowvar=False)
    root = np.trace(np.real(scipy.linalg.sqrtm(covariances[0] @ covariances[1])))
    gap = x.mean(axis=0) - y.mean(axis=0)
    expected = gap @ gap + np.trace(covariances[0]) + np.trace(covariances[1]) - 2.0 * root
    assert frechet_distance(x, y).value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("n", [9, 40])
def test_statistics_factor_squares_to_the_covariance_with_counts(n: int) -> None:
    rng = np.random.default_rng(9)
    features, counts = rng.normal(size=(n, 11)), rng.integers(0, 4, size=n).astype(np.int32)
    statistics = feature_statistics(features, counts)
    repeated = np.repeat(features, counts, axis=0)
    np.testing.assert_allclose(statistics.mean, repeated.mean(axis=0), atol=1e-14)
    np.testing.assert_allclose(statistics.factor.T @ statistics.factor, np.cov(repeated, rowvar=False), atol=1e-13)
    assert statistics.n == counts.sum()


@pytest.mark.parametrize("kind", ["full rank", "graded", "few", "dead feature", "few different rows", "constant"])
def test_replicates_equal_the_exact_path(kind: str) -> None:
    rng = np.random.default_rng(10)
    d = 24
    x, y = rng.normal(size=(200, d)), rng.normal(size=(150, d)) * 1.2 + 0.1
    if kind == "graded":
        x, y = x * np.logspace(0, -4, d), y * np.logspace(-4, 0, d)
    elif kind == "few":
        x, y = x[:15], y[:12]
    elif kind == "dead feature":
        x[:, 3], y[:, 3] = 0.0, 0.0
    elif kind == "few different rows":
        y = y[rng.integers(0, 5, size=150)]
    elif kind == "constant":
        y = np.repeat(y[:1], 150, axis=0)
    counts = rng.multinomial(len(y), np.full(len(y), 1 / len(y)), size=5).astype(np.int32)
    counts[0] = 1
    replicates = frechet_replicates(x, y, counts)
    for row, value in zip(counts, replicates, strict=True):
        exact = frechet_distance(x, np.repeat(y, row, axis=0))
        assert abs(value - exact.value) <= 1e-10 * exact.trace


def test_replicate_without_two_samples_is_nan() -> None:
    rng = np.random.default_rng(11)
    counts = np.array([[3, 0, 0], [1, 1, 1]], dtype=np.int32)
    replicates = frechet_replicates(rng.normal(size=(9, 2)), rng.normal(size=(3, 2)), counts)
    assert np.isnan(replicates[0]) and np.isfinite(replicates[1])


def test_principal_components_are_ordered_orthonormal_and_signed() -> None:
    rng = np.random.default_rng(12)
    features = with_exact_statistics(np.array([3.0, 2.0, 1.0]), np.array([5.0, 0.0, -5.0]), 40, rng)
    components = PrincipalComponents.fit(features, 2)
    np.testing.assert_allclose(components.directions, [[1, 0, 0], [0, 1, 0]], atol=1e-12)
    assert components.explained_share == pytest.approx(13 / 14)
    np.testing.assert_allclose(components.apply([[6.0, 2.0, 9.0]]), [[1.0, 2.0]], atol=1e-12)
    again = PrincipalComponents.fit(features[::-1], 2)
    np.testing.assert_allclose(again.directions, components.directions, atol=1e-12)


def test_all_components_keep_the_distance() -> None:
    rng = np.random.default_rng(13)
    x, y = rng.normal(size=(50, 6)), rng.normal(size=(60, 6)) + 1.0
    components = PrincipalComponents.fit(x, 6)
    turned = frechet_distance(components.apply(x), components.apply(y))
    assert turned.value == pytest.approx(frechet_distance(x, y).value, rel=1e-12)


def test_floor_is_zero_on_the_same_rows_and_falls_with_n() -> None:
    rng = np.random.default_rng(14)
    real, disjoint = rng.normal(size=(2000, 8)), rng.normal(size=(2000, 8))
    assert frechet_floor(real, real, 2000, n_draws=2, rng=rng).value == pytest.approx(0.0, abs=1e-12)
    floors = [frechet_floor(real, disjoint, n, rng=rng) for n in (50, 200, 1000)]
    assert floors[0].value > floors[1].value > floors[2].value > 0.0
    assert floors[0].sd > 0.0 and not floors[0].with_replacement
    assert frechet_floor(real, disjoint, 3000, n_draws=1, rng=rng).with_replacement
    same = [frechet_floor(real, disjoint, 99, rng=np.random.default_rng(1)).value for _ in range(2)]
    assert same[0] == same[1]


def labelled(rng: np.random.Generator) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    real, generated = rng.normal(size=(75, 3)), rng.normal(size=(46, 3)) + 1.0
    return real, np.repeat([0, 1, 2], [40, 30, 5]), generated, np.repeat([0, 1, 3], [30, 15, 1])


def test_conditional_is_the_mean_over_labels_and_names_what_it_left_out() -> None:
    real, real_labels, generated, labels = labelled(np.random.default_rng(15))
    result = conditional_frechet(real, real_labels, generated, labels)
    cells = [frechet_distance(real[:40], generated[:30]).value, frechet_distance(real[40:70], generated[30:45]).value]
    assert result.per_label == {0: cells[0], 1: cells[1]}
    assert result.value == pytest.approx(np.mean(cells), rel=1e-14)
    assert result.left_out == {2: 5, 3: 0}
    assert result.too_few_generated == {}
    assert result.warning == ""
    wider = conditional_frechet(real, real_labels, generated, labels, min_real=5)
    assert wider.too_few_generated == {2: 0} and wider.left_out == {3: 0}


def test_conditional_warns_of_thin_cells_and_explains_an_empty_table() -> None:
    real, real_labels, generated, labels = labelled(np.random.default_rng(16))
    wide = np.random.default_rng(0).normal(size=(3, 9))
    thin = conditional_frechet(real @ wide, real_labels, generated @ wide, labels)
    assert thin.warning == "1 of 2 labels have fewer than 2 d samples"
    nothing = conditional_frechet(real, real_labels, generated, labels, min_real=100)
    assert np.isnan(nothing.value) and "no label has 100 real" in nothing.reason


def test_conditional_catches_swapped_labels_that_the_plain_form_misses() -> None:
    rng = np.random.default_rng(17)
    labels = np.repeat([0, 1], 60)
    real, generated = (
        rng.normal(size=(120, 2)) + 5.0 * labels[:, None],
        rng.normal(size=(120, 2)) + 5.0 * labels[:, None],
    )
    right, wrong = (conditional_frechet(real, labels, generated, asked).value for asked in (labels, 1 - labels))
    assert wrong > 20.0 * right
    assert frechet_distance(real, generated).value < 1.0


def test_conditional_replicates() -> None:
    real, real_labels, generated, labels = labelled(np.random.default_rng(18))
    counts = np.ones((3, 46), dtype=np.int32)
    counts[1, 30:45] = 0
    counts[2] = 0
    replicates = conditional_frechet_replicates(real, real_labels, generated, labels, counts)
    whole = conditional_frechet(real, real_labels, generated, labels)
    assert replicates[0] == pytest.approx(whole.value, rel=1e-10)
    assert replicates[1] == pytest.approx(whole.per_label[0], rel=1e-10)
    assert np.isnan(replicates[2])


def test_refusals() -> None:
    good = np.random.default_rng(19).normal(size=(10, 3))
    bad = good.copy()
    bad[4, 1] = np.nan
    labels = np.zeros(10, dtype=np.int64)
    with pytest.raises(BadInput, match="generated_features must be finite, got 1 NaN"):
        frechet_distance(good, bad)
    with pytest.raises(BadInput, match=r"real_features must have shape \[any, any\]"):
        frechet_distance(good[0], good)
    with pytest.raises(BadInput, match="real_features must hold at least 2 samples, got 1"):
        frechet_distance(good[:1], good)
    with pytest.raises(BadInput, match="must have 3 features like real_features, got 2"):
        frechet_distance(good, good[:, :2])
    with pytest.raises(BadInput, match=r"counts must have shape \[replicates, 10\]"):
        frechet_replicates(good, good, np.ones((2, 9), dtype=np.int32))
    with pytest.raises(BadInput, match="counts must be non-negative integers"):
        frechet_replicates(good, good, np.full((2, 10), -1, dtype=np.int32))
    with pytest.raises(BadInput, match="counts must keep at least 2 samples, got 1"):
        feature_statistics(good, np.eye(10, dtype=np.int32)[0])
    with pytest.raises(BadInput, match=r"n_components must lie in 1\.\.3"):
        PrincipalComponents.fit(good, 4)
    with pytest.raises(BadInput, match="n must be at least 2"):
        frechet_floor(good, good, 1, rng=np.random.default_rng(0))
    with pytest.raises(BadInput, match="real_labels must be integer labels"):
        conditional_frechet(good, labels.astype(float), good, labels)
    with pytest.raises(BadInput, match="generated_labels must not be negative"):
        conditional_frechet(good, labels, good, labels - 1)
    with pytest.raises(BadInput, match=r"generated_labels must have shape \[10\]"):
        conditional_frechet(good, labels, good, labels[:9])
