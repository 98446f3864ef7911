"""Timings with numbers that can be worked out by hand."""

from __future__ import annotations

import numpy as np

from bench.suite.timing.plan import ONLINE, TimingPlan, offline
from bench.suite.timing.results import TimingFacts, Timings

FACTS = TimingFacts(
    fps=30.0,
    frames_per_call=TimingPlan().slices,
    transfers=True,
    streams=False,
    outside_program=False,
    past_frames=32,
    load_s=1.5,
    harness_load_s=1.0,
    first_call_s=0.25,
    first_call_slice="offline L=60",
    warm_up_calls=10,
    threads={"limit": 1, "blas": 1},
    waiting_known=True,
    companions=2,
    start_memory_mb=150.0,
    peak_memory_mb=200.0,
    parameters=1000,
    bytes_per_style=64,
    designed_input_frames=60,
    look_ahead_frames=4,
    look_ahead_window=64,
    look_ahead_to_the_end=False,
    look_ahead_reason="",
)


def timings(facts: TimingFacts = FACTS) -> Timings:
    """101 calls a slice: 1 ms to 101 ms on 60 frames, twice and three times that on 90 and 120, 10 to 20 ms online."""
    ramp = np.arange(1, 102) / 1000.0
    durations = {
        offline(60): ramp,
        offline(90): 2 * ramp,
        offline(120): 3 * ramp,
        ONLINE: np.linspace(0.010, 0.020, 101),
    }
    if not facts.transfers:
        durations = {ONLINE: durations[ONLINE]}
    opening = np.array([0.003, 0.001, 0.002]) if facts.streams else np.zeros(0)
    waited = {name: np.zeros(101) for name in durations}
    return Timings(durations, waited, {name: np.full(101, 2e-6) for name in durations}, opening, facts)
