"""``stylebench-runtime@1``: what a call costs.

Style-ERD 2022, Table 2; Mason 2022, Table 2; Kuriyama 2022, section 3.
"""

from __future__ import annotations

from bench.protocols.base import Protocol
from bench.protocols.transfer import make_tasks

RUNTIME = Protocol(
    name="stylebench-runtime",
    version=1,
    track="runtime",
    judged=False,
    summary="duration of calls: loading, first call, whole windows, and frame by frame",
    needs="transfers",
    fps=30.0,
    n_samples={"smoke": 4, "quick": 16, "standard": 16},
    metrics=(
        "latency_p50",
        "latency_p90",
        "latency_p99",
        "latency_max",
        "frames_per_second",
        "real_time_factor",
        "deadline_miss",
        "load_time",
        "first_call",
        "startup_designed",
        "startup_measured",
        "parameters",
        "bytes_per_style",
        "peak_memory",
    ),
    primary=("latency_p50", "online"),
    make_tasks=make_tasks,
    facts={
        "timed": "the adapter's call, end to end; inputs are made before the clock starts, outputs checked after",
        "offline": "windows of 60, 90 and 120 frames",
        "online": "streaming methods step frame by frame; others answer the current frame with the 32 frames before it",
        "threads": "one, pinned",
    },
)
