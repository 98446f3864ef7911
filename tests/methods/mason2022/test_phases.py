"""Phases of locomotion: known sines come back, footsteps make a clock, and the fit is no worse than evolution."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import Bounds, differential_evolution

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.methods.mason2022.phases import (
    circular_mean,
    contact_free_source,
    fit_sinusoids,
    global_phase,
    phase_advance,
    phase_features,
    phase_of,
    principal_axis,
    source_function,
)

FPS = 60.0
TIMES_S = np.arange(240) / FPS


def sine(frequency_hz: float, phase: float = 0.0, amplitude: float = 1.0) -> FloatArray:
    return np.asarray(amplitude * np.sin(2.0 * np.pi * (frequency_hz * TIMES_S + phase)))


@pytest.mark.parametrize("frequency_hz", [0.8, 1.0, 1.37, 3.9])
def test_a_sine_is_found_again(frequency_hz: float) -> None:
    found = fit_sinusoids(sine(frequency_hz, 0.3, 2.0) + 0.7, FPS)
    inside = slice(30, -30)
    expected = (frequency_hz * TIMES_S + 0.3) % 1.0
    assert np.abs((found.phase - expected + 0.5) % 1.0 - 0.5)[inside].max() < 5e-3
    assert np.abs(found.frequency_hz - frequency_hz)[inside].max() < 0.02
    assert np.allclose(found.amplitude[inside], 2.0, rtol=0.02)
    assert np.allclose(found.offset[inside], 0.7, atol=0.05)
    assert found.error[inside].max() < 1e-3


def test_fit_is_no_worse_than_evolution() -> None:
    rng = np.random.default_rng(0)
    source = sine(1.1) * (1.0 + 0.3 * sine(0.3)) + 0.2 * rng.standard_normal(240)
    found = fit_sinusoids(source, FPS)
    times_s = np.arange(-30, 31) / FPS

    for frame in (60, 100, 150):
        wanted = source[frame - 30 : frame + 31]

        def error(numbers: FloatArray, wanted: FloatArray = wanted) -> float:
            amplitude, frequency, shift, offset = numbers
            return float(
                ((amplitude * np.sin(2 * np.pi * (frequency * times_s - shift)) + offset - wanted) ** 2).mean()
            )

        bounds = Bounds([0.0, 0.25, -0.5, -2.0], [3.0, 4.0, 0.5, 2.0])
        evolved = differential_evolution(error, bounds, popsize=12, maxiter=10, seed=1, polish=False)
        assert found.error[frame] <= evolved.fun + 1e-9


def test_a_crest_is_not_taken_for_a_huge_slow_sine() -> None:
    times_s = np.linspace(-1.0, 1.0, 121)
    found = fit_sinusoids(1.0 - 0.3 * times_s**2, FPS)
    windows = np.lib.stride_tricks.sliding_window_view(1.0 - 0.3 * times_s**2, 61)
    assert (found.amplitude[30:-30] <= np.ptp(windows, axis=1) + 1e-5).all()
    assert np.allclose(fit_sinusoids(np.ones(90), FPS).amplitude, 0.0)


def test_source_is_normalised_within_a_second_and_still_limbs_give_nothing() -> None:
    source = source_function(sine(1.0, amplitude=0.2) + 5.0, FPS)
    assert np.allclose(source[60:-60].std(), 1.0, atol=0.05)
    assert np.allclose(source_function(np.full(240, 3.0), FPS), 0.0)
    assert not np.abs(source_function(sine(12.0), FPS)[60:-60]).max() > 0.1


def test_axis_points_forward_so_that_limbs_in_turn_differ_by_half_a_cycle() -> None:
    swing = np.stack([0.1 * sine(1.0), np.full(240, 0.9), 0.5 * sine(1.0)], axis=1)
    for positions in (swing, swing[::-1]):
        axis = principal_axis(positions)
        assert axis.direction[2] > 0.9
        assert np.allclose(axis.mean_m, [0.0, 0.9, 0.0], atol=1e-9)
    source = contact_free_source(swing, principal_axis(swing))
    assert np.allclose(source, np.hypot(0.1, 0.5) * sine(1.0), atol=1e-9)
    other = swing * np.array([1.0, 1.0, -1.0])
    opposite = contact_free_source(other, principal_axis(other))
    phases = [fit_sinusoids(source_function(s, FPS), FPS).phase[60:-60] for s in (source, opposite)]
    assert abs(circular_mean(phases[0] - phases[1]) - 0.5) < 0.01
    with pytest.raises(BadInput, match="needs 2 positions"):
        principal_axis(swing[:1])


def test_features_are_the_phase_scaled_by_amplitude_and_speed() -> None:
    found = fit_sinusoids(sine(1.0), FPS)
    features = phase_features(found, np.full(240, 2.0), FPS)
    assert np.allclose(np.linalg.norm(features, axis=1), 2.0 * found.amplitude)
    assert np.allclose(phase_of(features), found.phase)
    speed = np.where(np.arange(240) == 120, 3.0, 1.0)
    released = phase_features(found, speed, FPS, as_released=True)
    assert np.allclose(np.linalg.norm(released, axis=1)[100:140], 3.0)
    assert np.allclose(np.linalg.norm(released, axis=1)[:80], 1.0)


def test_advance_takes_the_short_way_round() -> None:
    assert np.allclose(phase_advance(np.array([0.9, 0.1, 0.0, 0.5])), [0.2, -0.1, -0.5])


def test_global_phase_is_a_clock_of_footsteps() -> None:
    contacts = np.zeros((100, 2), dtype=bool)
    for start in (10, 50, 90):
        contacts[start : start + 20, 0] = True
    for start in (30, 70):
        contacts[start : start + 20, 1] = True
    phase = global_phase(contacts)
    assert np.allclose(phase[[10, 30, 50, 70, 90]], [0.0, 0.5, 0.0, 0.5, 0.0])
    assert np.allclose(phase_advance(phase), 1.0 / 40.0)
    assert np.allclose(global_phase(contacts[:, ::-1])[10], 0.5)
    assert np.allclose(global_phase(np.ones((5, 2), dtype=bool)), 0.0)


def test_circular_mean_does_not_break_at_the_wrap() -> None:
    assert min(circular_mean([0.95, 0.05]), 1.0 - circular_mean([0.95, 0.05])) < 1e-9
    assert circular_mean([0.4, 0.6]) == pytest.approx(0.5)
