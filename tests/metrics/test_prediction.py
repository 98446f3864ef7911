"""Next-frame error, bone length loss and the two baselines of the prediction track."""

from __future__ import annotations

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics.prediction import (
    FeatureStatistics,
    bone_length_loss_m,
    feature_statistics,
    mean_pose_prediction,
    next_frame_error,
    repeat_last_prediction,
)

STATISTICS = FeatureStatistics(np.array([1.0, 5.0]), np.array([2.0, 0.5]), np.array([True, True]))


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_statistics_by_hand() -> None:
    statistics = feature_statistics([[1.0, 7.0], [3.0, 7.0]])
    assert statistics.mean.tolist() == [2.0, 7.0]
    assert statistics.std.tolist() == [1.0, 0.0]
    assert statistics.varies.tolist() == [True, False]
    assert feature_statistics([[0.0, 0.0], [2.0, 4.0]], min_std=1.0).varies.tolist() == [False, True]


def test_a_perfect_prediction_has_no_error(rng: np.random.Generator) -> None:
    frames = rng.standard_normal((10, 2))
    assert next_frame_error(frames, frames, STATISTICS) == 0.0


def test_next_frame_error_by_hand() -> None:
    """z-scores are off by 1 and 2 in the first of two frames: (1 + 4) / 4."""
    assert next_frame_error([[0.0, 0.0], [1.0, 1.0]], [[2.0, 1.0], [1.0, 1.0]], STATISTICS) == pytest.approx(1.25)


def test_constant_features_do_not_count() -> None:
    statistics = feature_statistics([[1.0, 7.0], [3.0, 7.0]])
    assert next_frame_error([[0.0, 0.0]], [[3.0, 100.0]], statistics) == pytest.approx(9.0)


def test_next_frame_error_ignores_units_and_argument_order(rng: np.random.Generator) -> None:
    fit, true, predicted = (rng.standard_normal((30, 5)) for _ in range(3))
    error = next_frame_error(true, predicted, feature_statistics(fit))
    scale, shift = np.array([1.0, 10.0, 0.1, 3.0, 100.0]), 4.0
    rescaled = feature_statistics(fit * scale + shift)
    assert next_frame_error(true * scale + shift, predicted * scale + shift, rescaled) == pytest.approx(error)
    assert next_frame_error(predicted, true, feature_statistics(fit)) == pytest.approx(error)


def test_next_frame_error_grows_with_the_fault(rng: np.random.Generator) -> None:
    true, noise = rng.standard_normal((30, 2)), rng.standard_normal((30, 2))
    errors = [next_frame_error(true, true + scale * noise, STATISTICS) for scale in (0.0, 0.1, 0.2, 1.0)]
    assert errors == sorted(errors) and errors[0] == 0.0
    assert errors[2] == pytest.approx(4.0 * errors[1])


def test_mean_pose_on_the_fit_part_has_error_one(rng: np.random.Generator) -> None:
    fit = rng.standard_normal((200, 4)) * 3.0 + 1.0
    statistics = feature_statistics(fit)
    assert next_frame_error(fit, mean_pose_prediction(statistics, 200), statistics) == pytest.approx(1.0)


def test_statistics_ignore_the_order_of_frames(rng: np.random.Generator) -> None:
    fit = rng.standard_normal((50, 3)) * np.array([1.0, 5.0, 0.0])
    there, back = feature_statistics(fit), feature_statistics(fit[::-1])
    assert back.mean == pytest.approx(there.mean) and back.std == pytest.approx(there.std)
    assert back.varies.tolist() == there.varies.tolist() == [True, True, False]


def test_the_last_pose_repeated_is_worse_the_later_it_is_asked(rng: np.random.Generator) -> None:
    walk = np.cumsum(rng.uniform(0.1, 1.0, (40, 2)), axis=0)
    held = repeat_last_prediction(walk[:10], 30)
    errors = [next_frame_error(walk[t : t + 1], held[t - 10 : t - 9], STATISTICS) for t in (10, 15, 30)]
    assert 0.0 < errors[0] < errors[1] < errors[2]


def test_baselines_by_hand() -> None:
    assert mean_pose_prediction(STATISTICS, 1).tolist() == [[1.0, 5.0]]
    assert mean_pose_prediction(STATISTICS, 2).tolist() == [[1.0, 5.0], [1.0, 5.0]]
    assert repeat_last_prediction([[1.0, 2.0], [3.0, 4.0]], 2).tolist() == [[3.0, 4.0], [3.0, 4.0]]


CHAIN = (-1, 0, 1)


def chain(*lengths: float) -> FloatArray:
    """A straight chain of three joints, one frame."""
    return np.array([[[0.0, 0.0, 0.0], [0.0, lengths[0], 0.0], [0.0, lengths[0] + lengths[1], 0.0]]])


def test_bone_length_loss_by_hand() -> None:
    """Bones of 1 m and 2 m; predicted 1.1 m and 1.7 m: (0.1 + 0.3) / 2."""
    assert bone_length_loss_m(chain(1.0, 2.0), chain(1.1, 1.7), CHAIN) == pytest.approx(0.2)
    assert bone_length_loss_m(chain(1.0, 2.0), chain(1.1, 1.7), CHAIN, virtual=(2,)) == pytest.approx(0.1)


def test_bones_follow_the_parents_given() -> None:
    """Four joints, two of them on the root: bones of 3, 4 and 5 m become 3, 6 and 5 m."""
    true = np.array([[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 4.0, 0.0], [0.0, 4.0, 5.0]]])
    predicted = np.array([[[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, 6.0, 5.0]]])
    assert bone_length_loss_m(true, predicted, (-1, 0, 0, 2)) == pytest.approx(2.0 / 3.0)
    assert bone_length_loss_m(true, predicted, (-1, 0, -1, 2)) == 0.0


def test_bone_length_loss_ignores_pose_place_and_argument_order(rng: np.random.Generator) -> None:
    true, other = chain(1.0, 2.0), chain(1.5, 2.0)
    assert bone_length_loss_m(true, true[..., [1, 0, 2]] + 8.0, CHAIN) == pytest.approx(0.0, abs=1e-12)
    assert bone_length_loss_m(true, other, CHAIN) == bone_length_loss_m(other, true, CHAIN) == pytest.approx(0.25)
    both = [np.concatenate([true, true]), np.concatenate([true, other])]
    assert bone_length_loss_m(both[0], both[1], CHAIN) == pytest.approx(0.125)


def test_bone_length_loss_grows_with_the_fault() -> None:
    losses = [bone_length_loss_m(chain(1.0, 2.0), chain(length, 2.0), CHAIN) for length in (1.0, 1.1, 1.3, 2.0)]
    assert losses == sorted(losses) and losses[0] == 0.0 < losses[1]


FRAMES = np.zeros((4, 2))


@pytest.mark.parametrize("bad", [FRAMES[:0], FRAMES[0], np.full((4, 2), np.nan), np.zeros((4, 3))])
def test_refuses_what_are_no_features(bad: FloatArray) -> None:
    with pytest.raises(BadInput, match="true_features"):
        next_frame_error(bad, FRAMES, STATISTICS)
    with pytest.raises(BadInput, match="predicted_features"):
        next_frame_error(FRAMES, bad, STATISTICS)


def test_refuses_different_lengths() -> None:
    with pytest.raises(BadInput, match="predicted_features"):
        next_frame_error(FRAMES, FRAMES[:3], STATISTICS)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (FRAMES[:1], "features needs at least 2 frames"),
        (FRAMES[:0], r"features must have shape \[any, any\], got \[0, 2\]"),
        (FRAMES[0], r"features must have shape \[any, any\], got \[2\]"),
        (np.full((4, 2), np.nan), "features must be finite"),
        (np.ones((4, 2)), "features are all constant over 4 frames"),
    ],
)
def test_refuses_statistics_of_nothing(bad: FloatArray, message: str) -> None:
    with pytest.raises(BadInput, match=message):
        feature_statistics(bad)


def test_refuses_no_frames_to_predict() -> None:
    with pytest.raises(BadInput, match="n_frames"):
        mean_pose_prediction(STATISTICS, 0)
    with pytest.raises(BadInput, match="n_frames"):
        repeat_last_prediction(FRAMES, 0)
    with pytest.raises(BadInput, match="past_features"):
        repeat_last_prediction(FRAMES[:0], 3)
    with pytest.raises(BadInput, match="past_features"):
        repeat_last_prediction(np.full((4, 2), np.nan), 3)


@pytest.mark.parametrize("bad", [np.zeros((0, 3, 3)), np.zeros((3, 3)), np.full((1, 3, 3), np.inf)])
def test_refuses_what_are_no_positions(bad: FloatArray) -> None:
    with pytest.raises(BadInput, match="true_positions_m"):
        bone_length_loss_m(bad, chain(1.0, 2.0), CHAIN)
    with pytest.raises(BadInput, match="predicted_positions_m"):
        bone_length_loss_m(chain(1.0, 2.0), bad, CHAIN)


@pytest.mark.parametrize("other", [np.zeros((2, 3, 3)), np.zeros((1, 4, 3))])
def test_refuses_motions_of_different_length_or_skeleton(other: FloatArray) -> None:
    with pytest.raises(BadInput, match="predicted_positions_m"):
        bone_length_loss_m(chain(1.0, 2.0), other, CHAIN)


@pytest.mark.parametrize("parents", [(-1, 0), (-1, 0, 3), (-2, 0, 1), (-1, -1, -1)])
def test_refuses_parents_that_do_not_fit(parents: tuple[int, ...]) -> None:
    with pytest.raises(BadInput, match="parents"):
        bone_length_loss_m(chain(1.0, 2.0), chain(1.0, 2.0), parents)


def test_refuses_when_no_bone_is_left() -> None:
    with pytest.raises(BadInput, match="virtual"):
        bone_length_loss_m(chain(1.0, 2.0), chain(1.0, 2.0), CHAIN, virtual=(1, 2))
