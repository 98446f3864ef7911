"""Phases of locomotion: a global one from footsteps for PFNN, local ones of hands and feet for LPN.

A local phase is read off a source function of one end effector, by fitting a sine to it around every frame (Mason 2022,
section 4.1, after Starke et al. 2020, section 5.2). The source is a step function of floor contacts, or, where a limb
has none, its position along the first principal axis of its own movement. Phases are in cycles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.signal import butter, sosfiltfilt

from bench.arrays import BoolArray, FloatArray
from bench.errors import BadInput

WINDOW_S = 1.0
BUTTERWORTH_HZ, BUTTERWORTH_ORDER = 4.0, 4
LEAST_HZ, MOST_HZ = 0.25, 4.0
GRID_HZ, REFINED_HZ = 0.125, 0.0125
"""Steps between the frequencies that are tried, over the whole range and then around the best."""
STILL_M = 1e-6


@dataclass(frozen=True, eq=False)
class Sinusoids:
    """``amplitude * sin(2 pi phase) + offset``, fitted around each frame.

    Attributes
    ----------
    phase : ``[T]`` cycles in [0, 1), at the frame itself.
    frequency_hz, amplitude, offset : ``[T]``; amplitudes lie between 0 and the range of the source in the window.
    error : ``[T]`` mean squared residual over the window.
    """

    phase: FloatArray
    frequency_hz: FloatArray
    amplitude: FloatArray
    offset: FloatArray
    error: FloatArray


@dataclass(frozen=True, eq=False)
class Axis:
    """Where a bone moves to and fro, in the local frame.

    Attributes
    ----------
    mean_m : ``[3]`` its mean position.
    direction : ``[3]`` first principal axis, of length 1, pointing forward.
    """

    mean_m: FloatArray
    direction: FloatArray


def principal_axis(local_positions_m: FloatArray) -> Axis:
    """First principal axis of positions ``[N, 3]`` of one bone in one style and gait, +Z being forward (section 4.1.3).

    Directed, so that limbs that swing together can be told from limbs that swing in turn.

    Raises
    ------
    BadInput : fewer than 2 positions.
    """
    if len(local_positions_m) < 2:
        raise BadInput(f"a principal axis needs 2 positions, got {len(local_positions_m)}", where="local_positions_m")
    mean = local_positions_m.mean(axis=0)
    _, _, axes = np.linalg.svd(local_positions_m - mean, full_matrices=False)
    direction = axes[0]
    return Axis(mean, -direction if direction[2] < 0.0 else direction)


def contact_free_source(local_positions_m: FloatArray, axis: Axis) -> FloatArray:
    """Position along the axis, ``[T, 3] -> [T]`` metres."""
    return np.asarray((local_positions_m - axis.mean_m) @ axis.direction)


def source_function(raw: FloatArray, fps: float) -> FloatArray:
    """A raw source ``[T]`` normalised within one second around each frame, then low-pass filtered (section 4.1.4).

    A window in which nothing changes gives 0.
    """
    n = _half(fps)
    around = sliding_window_view(np.pad(raw, n, mode="edge"), 2 * n + 1)
    deviation = around.std(axis=1)
    normal = (raw - around.mean(axis=1)) / np.where(deviation > STILL_M, deviation, np.inf)
    filter_ = butter(BUTTERWORTH_ORDER, BUTTERWORTH_HZ, fs=fps, output="sos")
    return np.asarray(sosfiltfilt(filter_, normal, padtype="even", padlen=min(3 * n, len(normal) - 1)))


def fit_sinusoids(source: FloatArray, fps: float) -> Sinusoids:
    """The sine of least squared error within one second around each frame of ``[T]``.

    For a given frequency the best sine is a linear regression on sine, cosine and 1, so only the frequency is searched:
    on a grid over 1/4 to 4 Hz, then finely around the best. A sine may not be larger than the range of what it is
    fitted to, else a slow one of which only the crest is seen would be. Starke et al. search all four numbers by
    evolution; the result here is never worse.
    """
    n = _half(fps)
    around = sliding_window_view(np.pad(source, n, mode="reflect", reflect_type="even"), 2 * n + 1)
    times_s = np.arange(-n, n + 1) / fps
    coarse = np.arange(LEAST_HZ, MOST_HZ + 1e-9, GRID_HZ)
    best = coarse[np.argmin([_fit(around, times_s, frequency)[1] for frequency in coarse], axis=0)]
    lowest = np.full(len(source), np.inf)
    result = np.zeros((4, len(source)))
    for step in np.arange(-GRID_HZ, GRID_HZ + 1e-9, REFINED_HZ):
        for centre in np.unique(best):
            frequency = float(np.clip(centre + step, LEAST_HZ, MOST_HZ))
            rows = np.flatnonzero(best == centre)
            found, error = _fit(around[rows], times_s, frequency)
            better = error < lowest[rows]
            lowest[rows[better]] = error[better]
            result[:3, rows[better]] = found[better].T
            result[3, rows[better]] = frequency
    of_sine, of_cosine, offset, frequency_hz = result
    phase = np.arctan2(of_cosine, of_sine) / (2.0 * np.pi) % 1.0
    return Sinusoids(phase, frequency_hz, np.hypot(of_sine, of_cosine), offset, lowest)


def phase_features(sinusoids: Sinusoids, speed_m_s: FloatArray, fps: float, *, as_released: bool = False) -> FloatArray:
    """Equation 1: ``[T, 2]``, ``|v_w| a (sin, cos)`` of the phase, with the bone's mean speed over one second.

    Parameters
    ----------
    speed_m_s : ``[T]`` of the bone.
    as_released : the released exporter leaves the amplitude out and takes the largest speed of the second.
    """
    n = _half(fps)
    around = sliding_window_view(np.pad(speed_m_s, n, mode="edge"), 2 * n + 1)
    length = around.max(axis=1) if as_released else around.mean(axis=1) * sinusoids.amplitude
    angle = 2.0 * np.pi * sinusoids.phase
    return np.asarray(length[:, None] * np.stack([np.sin(angle), np.cos(angle)], axis=1))


def phase_of(features: FloatArray) -> FloatArray:
    """Cycles in [0, 1) of phase features ``[..., 2]``."""
    return np.asarray(np.arctan2(features[..., 0], features[..., 1]) / (2.0 * np.pi) % 1.0)


def phase_advance(phase: FloatArray) -> FloatArray:
    """Steps from frame to frame of ``[T]`` the short way round, ``[T - 1]`` cycles in [-1/2, 1/2)."""
    return np.asarray((np.diff(phase) + 0.5) % 1.0 - 0.5)


def global_phase(contacts: BoolArray) -> FloatArray:
    """Phase of a gait from contacts ``[T, 2]`` of the left and the right foot: ``[T]`` cycles in [0, 1).

    0 where the left foot comes down, 1/2 where the right one does, linear between them; beyond the first and the last
    step at the pace of the nearest one (Holden et al. 2017, section 4.2). Steps that do not alternate count as soon
    as the other foot has come down. Without two steps the phase stands at 0.
    """
    landings = sorted(
        (int(frame) + 1, side) for side in (0, 1) for frame in np.flatnonzero(contacts[1:, side] & ~contacts[:-1, side])
    )
    steps: list[tuple[int, int]] = []
    for frame, side in landings:
        if not steps or (steps[-1][1] != side and frame > steps[-1][0]):
            steps.append((frame, side))
    if len(steps) < 2:
        return np.zeros(len(contacts))
    frames = np.array([frame for frame, _ in steps], dtype=np.float64)
    cycles = 0.5 * (steps[0][1] + np.arange(len(steps)))
    at = np.arange(len(contacts), dtype=np.float64)
    phase = np.interp(at, frames, cycles)
    before, after = at < frames[0], at > frames[-1]
    phase[before] = cycles[0] + 0.5 * (at[before] - frames[0]) / (frames[1] - frames[0])
    phase[after] = cycles[-1] + 0.5 * (at[after] - frames[-1]) / (frames[-1] - frames[-2])
    return np.asarray(phase % 1.0)


def circular_mean(phases: Sequence[float] | FloatArray) -> float:
    """Mean of phases, cycles in [0, 1)."""
    mean = np.exp(2j * np.pi * np.asarray(phases)).mean()
    return float(np.angle(mean) / (2.0 * np.pi) % 1.0)


def _half(fps: float) -> int:
    return max(2, round(0.5 * WINDOW_S * fps))


def _fit(around: FloatArray, times_s: FloatArray, frequency_hz: float) -> tuple[FloatArray, FloatArray]:
    """Of windows ``[n, W]``: factors ``[n, 3]`` of sine, cosine and 1, and mean squared residuals ``[n]``.

    Residuals of sines that are too large are infinite.
    """
    angle = 2.0 * np.pi * frequency_hz * times_s
    design = np.stack([np.sin(angle), np.cos(angle), np.ones_like(angle)], axis=1)
    factors = around @ np.linalg.pinv(design).T
    error = ((factors @ design.T - around) ** 2).mean(axis=1)
    amplitude, span = np.hypot(factors[:, 0], factors[:, 1]), np.ptp(around, axis=1)
    return factors, np.where(amplitude > span + STILL_M, np.inf, error)
