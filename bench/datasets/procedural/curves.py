"""Smooth curves from which the procedural motions are made: eases, bumps, periodic key poses, slow noise."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.interpolate import PchipInterpolator

from bench.arrays import FloatArray

TAU = 2.0 * np.pi


def wave(cycles: FloatArray) -> FloatArray:
    """Cosine of a phase counted in cycles: 1 at whole numbers, -1 half way."""
    return np.asarray(np.cos(TAU * cycles))


def ease(fraction: FloatArray) -> FloatArray:
    """0 to 1 with zero velocity and acceleration at both ends; held outside."""
    s = np.clip(fraction, 0.0, 1.0)
    return np.asarray(s * s * s * (s * (6.0 * s - 15.0) + 10.0))


def bump(fraction: FloatArray, peak: float = 0.5) -> FloatArray:
    """0 to 1 and back over ``fraction`` 0..1 with the top at ``peak``; 0 outside."""
    s = np.clip(fraction, 0.0, 1.0)
    return np.asarray(np.sin(np.pi * s ** (np.log(0.5) / np.log(peak))) ** 2)


@lru_cache(maxsize=512)
def _periodic(knots: tuple[float, ...], values: tuple[float, ...]) -> PchipInterpolator:
    x, y = np.asarray(knots), np.asarray(values)
    return PchipInterpolator(np.concatenate([x - 1.0, x, x + 1.0]), np.tile(y, 3))


def key_poses(cycles: FloatArray, keys: tuple[tuple[float, float], ...]) -> FloatArray:
    """Periodic curve through ``keys`` (place in the cycle 0..1, value), monotone between keys, flat at turning points.

    Between two equal values the curve is exactly constant, so a planted foot stays put.
    """
    curve = _periodic(tuple(k for k, _ in keys), tuple(v for _, v in keys))
    return np.asarray(curve(np.mod(cycles, 1.0)))


def hermite(cycles: FloatArray, places: list[float], values: list[float], slopes: list[float]) -> FloatArray:
    """Cubic through ``places`` (ascending, first 0 and last 1) with given values and slopes per cycle."""
    u = np.mod(cycles, 1.0)
    x, y, m = np.asarray(places), np.asarray(values), np.asarray(slopes)
    i = np.clip(np.searchsorted(x, u, side="right") - 1, 0, len(x) - 2)
    h = x[i + 1] - x[i]
    s = (u - x[i]) / h
    rise = s * s * (3.0 - 2.0 * s)
    return np.asarray(y[i] * (1.0 - rise) + y[i + 1] * rise + h * s * (1.0 - s) * (m[i] * (1.0 - s) - m[i + 1] * s))


def band_noise(
    time_s: FloatArray, rng: np.random.Generator, channels: int, low_hz: float, high_hz: float, waves: int = 4
) -> FloatArray:
    """Sums of ``waves`` sinusoids between two frequencies, unit variance: ``[T] -> [T, channels]``."""
    hz = rng.uniform(low_hz, high_hz, (channels, waves))
    start = rng.uniform(0.0, 1.0, (channels, waves))
    angles = TAU * (time_s[:, None, None] * hz + start)
    return np.asarray(np.sin(angles).sum(axis=2) * np.sqrt(2.0 / waves))
