"""Monotonicity, evenness and recognition of style interpolations."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import spearmanr

from bench.errors import BadInput
from bench.metrics.interpolation import (
    WEIGHTS,
    end_recognition_percent,
    evenness,
    middle_content_percent,
    monotonicity,
    target_log_odds,
)


def test_log_odds_by_hand() -> None:
    scores = [[0.5, 2.0, -1.0], [1.0, 1.0, 0.0]]
    assert target_log_odds(scores, 0, 2).tolist() == [-1.5, -1.0]
    assert target_log_odds(scores, 2, 0).tolist() == [1.5, 1.0]
    assert target_log_odds(np.zeros((4, 5, 3)), 0, 1).shape == (4, 5)
    assert target_log_odds([0.5, 2.0], 0, 1) == pytest.approx(1.5)


def test_log_odds_are_the_same_from_logits_and_log_probabilities() -> None:
    logits = np.random.default_rng(0).standard_normal((6, 4))
    log_probabilities = logits - np.log(np.exp(logits).sum(axis=1, keepdims=True))
    assert target_log_odds(log_probabilities, 1, 3) == pytest.approx(target_log_odds(logits, 1, 3))


def test_monotonicity_by_hand() -> None:
    """Ranks 1 2 4 3 5 against 1 2 3 4 5: 1 - 6 x 2 / (5 x 24) = 0.9."""
    odds = [[-2.0, -1.0, 1.0, 0.0, 3.0], [1.0, 2.0, 3.0, 4.0, 50.0], [5.0, 4.0, 3.0, 2.0, 1.0], [7.0] * 5]
    measured = monotonicity(WEIGHTS, odds)
    assert measured[:3] == pytest.approx([0.9, 1.0, -1.0])
    assert np.isnan(measured[3])
    assert monotonicity([0.0, 0.5, 1.0], [[3.0, 1.0, 2.0]]) == pytest.approx([-0.5])


def test_monotonicity_agrees_with_scipy_ties_included() -> None:
    odds = np.random.default_rng(0).integers(0, 4, (20, 5)).astype(float)
    wanted = [float(spearmanr(WEIGHTS, row).statistic) for row in odds if np.ptp(row) > 0.0]
    measured = monotonicity(WEIGHTS, odds)
    assert measured[np.isfinite(measured)] == pytest.approx(wanted)


def test_monotonicity_ignores_rising_maps_and_sees_direction() -> None:
    odds = np.random.default_rng(1).standard_normal((10, 5))
    measured = monotonicity(WEIGHTS, odds)
    assert monotonicity(WEIGHTS, np.exp(odds)) == pytest.approx(measured)
    assert monotonicity(WEIGHTS, -odds) == pytest.approx(-measured)
    assert monotonicity(WEIGHTS[::-1], odds[:, ::-1]) == pytest.approx(measured)


def test_monotonicity_falls_with_the_fault() -> None:
    rng = np.random.default_rng(2)
    noise = rng.standard_normal((400, 5))
    means = [monotonicity(WEIGHTS, np.array(WEIGHTS) + scale * noise).mean() for scale in (0.0, 0.2, 0.6, 5.0)]
    assert means == sorted(means, reverse=True) and means[0] == pytest.approx(1.0) and means[3] < 0.5


def line(*places: float) -> Any:
    """Outputs of two frames and three joints, all at one place on a line."""
    return np.array(places)[:, None, None, None] * np.ones((1, 2, 3, 3)) * np.array([1.0, 0.0, 0.0])


def test_evenness_by_hand() -> None:
    """Steps of 1, 1, 2, 0: the largest is twice the mean."""
    assert evenness(line(0.0, 1.0, 2.0, 4.0, 4.0)) == pytest.approx(2.0)
    assert evenness(line(0.0, 1.0, 2.0, 3.0, 4.0)) == pytest.approx(1.0)
    assert evenness(line(0.0, 0.0, 0.0, 0.0, 1.0)) == pytest.approx(4.0)
    assert np.isnan(evenness(line(1.0, 1.0, 1.0)))


def test_a_step_is_a_mean_of_joint_distances() -> None:
    """First step: one of two joints 1 m in one of two frames, 0.25; second: 0.75. 0.75 over their mean 0.5."""
    positions = np.zeros((3, 2, 2, 3))
    positions[1:, 0, 0, 1] = 1.0
    positions[2, 1] = [[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]]
    assert evenness(positions) == pytest.approx(1.5)


def test_a_distance_is_taken_over_the_three_axes() -> None:
    """Steps: one of two joints by (3, 4, 0), a mean of 2.5; then one by (0, 0, 1), 0.5. 2.5 over 1.5."""
    positions = np.zeros((3, 1, 2, 3))
    positions[1:, 0, 0] = 3.0, 4.0, 0.0
    positions[2, 0, 1, 2] = 1.0
    assert evenness(positions) == pytest.approx(2.5 / 1.5)


def test_evenness_ignores_direction_scale_and_a_common_motion() -> None:
    positions = np.random.default_rng(0).standard_normal((5, 4, 3, 3))
    measured = evenness(positions)
    assert evenness(positions[::-1]) == pytest.approx(measured)
    assert evenness(3.0 * positions) == pytest.approx(measured)
    assert evenness(positions + np.random.default_rng(1).standard_normal((4, 3, 3))) == pytest.approx(measured)


def test_evenness_grows_with_the_fault() -> None:
    values = [evenness(line(0.0, 1.0, 2.0, 3.0, 4.0 + jump)) for jump in (0.0, 0.5, 2.0, 9.0)]
    assert values == sorted(values) and values[0] == 1.0 < values[1]


CONTENTS = [0, 1]
STARTS, TARGETS = [0, 0], [1, 2]
SEEN_CONTENTS = [[0, 1, 0, 0], [1, 1, 1, 0]]
SEEN_STYLES = [[0, 0, 1, 1], [2, 0, 2, 2]]


def test_end_recognition_by_hand() -> None:
    """First sample right at both ends; second: wrong style at the start, wrong content at the end."""
    assert end_recognition_percent(SEEN_CONTENTS, SEEN_STYLES, CONTENTS, STARTS, TARGETS) == 50.0
    assert end_recognition_percent(SEEN_CONTENTS, SEEN_STYLES, CONTENTS, TARGETS, STARTS) == 25.0
    assert end_recognition_percent([[0, 0], [1, 0]], [[0, 1], [0, 2]], CONTENTS, STARTS, TARGETS) == 75.0
    right = [[0, 9, 9, 1], [0, 9, 9, 2]]
    assert end_recognition_percent([[0] * 4, [1] * 4], right, CONTENTS, STARTS, TARGETS) == 100.0


def test_middle_content_by_hand() -> None:
    """Three of the four outputs between the ends."""
    assert middle_content_percent(SEEN_CONTENTS, CONTENTS) == 75.0
    assert middle_content_percent([[9, 0, 0, 9], [9, 1, 1, 9]], CONTENTS) == 100.0
    assert middle_content_percent([[0, 0, 0], [1, 0, 1]], CONTENTS) == 50.0


def test_recognition_ignores_the_order_of_samples() -> None:
    assert middle_content_percent(SEEN_CONTENTS[::-1], CONTENTS[::-1]) == 75.0
    backwards = [values[::-1] for values in (SEEN_CONTENTS, SEEN_STYLES, CONTENTS, STARTS, TARGETS)]
    assert end_recognition_percent(*backwards) == 50.0


def test_log_odds_change_sign_with_the_classes_and_grow_with_the_target() -> None:
    scores = np.random.default_rng(3).standard_normal((7, 4))
    there = target_log_odds(scores, 1, 3)
    assert target_log_odds(scores, 3, 1) == pytest.approx(-there)
    surer = scores + np.array([0.0, 0.0, 0.0, 0.5])
    assert target_log_odds(surer, 1, 3) == pytest.approx(there + 0.5)


def test_monotonicity_is_perfect_on_any_rise() -> None:
    steps = np.random.default_rng(4).uniform(0.01, 5.0, (20, 5))
    assert monotonicity(WEIGHTS, np.cumsum(steps, axis=1)) == pytest.approx(np.ones(20))


def test_end_recognition_falls_with_the_fault() -> None:
    contents, starts, targets = np.zeros(4, dtype=int), np.zeros(4, dtype=int), np.ones(4, dtype=int)
    seen_contents, seen_styles = np.zeros((4, 5), dtype=int), np.tile([0, 0, 0, 1, 1], (4, 1))
    shares = []
    for wrong in range(4):
        seen_styles[:wrong, -1] = 2
        shares.append(end_recognition_percent(seen_contents, seen_styles, contents, starts, targets))
    seen_contents[:, 0] = 1
    shares.append(end_recognition_percent(seen_contents, seen_styles, contents, starts, targets))
    assert shares == [100.0, 87.5, 75.0, 62.5, 12.5]


def test_recognition_falls_with_the_fault() -> None:
    contents = np.zeros(4, dtype=int)
    seen = np.zeros((4, 5), dtype=int)
    shares = []
    for wrong in range(4):
        seen[:wrong, 1:-1] = 1
        shares.append(middle_content_percent(seen, contents))
    assert shares == [100.0, 75.0, 50.0, 25.0]


@pytest.mark.parametrize("bad", [[], 1.0, [[1.0]], [[np.nan, 0.0]]])
def test_refuses_what_are_no_scores(bad: Any) -> None:
    with pytest.raises(BadInput, match="class_scores"):
        target_log_odds(bad, 0, 1)


def test_refuses_classes_that_cannot_be() -> None:
    with pytest.raises(BadInput, match="start_class"):
        target_log_odds([[0.0, 0.0]], 2, 1)
    with pytest.raises(BadInput, match="target_class"):
        target_log_odds([[0.0, 0.0]], 0, -1)
    with pytest.raises(BadInput, match="target_class"):
        target_log_odds([[0.0, 0.0]], 1, 1)


@pytest.mark.parametrize("bad", [[], [0.0, 1.0], [0.0, 0.5, 0.5], [0.0, np.nan, 1.0]])
def test_refuses_weights_that_are_no_ladder(bad: list[float]) -> None:
    with pytest.raises(BadInput, match="weights"):
        monotonicity(bad, np.zeros((2, max(len(bad), 1))))


@pytest.mark.parametrize("bad", [np.zeros((0, 5)), np.zeros(5), np.zeros((2, 4)), np.full((2, 5), np.nan)])
def test_refuses_odds_that_do_not_fit(bad: Any) -> None:
    with pytest.raises(BadInput, match="log_odds"):
        monotonicity(WEIGHTS, bad)


@pytest.mark.parametrize("bad", [line(0.0, 1.0), np.zeros((5, 0, 3, 3)), np.zeros((5, 2, 3)), line(0.0, 1.0, np.nan)])
def test_refuses_positions_that_are_no_ladder(bad: Any) -> None:
    with pytest.raises(BadInput, match="positions_m"):
        evenness(bad)


@pytest.mark.parametrize("bad", [[], [0, 1], [[0], [1]], [[0.0, 1.0, 0.0], [0.0, 1.0, 0.0]], [[0, 0, -1], [0, 0, 0]]])
def test_refuses_predictions_that_are_no_labels(bad: Any) -> None:
    with pytest.raises(BadInput, match="predicted_contents"):
        middle_content_percent(bad, CONTENTS)
    with pytest.raises(BadInput, match="predicted_contents"):
        end_recognition_percent(bad, SEEN_STYLES, CONTENTS, STARTS, TARGETS)
    with pytest.raises(BadInput, match="predicted_styles"):
        end_recognition_percent(SEEN_CONTENTS, bad, CONTENTS, STARTS, TARGETS)


@pytest.mark.parametrize("bad", [[], [0], [0, 1, 2], [0.5, 1.0], [0, -1]])
def test_refuses_labels_that_do_not_fit(bad: Any) -> None:
    with pytest.raises(BadInput, match=r"^contents: "):
        middle_content_percent(SEEN_CONTENTS, bad)
    with pytest.raises(BadInput, match=r"^contents: "):
        end_recognition_percent(SEEN_CONTENTS, SEEN_STYLES, bad, STARTS, TARGETS)
    with pytest.raises(BadInput, match="start_styles"):
        end_recognition_percent(SEEN_CONTENTS, SEEN_STYLES, CONTENTS, bad, TARGETS)
    with pytest.raises(BadInput, match="target_styles"):
        end_recognition_percent(SEEN_CONTENTS, SEEN_STYLES, CONTENTS, STARTS, bad)


def test_refuses_two_ladders_of_different_length() -> None:
    with pytest.raises(BadInput, match="predicted_styles"):
        end_recognition_percent(SEEN_CONTENTS, np.zeros((2, 5), dtype=int), CONTENTS, STARTS, TARGETS)
    with pytest.raises(BadInput, match="predicted_contents"):
        middle_content_percent([[0, 0], [1, 1]], CONTENTS)
