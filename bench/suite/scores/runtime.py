"""The runtime track: timings to measurements.

Slices: ``offline L=60`` and so on are calls on whole clips; ``online`` is one frame at a time, by the adapter's stream
where it has one (``streaming`` is 1 in the details), else by a call on the frame and those before it, of whose answer
the last frame is kept. Durations are wall-clock time less what the call spent waiting for a core that other processes
had (``waited_percent``); ``wall_p50_ms`` is the median with it. The harness's own part of a call is measured beside it
and not subtracted.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bench.arrays import FloatArray
from bench.metrics.runtime import (
    DEADLINE_FPS,
    deadline_miss_percent,
    duration_statistics,
    frames_per_second,
    real_time_factor,
    startup_latency,
)
from bench.suite.scores.base import measure
from bench.suite.timing.plan import ONLINE
from bench.suite.timing.results import TimingFacts, Timings
from reports.records import Measurement

PER_CALL = ("latency_p50", "latency_p90", "latency_p99", "latency_max", "frames_per_second", "real_time_factor")
ALL = "all"
BUSY_PERCENT = 5.0
"""Share of the timed seconds without a core above which a row says that the host was busy."""
NO_TRANSFER = "the adapter streams only: it has no call on whole clips"
OUTSIDE = "an outside program: handing motions over and back is part of a call"
NOT_DESCRIBED = "the adapter does not describe itself"
NO_DESIGN = "the adapter declares no input length it was designed for"


def runtime_measurements(timings: Timings, deadline_fps: Sequence[float] = DEADLINE_FPS) -> tuple[Measurement, ...]:
    """All measurements of the runtime track.

    Parameters
    ----------
    timings : of one adapter.
    deadline_fps : frame rates at which missed deadlines are counted.
    """
    found: list[Measurement] = []
    for slice_name in timings.facts.frames_per_call:
        if slice_name in timings.durations_s:
            found += _call_measurements(timings, slice_name)
        else:
            found += [measure(name, slice_name, np.nan, 0, reason=NO_TRANSFER) for name in PER_CALL]
    durations_s = timings.own_s(ONLINE)
    found += [
        measure(
            "deadline_miss",
            f"{ONLINE} {fps:g} fps",
            deadline_miss_percent(durations_s, fps),
            len(durations_s),
            details={"deadline_ms": 1e3 / fps, **_online_details(timings.facts)},
            reason=_online_reason(timings.facts),
        )
        for fps in deadline_fps
    ]
    return (*found, *_single_measurements(timings.facts))


def _call_measurements(timings: Timings, slice_name: str) -> list[Measurement]:
    facts, durations_s, wall_s = timings.facts, timings.own_s(slice_name), timings.durations_s[slice_name]
    waited_percent = 100.0 * float(1.0 - durations_s.sum() / wall_s.sum())
    frames, n = facts.frames_per_call[slice_name], len(durations_s)
    statistics = duration_statistics(durations_s)
    reasons = [_online_reason(facts)] if slice_name == ONLINE else []
    if facts.outside_program:
        reasons.append(OUTSIDE)
    if waited_percent > BUSY_PERCENT:
        reasons.append(f"a busy host: over {BUSY_PERCENT:g} % of the timed seconds went to other processes")
    reason = "; ".join(filter(None, reasons))
    details = {
        "harness_overhead_us": 1e6 * float(np.median(timings.overhead_s[slice_name])),
        "wall_p50_ms": 1e3 * float(np.median(wall_s)),
        **({"waited_percent": waited_percent} if facts.waiting_known else {}),
        "p95_ms": 1e3 * statistics.p95_s,
        "iqr_ms": 1e3 * statistics.iqr_s,
        "end_to_end": 1.0,
        "threads": float(facts.threads["limit"]),
        "companions": float(facts.companions),
        **(_online_details(facts, timings.opening_s) if slice_name == ONLINE else {}),
    }
    return [
        measure("latency_p50", slice_name, 1e3 * statistics.p50_s, n, details=details, reason=reason),
        measure("latency_p90", slice_name, 1e3 * statistics.p90_s, n, reason=_tail_reason(n, 10)),
        measure("latency_p99", slice_name, 1e3 * statistics.p99_s, n, reason=_tail_reason(n, 100)),
        measure("latency_max", slice_name, 1e3 * statistics.max_s, n),
        measure("frames_per_second", slice_name, frames_per_second(durations_s, frames), n),
        measure("real_time_factor", slice_name, real_time_factor(durations_s, frames, facts.fps), n),
    ]


def _single_measurements(facts: TimingFacts) -> list[Measurement]:
    load = {"harness_s": facts.harness_load_s}
    memory = {"before_load_mb": facts.start_memory_mb}
    described = [
        measure(name, ALL, np.nan if value is None else value, 1, reason=NOT_DESCRIBED if value is None else "")
        for name, value in (("parameters", facts.parameters), ("bytes_per_style", facts.bytes_per_style))
    ]
    return [
        measure("load_time", ALL, facts.load_s, 1, details=load),
        measure("first_call", ALL, 1e3 * facts.first_call_s, 1, reason=f"on {facts.first_call_slice}"),
        *_startup(facts),
        *described,
        measure("peak_memory", ALL, facts.peak_memory_mb, 1, details=memory),
    ]


def _startup(facts: TimingFacts) -> list[Measurement]:
    # A stream answers frame by frame: that is the input length it was made for, unless it says otherwise.
    designed = facts.designed_input_frames or (1 if facts.streams else None)
    ahead = facts.look_ahead_frames
    startup = startup_latency(designed or 1, ahead or 0, facts.fps)
    reason = facts.look_ahead_reason
    if facts.look_ahead_to_the_end:
        reason = f"the answer depends on the last of {facts.look_ahead_window} frames: longer input could show more"
    return [
        measure(
            "startup_designed",
            ALL,
            startup.designed_s if designed else np.nan,
            1,
            details={"frames": float(designed)} if designed else {},
            reason="" if designed else NO_DESIGN,
        ),
        measure(
            "startup_measured",
            ALL,
            np.nan if ahead is None else startup.measured_s,
            1,
            details={} if ahead is None else {"look_ahead_frames": float(ahead), "streaming": float(facts.streams)},
            reason=reason,
        ),
    ]


def _online_details(facts: TimingFacts, opening_s: FloatArray | None = None) -> dict[str, float]:
    details = {"streaming": float(facts.streams), "past_frames": float(facts.past_frames)}
    if opening_s is not None and len(opening_s):
        details["open_stream_ms"] = 1e3 * float(np.median(opening_s))
    return details


def _online_reason(facts: TimingFacts) -> str:
    if facts.streams:
        return ""
    return f"no stream: each frame is a call on it and the {facts.past_frames} before it, the last frame kept"


def _tail_reason(n: int, one_in: int) -> str:
    return f"of {n} calls only: too few to see one in {one_in}" if n < one_in else ""
