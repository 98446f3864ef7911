"""Kuriyama's content and style error: values by hand, segments, mirroring, frames of reference, refusals."""

from __future__ import annotations

from typing import cast

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadInput
from bench.metrics.dtw import Backend
from bench.metrics.gesture import (
    ErrorSummary,
    Frame,
    Tail,
    content_error_components,
    hand_trajectories,
    mirrored_hands,
    segment_frames,
    segment_starts,
    style_error_components,
    summarise,
)
from bench.motion import quat, skeleton
from bench.motion.kinematics import facing_yaw


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def smooth(frames: int, rng: np.random.Generator) -> FloatArray:
    steps = rng.standard_normal((frames, 6)) * 0.02
    return np.asarray(np.cumsum(steps, axis=0))


def test_perfect_content_costs_nothing(rng: np.random.Generator) -> None:
    hands = smooth(40, rng)
    assert np.all(content_error_components(hands, hands) == 0.0)
    assert np.all(content_error_components(hands, np.repeat(hands, 2, axis=0)) == 0.0)


def test_content_error_by_hand() -> None:
    """Frame pairs 0-0, 1-1, 2-1; the right hand is off by (0, 3, 4) cm in the first pair only."""
    content = np.zeros((3, 6))
    content[1:, 0] = 1.0
    output = np.zeros((2, 6))
    output[0, 4:] = 0.03, 0.04
    output[1, 0] = 1.0
    assert content_error_components(content, output) == pytest.approx([0.05, 0.0, 0.0])


def test_content_error_grows_with_the_fault_and_ignores_a_common_shift(rng: np.random.Generator) -> None:
    hands = smooth(60, rng)
    noise = rng.standard_normal(hands.shape)
    means = [content_error_components(hands, hands + scale * noise).mean() for scale in (0.0, 0.01, 0.05, 0.2)]
    assert means == sorted(means) and means[0] == 0.0 < means[1]
    other = smooth(50, rng)
    assert content_error_components(hands + 1.0, other + 1.0) == pytest.approx(content_error_components(hands, other))


def test_content_error_backends_agree_on_a_plain_pair(rng: np.random.Generator) -> None:
    hands = smooth(30, rng)
    assert np.all(content_error_components(hands, hands, "fastdtw") == 0.0)
    other = smooth(44, rng)
    exact = content_error_components(hands, other).sum()
    assert content_error_components(hands, other, "fastdtw").sum() >= exact * (1.0 - 1e-12)


def test_content_error_is_the_same_from_either_side(rng: np.random.Generator) -> None:
    hands, other = smooth(40, rng), smooth(55, rng)
    there, back = content_error_components(hands, other), content_error_components(other, hands)
    assert np.sort(back) == pytest.approx(np.sort(there)) and there.sum() > 0.1


def test_perfect_style_costs_nothing(rng: np.random.Generator) -> None:
    hands = smooth(150, rng)
    assert np.all(style_error_components(hands, hands, 30.0) == 0.0)


def test_style_error_by_hand() -> None:
    """One segment each. Means differ by (3, 4) cm, standard deviations by 2 cm: 5 + 2 = 7 cm."""
    style = np.array([[0.0] * 6, [0.0] * 6])
    output = np.array([[0.03, 0.04, 0.02, 0.0, 0.0, 0.0], [0.03, 0.04, -0.02, 0.0, 0.0, 0.0]])
    assert style_error_components(style, output, 30.0) == pytest.approx([0.07])


def test_style_error_takes_the_nearest_style_segment() -> None:
    """Theta 2 frames, hop 1: the style holds 0 then 1; an output that holds 0.9 is 0.1 from the second."""
    style = np.zeros((4, 6))
    style[2:, 1] = 1.0
    output = np.zeros((2, 6))
    output[:, 1] = 0.9
    assert style_error_components(style, output, 1.0, theta_s=2.0) == pytest.approx([0.1])


def test_every_output_segment_is_scored_in_order() -> None:
    style = np.zeros((2, 6))
    output = np.zeros((6, 6))
    output[:, 1] = [0.0, 0.0, 1.0, 1.0, 3.0, 3.0]
    scored = style_error_components(style, output, 1.0, theta_s=2.0)
    assert scored == pytest.approx([0.0, 1.0, 1.0, 3.0, 3.0])


def test_style_error_is_not_symmetric() -> None:
    """An output that shows half of the style is right everywhere; the style is not right as an output for it."""
    style = np.zeros((8, 6))
    style[4:, 1] = 1.0
    half = np.zeros((4, 6))
    assert style_error_components(style, half, 1.0, theta_s=4.0).max() == 0.0
    assert style_error_components(half, style, 1.0, theta_s=4.0).max() == pytest.approx(1.0)


def test_a_mirrored_output_is_free_only_with_the_mirrored_style(rng: np.random.Generator) -> None:
    style = smooth(100, rng) + 0.3
    output = mirrored_hands(style)
    assert style_error_components(style, output, 30.0).max() == pytest.approx(0.0, abs=1e-12)
    assert style_error_components(style, output, 30.0, mirror_style=False).min() > 0.1


def test_mirrored_hands_swaps_sides_and_negates_x() -> None:
    assert mirrored_hands([[1.0, 2.0, 3.0, 4.0, 5.0, 6.0]]).tolist() == [[-4.0, 5.0, 6.0, -1.0, 2.0, 3.0]]
    hands = np.arange(12.0).reshape(2, 6)
    assert mirrored_hands(mirrored_hands(hands)).tolist() == hands.tolist()


def test_style_error_does_not_depend_on_the_frame_rate() -> None:
    """A slow motion sampled twice as densely has nearly the same segments in seconds."""
    times = np.linspace(0.0, 8.0, 481)
    hands = np.stack([0.3 * np.sin(times + phase) for phase in range(6)], axis=1)
    other = np.stack([0.5 * np.sin(times + phase) for phase in range(6)], axis=1)
    dense = style_error_components(hands, other, 60.0).mean()
    sparse = style_error_components(hands[::2], other[::2], 30.0).mean()
    assert sparse == pytest.approx(dense, rel=0.02) and dense > 0.05


def test_style_error_grows_with_the_fault(rng: np.random.Generator) -> None:
    style = smooth(200, rng)
    errors = [style_error_components(style, style * scale, 30.0).mean() for scale in (1.0, 1.2, 1.5, 3.0)]
    assert errors == sorted(errors) and errors[0] == 0.0 < errors[1]


@pytest.mark.parametrize(
    ("theta_s", "fps", "frames"), [(2.13, 60.0, 128), (1.07, 60.0, 64), (4.27, 60.0, 256), (2.13, 30.0, 64)]
)
def test_theta_is_seconds(theta_s: float, fps: float, frames: int) -> None:
    assert segment_frames(theta_s, fps) == frames


def test_segments_overlap_by_half_and_the_tail_rule_decides_the_rest() -> None:
    assert segment_starts(256, 128) == (0, 64, 128)
    assert segment_starts(300, 128, "drop") == (0, 64, 128)
    assert segment_starts(300, 128, "cover") == (0, 64, 128, 172)
    assert segment_starts(128, 128) == segment_starts(127, 128) == segment_starts(2, 128) == (0,)
    assert segment_starts(10, 5) == (0, 2, 4, 5)


def test_the_tail_is_scored_unless_dropped() -> None:
    style, output = np.zeros((4, 6)), np.zeros((5, 6))
    output[4, 1] = 1.0
    assert style_error_components(style, output, 1.0, theta_s=4.0, tail="drop").max() == 0.0
    assert style_error_components(style, output, 1.0, theta_s=4.0).max() > 0.0


def test_summary_by_hand() -> None:
    assert summarise([4.0, 0.0, 1.0, 2.0, 3.0, 5.0, 6.0, 7.0]) == ErrorSummary(3.5, 7.0, 6.5)
    assert summarise([1.0, 5.0, 3.0, 2.0, 4.0]) == ErrorSummary(3.0, 5.0, 4.5)
    assert summarise([2.0]) == ErrorSummary(2.0, 2.0, 2.0)


def test_summary_ignores_order_scales_and_grows_with_every_component() -> None:
    components = np.random.default_rng(3).uniform(0.0, 1.0, 21)
    plain, shuffled, doubled = (summarise(c) for c in (components, components[::-1], 2.0 * components))
    assert shuffled.mean == pytest.approx(plain.mean) and shuffled.worst_quarter == pytest.approx(plain.worst_quarter)
    assert (doubled.mean, doubled.worst) == pytest.approx((2.0 * plain.mean, 2.0 * plain.worst))
    assert plain.mean < plain.worst_quarter < plain.worst
    components[components.argmax()] += 1.0
    worse = summarise(components)
    assert worse.mean > plain.mean and worse.worst_quarter > plain.worst_quarter and worse.worst > plain.worst
    assert summarise(np.zeros(5)) == ErrorSummary(0.0, 0.0, 0.0)


def test_hands_by_hand() -> None:
    """A body that faces +X: what is ahead of it is its local z, what is to its left its local x."""
    positions = np.zeros((1, 21, 3))
    positions[:, (skeleton.LEFT_UP_LEG, skeleton.LEFT_ARM), 2] = -0.2
    positions[:, (skeleton.RIGHT_UP_LEG, skeleton.RIGHT_ARM), 2] = 0.2
    positions[0, skeleton.LEFT_HAND], positions[0, skeleton.RIGHT_HAND] = (0.3, 1.2, -0.4), (0.1, 0.9, 0.5)
    positions += np.array([7.0, 0.0, 8.0])
    assert hand_trajectories(positions)[0] == pytest.approx([0.4, 1.2, 0.3, -0.5, 0.9, 0.1])
    assert hand_trajectories(positions, "world")[0] == pytest.approx([7.3, 1.2, 7.6, 7.1, 0.9, 8.5])


def body(frames: int, rng: np.random.Generator) -> FloatArray:
    positions = rng.standard_normal((frames, 21, 3))
    positions[:, (skeleton.LEFT_UP_LEG, skeleton.LEFT_ARM), 0] += 5.0
    return positions


def test_root_frame_follows_the_body_and_world_frame_does_not(rng: np.random.Generator) -> None:
    positions = body(20, rng)
    hands = hand_trajectories(positions)
    turned = quat.rotate(quat.about_y(np.linspace(0.0, 5.0, 20))[:, None], positions) + rng.standard_normal((20, 1, 3))
    assert hand_trajectories(turned) == pytest.approx(hands)
    world = positions[:, (skeleton.LEFT_HAND, skeleton.RIGHT_HAND)].reshape(20, 6)
    assert hand_trajectories(positions, "world").tolist() == world.tolist()


def test_root_frame_is_the_facing_of_the_motion_core(rng: np.random.Generator) -> None:
    positions = body(9, rng)
    back = quat.about_y(-facing_yaw(positions))[:, None]
    local = quat.rotate(back, positions - positions[:, :1])
    wanted = local[:, (skeleton.LEFT_HAND, skeleton.RIGHT_HAND)].reshape(9, 6)
    assert hand_trajectories(positions) == pytest.approx(wanted)


def test_mirroring_hands_is_mirroring_the_body(rng: np.random.Generator) -> None:
    positions = body(9, rng)
    mirrored_body = positions[:, skeleton.MIRROR_JOINTS] * np.array([-1.0, 1.0, 1.0])
    frames: tuple[Frame, ...] = ("root", "world")
    for frame in frames:
        mirrored = mirrored_hands(hand_trajectories(positions, frame))
        assert hand_trajectories(mirrored_body, frame) == pytest.approx(mirrored)


GOOD = np.zeros((80, 6))
BAD_HANDS = [np.zeros((0, 6)), np.zeros((80, 3)), np.zeros(80), np.full((80, 6), np.nan)]


@pytest.mark.parametrize("bad", BAD_HANDS)
def test_refuses_what_is_no_pair_of_hands(bad: FloatArray) -> None:
    with pytest.raises(BadInput, match="content_hands_m"):
        content_error_components(bad, GOOD)
    with pytest.raises(BadInput, match="output_hands_m"):
        content_error_components(GOOD, bad)
    with pytest.raises(BadInput, match="style_hands_m"):
        style_error_components(bad, GOOD, 60.0)
    with pytest.raises(BadInput, match="output_hands_m"):
        style_error_components(GOOD, bad, 60.0)
    with pytest.raises(BadInput, match="hands_m"):
        mirrored_hands(bad)


def test_refuses_one_frame_where_a_spread_is_needed() -> None:
    with pytest.raises(BadInput, match="style_hands_m"):
        style_error_components(GOOD[:1], GOOD, 60.0)
    with pytest.raises(BadInput, match="output_hands_m"):
        style_error_components(GOOD, GOOD[:1], 60.0)


@pytest.mark.parametrize("fps", [0.0, -60.0, float("nan"), float("inf")])
def test_refuses_a_frame_rate_that_is_none(fps: float) -> None:
    with pytest.raises(BadInput, match=r"^fps:"):
        style_error_components(GOOD, GOOD, fps)


@pytest.mark.parametrize("theta_s", [0.0, 0.01, -2.0, float("nan"), float("inf")])
def test_refuses_a_theta_under_two_frames(theta_s: float) -> None:
    with pytest.raises(BadInput, match="theta_s"):
        style_error_components(GOOD, GOOD, 60.0, theta_s=theta_s)


def test_refuses_unknown_options() -> None:
    with pytest.raises(BadConfig, match="tail"):
        style_error_components(GOOD, GOOD, 60.0, tail=cast(Tail, "wrap"))
    with pytest.raises(BadConfig, match="frame"):
        hand_trajectories(np.zeros((2, 21, 3)), cast(Frame, "pelvis"))
    with pytest.raises(BadConfig, match="backend"):
        content_error_components(GOOD, GOOD, cast(Backend, "slow"))
    with pytest.raises(BadConfig, match="tail"):
        segment_starts(10, 4, cast(Tail, "wrap"))


@pytest.mark.parametrize("bad", [[], [[1.0]], [np.nan], [-1.0, 2.0]])
def test_refuses_components_that_are_no_errors(bad: list[float]) -> None:
    with pytest.raises(BadInput, match="components_m"):
        summarise(bad)


@pytest.mark.parametrize("shape", [(0, 21, 3), (5, 20, 3), (5, 21, 2), (21, 3)])
def test_refuses_positions_of_another_shape(shape: tuple[int, ...]) -> None:
    with pytest.raises(BadInput, match="positions_m"):
        hand_trajectories(np.zeros(shape))


def test_refuses_positions_that_are_not_finite() -> None:
    positions = np.zeros((3, 21, 3))
    positions[1, 4, 2] = np.nan
    with pytest.raises(BadInput, match="positions_m must be finite, got 1 NaN"):
        hand_trajectories(positions)
