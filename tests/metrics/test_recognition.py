"""Recognition: worked out by hand, invariant to relabelling, monotone in the errors, refusals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

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
    assert chance_percent(8) == 12.5 and chance_percent(1) == 100.0
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


def test_top_k_is_perfect_where_the_right_class_leads_and_ignores_offsets_and_order() -> None:
    rng = np.random.default_rng(1)
    scores, true = rng.normal(size=(60, 6)), rng.integers(0, 6, 60)
    leading = scores.copy()
    leading[np.arange(60), true] = 10.0
    assert top_k_correct(true, leading, 1).all()
    last = scores.copy()
    last[np.arange(60), true] = -np.inf
    assert not top_k_correct(true, last, 5).any() and top_k_correct(true, last, 6).all()
    plain = top_k_correct(true, scores, 3)
    offset = rng.normal(size=(60, 1))
    np.testing.assert_array_equal(top_k_correct(true, 2.0 * scores + offset, 3), plain)
    np.testing.assert_array_equal(top_k_correct(true[::-1], scores[::-1], 3), plain[::-1])
    classes = rng.permutation(6)
    np.testing.assert_array_equal(top_k_correct(np.argsort(classes)[true], scores[:, classes], 3), plain)


def test_top_k_ties_go_to_the_lower_index() -> None:
    flat = np.zeros((5, 5))
    assert [int(top_k_correct(np.arange(5), flat, k).sum()) for k in range(1, 6)] == [1, 2, 3, 4, 5]
    assert top_k_correct(np.arange(5), flat, 3).tolist() == [True, True, True, False, False]


@pytest.mark.parametrize(
    ("true", "scores", "k", "message"),
    [
        ([0, 1], [[0.0, 1.0]], 1, r"true must have shape \[1\], got \[2\]"),
        ([2], [[0.0, 1.0]], 1, r"true must lie in 0\.\.1, got 2"),
        ([-1], [[0.0, 1.0]], 1, "true must not be negative, got -1"),
        ([0.0], [[0.0, 1.0]], 1, "true must be integer labels, got float64"),
        ([[0.0, 1.0]], [0], 1, r"log_probabilities must have shape \[n, classes\], got \[1\]"),
        ([], np.zeros((0, 2)), 1, r"log_probabilities must have shape \[n, classes\], got \[0, 2\]"),
        ([0], [[np.nan, 1.0]], 1, r"log_probabilities must be finite or -Inf, got 1 NaN or \+Inf of 2 values"),
        ([0], [[np.inf, np.nan]], 1, r"log_probabilities must be finite or -Inf, got 2 NaN or \+Inf of 2 values"),
        ([0], [[0.0, 1.0]], 0, r"k must lie in 1\.\.2, got 0"),
    ],
)
def test_top_k_refusals(true: Any, scores: Any, k: int, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        top_k_correct(true, scores, k)


def test_more_right_answers_never_lower_a_number() -> None:
    rng = np.random.default_rng(2)
    content, style, order = rng.random(50) < 0.5, rng.random(50) < 0.5, rng.permutation(50)
    joint = []
    for place in order:
        content[place] = style[place] = True
        joint.append(percent(joint_correct(content, style)).percent)
    assert joint == sorted(joint) and joint[-1] == 100.0
    assert percent(joint_correct(content[order], style[order])) == percent(joint_correct(content, style))


def test_residue_grows_with_samples_left_as_they_were() -> None:
    source, target = np.zeros(10, dtype=int), np.ones(10, dtype=int)
    seen = [(np.arange(10) >= n).astype(int) for n in (0, 3, 10)]
    shares = [percent(kept_source_style(source, target, labels)).percent for labels in seen]
    assert shares == [0.0, 30.0, 100.0]
    order = np.random.default_rng(0).permutation(10)
    assert percent(kept_source_style(source, target, seen[1][order])).percent == 30.0


def test_ensemble_ignores_the_order_of_judges() -> None:
    assert over_judges([98.0, 90.0, 94.0]) == over_judges([90.0, 94.0, 98.0])
    assert over_judges([90.0, 90.0]).sd == 0.0
    rows = np.array([[True, False, True], [True, False, False]])
    np.testing.assert_array_equal(share_of_judges(rows[::-1]), share_of_judges(rows))


LABEL_PAIRS: list[tuple[Callable[[Any, Any], object], str, str]] = [
    (correct, "true", "predicted"),
    (balanced_accuracy_percent, "true", "predicted"),
    (lambda true, seen: confusion_matrix(true, seen, 3), "true", "predicted"),
    (
        lambda true, seen: balanced_accuracy_replicates(true, seen, np.ones((2, 5), dtype=np.int32)),
        "true",
        "predicted",
    ),
    (lambda source, seen: kept_source_style(source, TRUE, seen), "source_styles", "predicted_styles"),
    (lambda target, seen: kept_source_style(TRUE, target, seen), "target_styles", "predicted_styles"),
]


@pytest.mark.parametrize(("function", "first", "second"), LABEL_PAIRS)
def test_every_argument_of_labels_is_checked(function: Callable[[Any, Any], object], first: str, second: str) -> None:
    with pytest.raises(BadInput, match=f"^{first}: .* must be integer labels"):
        function(TRUE * 1.0, PREDICTED)
    with pytest.raises(BadInput, match=f"^{second}: .* must be integer labels"):
        function(TRUE, PREDICTED * 1.0)
    with pytest.raises(BadInput, match=f"^{first}: .* must not be negative, got -1"):
        function(TRUE - 1, PREDICTED)
    with pytest.raises(BadInput, match=f"^{second}: .* must not be negative, got -1"):
        function(TRUE, PREDICTED - 1)
    with pytest.raises(BadInput, match=rf"^{second}: .* must have shape \[5\], got \[4\]"):
        function(TRUE, PREDICTED[:4])


def test_refuses_values_that_are_no_shares() -> None:
    for bad in ([], [[0.5]], [-0.1], [1.5]):
        with pytest.raises(BadInput, match=r"^values: "):
            percent(bad)
        with pytest.raises(BadInput, match=r"^values: "):
            per_condition(bad, {})
        with pytest.raises(BadInput, match=r"^values: "):
            per_class([0], bad)
    with pytest.raises(BadInput, match=r"^true: true must have shape \[2\], got \[1\]"):
        per_class([0], [0.5, 0.5])
    with pytest.raises(BadInput, match=r"^conditions\['half'\]: .* must be booleans"):
        per_condition([0.5, 1.0], {"half": [0, 1]})
    with pytest.raises(BadInput, match=r"^values: values must have shape \[any\], got \[0\]"):
        over_judges([])
    with pytest.raises(BadInput, match=r"^values: values must lie in 0\.\.1"):
        share_of_judges([[2.0]])
    with pytest.raises(BadInput, match=r"^style_correct: .* must be booleans"):
        joint_correct([True], [1])
    with pytest.raises(BadInput, match=r"^predicted: predicted must lie in 0\.\.1, got 2"):
        confusion_matrix([0, 1], [2, 0], 2)
    bad_counts: list[Any] = [
        np.ones((2, 4), dtype=int),
        -np.ones((2, 5), dtype=int),
        np.ones((2, 5)),
        np.ones((0, 5), dtype=int),
    ]
    for counts in bad_counts:
        with pytest.raises(BadInput, match=r"^counts: "):
            balanced_accuracy_replicates(TRUE, PREDICTED, counts)
    with pytest.raises(BadInput, match=r"^true: true must be integer labels"):
        majority_rate_percent([0.5])
