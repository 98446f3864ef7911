"""Recognition: worked out by hand, invariant to relabelling, monotone in the errors, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bench.errors import BadInput
from bench.metrics.recognition import (
    Share,
    balanced_accuracy_percent,
    balanced_accuracy_replicates,
    chance_percent,
    confusion_matrix,
    correct,
    joint_correct,
    kept_source_style,
    majority_rate_percent,
    over_judges,
    per_class,
    per_condition,
    percent,
    share_of_judges,
    top_k_correct,
)

TRUE = np.array([0, 0, 0, 1, 2])
PREDICTED = np.array([0, 1, 0, 1, 0])


def test_by_hand() -> None:
    assert correct(TRUE, PREDICTED).tolist() == [True, False, True, True, False]
    assert percent(correct(TRUE, PREDICTED)) == Share(60.0, 5)
    assert balanced_accuracy_percent(TRUE, PREDICTED) == pytest.approx(100.0 * (2 / 3 + 1 + 0) / 3)
    assert majority_rate_percent(TRUE) == 60.0
    assert chance_percent(8) == 12.5
    assert confusion_matrix(TRUE, PREDICTED, 3).tolist() == [[2, 1, 0], [0, 1, 0], [1, 0, 0]]
    table = per_class(TRUE, correct(TRUE, PREDICTED))
    assert [share.percent for share in table.values()] == pytest.approx([200 / 3, 100.0, 0.0])
    assert {label: share.n for label, share in table.items()} == {0: 3, 1: 1, 2: 1}


def test_perfect_and_always_wrong() -> None:
    assert percent(correct(TRUE, TRUE)).percent == 100.0 == balanced_accuracy_percent(TRUE, TRUE)
    assert percent(correct(TRUE, TRUE + 1)).percent == 0.0 == balanced_accuracy_percent(TRUE, TRUE + 1)


def test_argument_order_matters_for_the_classes_that_are_averaged() -> None:
    assert balanced_accuracy_percent([0, 0, 1], [0, 0, 0]) == 50.0
    assert balanced_accuracy_percent([0, 0, 0], [0, 0, 1]) == pytest.approx(200 / 3)
    assert confusion_matrix([0], [1], 2).tolist() == [[0, 1], [0, 0]]


@given(st.lists(st.tuples(st.integers(0, 4), st.integers(0, 4)), min_size=1, max_size=40), st.permutations(range(5)))
def test_relabelling_and_reordering_change_nothing(pairs: list[tuple[int, int]], names: list[int]) -> None:
    true, predicted = np.array(pairs).T
    renamed = np.array(names)
    plain = balanced_accuracy_percent(true, predicted)
    assert balanced_accuracy_percent(renamed[true], renamed[predicted]) == pytest.approx(plain)
    assert balanced_accuracy_percent(true[::-1], predicted[::-1]) == pytest.approx(plain)
    matrix = confusion_matrix(true, predicted, 5)
    assert matrix.sum() == len(pairs)
    assert np.trace(matrix) == correct(true, predicted).sum()


def test_falls_with_every_error() -> None:
    true = np.repeat([0, 1], 10)
    accuracies, balanced = [], []
    for n_wrong in range(6):
        predicted = true.copy()
        predicted[:n_wrong] = 1
        accuracies.append(percent(correct(true, predicted)).percent)
        balanced.append(balanced_accuracy_percent(true, predicted))
    assert np.diff(accuracies).tolist() == [-5.0] * 5
    assert (np.diff(balanced) < 0).all()


def test_top_k_by_hand_with_ties_and_impossible_classes() -> None:
    scores = np.log(np.array([[0.5, 0.3, 0.2], [0.2, 0.3, 0.5], [0.4, 0.4, 0.2]]))
    assert top_k_correct([1, 0, 1], scores, 1).tolist() == [False, False, False]
    assert top_k_correct([1, 0, 1], scores, 2).tolist() == [True, False, True]
    assert top_k_correct([1, 0, 1], scores, 3).tolist() == [True, True, True]
    assert top_k_correct([0], [[0.0, -np.inf]], 1).tolist() == [True]
    rng = np.random.default_rng(0)
    random, true = rng.normal(size=(200, 7)), rng.integers(0, 7, 200)
    np.testing.assert_array_equal(top_k_correct(true, random, 1), correct(true, random.argmax(axis=1)))
    assert (np.diff([top_k_correct(true, random, k).sum() for k in range(1, 8)]) >= 0).all()


def test_joint_needs_both_on_the_same_sample() -> None:
    content, style = np.array([True, True, False, False]), np.array([True, False, True, False])
    assert joint_correct(content, style).tolist() == [True, False, False, False]
    # A coin flip of two copies: half right on each, never both.
    assert percent(joint_correct(content, ~content)).percent == 0.0
    np.testing.assert_array_equal(joint_correct(style, content), joint_correct(content, style))


def test_source_style_residue_by_hand() -> None:
    kept = kept_source_style([1, 1, 2, 3], [2, 2, 2, 1], [1, 2, 2, 3])
    np.testing.assert_array_equal(kept, [1.0, 0.0, np.nan, 1.0])
    assert percent(kept).percent == pytest.approx(200 / 3)
    assert percent(kept).n == 3
    swapped = kept_source_style([2, 2, 2, 1], [1, 1, 2, 3], [1, 2, 2, 3])
    np.testing.assert_array_equal(swapped, [0.0, 1.0, np.nan, 0.0])


def test_nothing_left_is_nan_with_n_zero() -> None:
    share = percent(kept_source_style([1], [1], [1]))
    assert np.isnan(share.percent) and share.n == 0


def test_conditions() -> None:
    table = per_condition(
        correct(TRUE, PREDICTED), {"first": TRUE == 0, "rest": TRUE > 0, "none": np.zeros(5, dtype=bool)}
    )
    assert table["first"].percent == pytest.approx(200 / 3)
    assert table["first"].n == 3
    assert table["rest"] == Share(50.0, 2)
    assert np.isnan(table["none"].percent) and table["none"].n == 0


def test_balanced_replicates_follow_the_counts() -> None:
    counts = np.array([[1, 1, 1, 1, 1], [0, 3, 1, 0, 2], [0, 0, 0, 0, 0]], dtype=np.int32)
    replicates = balanced_accuracy_replicates(TRUE, PREDICTED, counts)
    for row in (0, 1):
        repeated = [np.repeat(labels, counts[row]) for labels in (TRUE, PREDICTED)]
        assert replicates[row] == pytest.approx(balanced_accuracy_percent(*repeated))
    assert np.isnan(replicates[2])


def test_judges() -> None:
    result = over_judges([90.0, 94.0, 98.0])
    assert (result.mean, result.sd, result.n_judges) == (94.0, 4.0, 3)
    assert np.isnan(over_judges([90.0]).sd)
    np.testing.assert_allclose(share_of_judges([[True, False], [True, True], [True, False]]), [1.0, 1 / 3])
    np.testing.assert_array_equal(share_of_judges([[1.0, np.nan], [0.0, np.nan]]), [0.5, np.nan])


def test_refusals() -> None:
    with pytest.raises(BadInput, match=r"predicted must have shape \[5\], got \[4\]"):
        correct(TRUE, PREDICTED[:4])
    with pytest.raises(BadInput, match="true must be integer labels, got float64"):
        correct(TRUE * 1.0, PREDICTED)
    with pytest.raises(BadInput, match="true must not be negative, got -1; likely cause: an unlabelled take"):
        correct(TRUE - 1, PREDICTED)
    with pytest.raises(BadInput, match=r"true must have shape \[0\]"):
        majority_rate_percent([])
    with pytest.raises(BadInput, match=r"true must lie in 0\.\.1, got 2"):
        confusion_matrix(TRUE, PREDICTED, 2)
    with pytest.raises(BadInput, match="log_probabilities must be"):
        top_k_correct([0], [[np.nan, 0.0]], 1)
    with pytest.raises(BadInput, match=r"k must lie in 1\.\.2, got 3"):
        top_k_correct([0], [[0.0, 0.0]], 3)
    with pytest.raises(BadInput, match="style_correct must have length 2, got 1"):
        joint_correct([True, False], [True])
    with pytest.raises(BadInput, match="content_correct must be booleans"):
        joint_correct([1, 0], [True, False])
    with pytest.raises(BadInput, match=r"values must lie in 0\.\.1; likely cause: values that are already in percent"):
        percent([50.0])
    with pytest.raises(BadInput, match="the mask must have length 5, got 2"):
        per_condition(TRUE == 0, {"bad": [True, False]})
    with pytest.raises(BadInput, match="n_classes must be at least 1"):
        chance_percent(0)
    with pytest.raises(BadInput, match="values must be finite"):
        over_judges([1.0, np.nan])
    with pytest.raises(BadInput, match=r"values must have shape \[judges, n\]"):
        share_of_judges([1.0])
