"""Statistics of measured durations (Style-ERD, Table 2; Mason 2022, Table 2; Kuriyama 2022, section 3).

Nothing is timed here: durations come in as arrays of seconds, one for each call, warm-up calls already taken out.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import FloatArray, finite_array
from bench.errors import BadInput

DEADLINE_FPS = (30, 60, 120)
"""Frame rates at which misses are reported."""


@dataclass(frozen=True)
class DurationStatistics:
    """Quantiles of call durations, seconds. Between measured values they are interpolated linearly."""

    n: int
    p50_s: float
    p90_s: float
    p95_s: float
    p99_s: float
    max_s: float
    iqr_s: float


@dataclass(frozen=True)
class StartupLatency:
    """Seconds of input that must have arrived before the first pose can come out."""

    designed_s: float
    """the input length for which the method was designed"""
    measured_s: float
    """the pose itself and the look-ahead that was measured"""


def duration_statistics(durations_s: ArrayLike) -> DurationStatistics:
    """Quantiles of ``[n]`` call durations.

    Raises
    ------
    BadInput : not one-dimensional, fewer than 2 calls, not finite, not positive.
    """
    durations = _durations(durations_s)
    p25, p50, p75, p90, p95, p99 = (float(q) for q in np.percentile(durations, (25, 50, 75, 90, 95, 99)))
    return DurationStatistics(len(durations), p50, p90, p95, p99, float(durations.max()), p75 - p25)


def frames_per_second(durations_s: ArrayLike, frames_per_call: int) -> float:
    """Frames produced per second of computing, at the median call.

    Raises
    ------
    BadInput : as ``duration_statistics``; ``frames_per_call`` under 1.
    """
    durations = _durations(durations_s)
    return _at_least_one(frames_per_call, "frames_per_call") / float(np.median(durations))


def real_time_factor(durations_s: ArrayLike, frames_per_call: int, fps: float) -> float:
    """Seconds of motion produced per second of computing, at the median call; over 1 is faster than real time.

    Parameters
    ----------
    durations_s : ``[n]`` call durations.
    frames_per_call : frames that each call produces.
    fps : frame rate of the motion.

    Raises
    ------
    BadInput : as ``duration_statistics``; ``frames_per_call`` under 1; fps not positive.
    """
    return frames_per_second(durations_s, frames_per_call) / _positive(fps)


def deadline_miss_percent(durations_s: ArrayLike, fps: float, frames_per_call: int = 1) -> float:
    """Share of calls that last longer than the motion they produce, in percent.

    Parameters
    ----------
    durations_s : ``[n]`` call durations.
    fps : frame rate that must be kept.
    frames_per_call : frames that each call produces; the deadline is their length. 1 for online use.

    Raises
    ------
    BadInput : as ``duration_statistics``; ``frames_per_call`` under 1; fps not positive.
    """
    deadline_s = _at_least_one(frames_per_call, "frames_per_call") / _positive(fps)
    return 100.0 * float((_durations(durations_s) > deadline_s).mean())


def startup_latency(designed_input_frames: int, look_ahead_frames: int, fps: float) -> StartupLatency:
    """Startup latency, once as designed (the last column of Style-ERD's Table 2) and once as measured.

    Parameters
    ----------
    designed_input_frames : input length at training; 1 for a frame-by-frame method.
    look_ahead_frames : later input frames that an output frame was found to depend on; 0 for a causal method.
    fps : frame rate of the motion.

    Raises
    ------
    BadInput : ``designed_input_frames`` under 1, ``look_ahead_frames`` under 0, fps not positive.
    """
    designed = _at_least_one(designed_input_frames, "designed_input_frames")
    if look_ahead_frames < 0:
        raise BadInput(f"look_ahead_frames must be at least 0, got {look_ahead_frames}", where="look_ahead_frames")
    rate = _positive(fps)
    return StartupLatency(designed_s=designed / rate, measured_s=(1 + look_ahead_frames) / rate)


def _durations(durations_s: ArrayLike) -> FloatArray:
    durations = finite_array(durations_s, "durations_s", (None,))
    if len(durations) < 2:
        raise BadInput("durations_s needs at least 2 calls for quantiles, got 1", where="durations_s")
    if durations.min() <= 0.0:
        raise BadInput(
            f"durations_s must be positive, got {durations.min():g} s",
            where="durations_s",
            cause="a clock too coarse for the call, or one that can be set back",
            remedy="time with a monotonic clock of high resolution",
        )
    return durations


def _at_least_one(frames: int, name: str) -> int:
    if frames < 1:
        raise BadInput(f"{name} must be at least 1, got {frames}", where=name)
    return frames


def _positive(fps: float) -> float:
    if not (np.isfinite(fps) and fps > 0.0):
        raise BadInput(f"fps must be positive, got {fps}", where="fps")
    return fps
