"""Statistics of measured durations."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from bench.errors import BadInput
from bench.metrics.runtime import (
    DEADLINE_FPS,
    deadline_miss_percent,
    duration_statistics,
    frames_per_second,
    real_time_factor,
    startup_latency,
)


def test_quantiles_by_hand() -> None:
    """101 calls of 0.01 to 1.01 s: the p-th percentile is the (p + 1)-th call."""
    statistics = duration_statistics(np.arange(1, 102) / 100.0)
    assert statistics.n == 101
    assert statistics.p50_s == pytest.approx(0.51)
    assert statistics.p90_s == pytest.approx(0.91)
    assert statistics.p95_s == pytest.approx(0.96)
    assert statistics.p99_s == pytest.approx(1.00)
    assert statistics.max_s == pytest.approx(1.01)
    assert statistics.iqr_s == pytest.approx(0.50)


def test_quantiles_between_calls_are_interpolated() -> None:
    statistics = duration_statistics([1.0, 3.0])
    assert (statistics.p50_s, statistics.p90_s, statistics.iqr_s) == pytest.approx((2.0, 2.8, 1.0))


def test_quantiles_ignore_order_and_scale_with_time() -> None:
    durations = np.random.default_rng(0).uniform(0.1, 2.0, 57)
    statistics = duration_statistics(durations)
    assert duration_statistics(durations[::-1]) == statistics
    assert duration_statistics(2.0 * durations).p95_s == pytest.approx(2.0 * statistics.p95_s)
    assert duration_statistics(np.full(9, 0.25)).iqr_s == 0.0


def test_one_slow_call_shows_in_the_maximum_and_not_in_the_median() -> None:
    durations = np.full(100, 0.01)
    durations[7] = 5.0
    statistics = duration_statistics(durations)
    assert statistics.p50_s == statistics.p90_s == 0.01 and statistics.max_s == 5.0


def test_throughput_by_hand() -> None:
    """60 frames in 0.5 s at the median: 120 frames a second, four times real time at 30 fps."""
    durations = [0.1, 0.5, 0.9]
    assert frames_per_second(durations, 60) == pytest.approx(120.0)
    assert real_time_factor(durations, 60, 30.0) == pytest.approx(4.0)
    assert real_time_factor(durations, 60, 60.0) == pytest.approx(2.0)


def test_throughput_of_the_published_gesture_runtime() -> None:
    """13 us a pose is 77 thousand poses a second."""
    assert frames_per_second([13e-6] * 3, 1) == pytest.approx(77e3, rel=0.01)


def test_deadline_misses_by_hand() -> None:
    durations = [0.005, 0.010, 0.020, 0.040]
    assert [deadline_miss_percent(durations, fps) for fps in DEADLINE_FPS] == [25.0, 50.0, 75.0]
    assert deadline_miss_percent(durations, 30.0, frames_per_call=2) == 0.0
    assert deadline_miss_percent([1.0, 3.0], 0.5) == 50.0
    assert deadline_miss_percent(durations, 60.0, frames_per_call=2) == 25.0


def test_a_call_that_ends_on_the_deadline_is_in_time() -> None:
    assert deadline_miss_percent([0.25, 0.25], 4.0) == 0.0


def test_misses_grow_and_real_time_factor_falls_with_duration() -> None:
    durations = np.linspace(0.001, 0.03, 50)
    slower = [durations * factor for factor in (1.0, 2.0, 4.0)]
    misses = [deadline_miss_percent(d, 60.0) for d in slower]
    factors = [real_time_factor(d, 1, 60.0) for d in slower]
    assert misses == sorted(misses) and misses[0] < misses[2]
    assert factors == sorted(factors, reverse=True)
    assert factors[0] == pytest.approx(2.0 * factors[1])


def test_startup_latency_by_hand() -> None:
    latency = startup_latency(32, 5, 30.0)
    assert latency.designed_s == pytest.approx(32.0 / 30.0)
    assert latency.measured_s == pytest.approx(0.2)
    causal = startup_latency(1, 0, 60.0)
    assert causal.designed_s == causal.measured_s == pytest.approx(1.0 / 60.0)


def test_throughput_grows_with_frames_and_only_the_median_counts() -> None:
    durations = np.array([0.2, 0.1, 0.3])
    assert frames_per_second(durations, 120) == pytest.approx(2.0 * frames_per_second(durations, 60))
    assert frames_per_second(durations[::-1], 60) == frames_per_second([0.2, 0.001, 9.0], 60) == pytest.approx(300.0)
    assert real_time_factor(durations[::-1], 6, 30.0) == real_time_factor(durations, 6, 30.0) == pytest.approx(1.0)
    assert (
        deadline_miss_percent(durations[::-1], 4.0) == deadline_miss_percent(durations, 4.0) == pytest.approx(100 / 3)
    )


def test_startup_grows_with_input_and_look_ahead_and_shrinks_with_the_frame_rate() -> None:
    designed = [startup_latency(frames, 0, 30.0).designed_s for frames in (1, 32, 64)]
    measured = [startup_latency(1, frames, 30.0).measured_s for frames in (0, 1, 31)]
    assert designed[0] < designed[1] < designed[2] == pytest.approx(64.0 * designed[0])
    assert measured[0] < measured[1] < measured[2] == pytest.approx(32.0 * measured[0])
    assert startup_latency(32, 5, 60.0).designed_s == pytest.approx(0.5 * startup_latency(32, 5, 30.0).designed_s)


DURATION_FUNCTIONS: list[Callable[[Any], Any]] = [
    duration_statistics,
    lambda d: frames_per_second(d, 1),
    lambda d: real_time_factor(d, 1, 30.0),
    lambda d: deadline_miss_percent(d, 30.0),
]


@pytest.mark.parametrize("function", DURATION_FUNCTIONS)
@pytest.mark.parametrize("bad", [[], [0.1], [0.1, np.nan], [0.1, 0.0], [0.1, -0.1], [[0.1, 0.2]]])
def test_refuses_what_are_no_durations(function: Callable[[Any], Any], bad: list[Any]) -> None:
    with pytest.raises(BadInput, match="durations_s"):
        function(bad)


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf")])
def test_refuses_a_frame_rate_that_is_none(fps: float) -> None:
    for call in (
        lambda: real_time_factor([0.1, 0.1], 1, fps),
        lambda: deadline_miss_percent([0.1, 0.1], fps),
        lambda: startup_latency(1, 0, fps),
    ):
        with pytest.raises(BadInput, match="fps"):
            call()


def test_refuses_frame_counts_that_cannot_be() -> None:
    with pytest.raises(BadInput, match="frames_per_call"):
        frames_per_second([0.1, 0.1], 0)
    with pytest.raises(BadInput, match="frames_per_call"):
        real_time_factor([0.1, 0.1], -1, 30.0)
    with pytest.raises(BadInput, match="frames_per_call"):
        deadline_miss_percent([0.1, 0.1], 30.0, frames_per_call=0)
    with pytest.raises(BadInput, match="designed_input_frames"):
        startup_latency(0, 0, 30.0)
    with pytest.raises(BadInput, match="look_ahead_frames"):
        startup_latency(1, -1, 30.0)
