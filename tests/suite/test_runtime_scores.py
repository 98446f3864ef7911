from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.metrics import METRICS
from bench.metrics.catalogue import RUNTIME_METRICS
from bench.suite.scores.runtime import NO_DESIGN, NO_TRANSFER, NOT_DESCRIBED, OUTSIDE, runtime_measurements
from bench.suite.timing.plan import ONLINE
from bench.suite.timing.results import Timings
from reports.records import Measurement
from tests.suite.timings_factory import FACTS, timings


def by_name(kept: Timings) -> dict[tuple[str, str], Measurement]:
    found = runtime_measurements(kept)
    assert len({(m.name, m.slice) for m in found}) == len(found)
    return {(m.name, m.slice): m for m in found}


def test_every_runtime_metric_is_measured_in_its_unit() -> None:
    found = runtime_measurements(timings())
    assert {m.name for m in found} == {metric.name for metric in RUNTIME_METRICS}
    for measurement in found:
        metric = METRICS[measurement.name]
        assert (measurement.unit, measurement.version, measurement.better) == (
            metric.unit,
            metric.version,
            metric.better,
        )


@pytest.mark.parametrize(
    ("name", "slice_name", "value", "n"),
    [
        ("latency_p50", "offline L=60", 51.0, 101),
        ("latency_p50", "offline L=90", 102.0, 101),
        ("latency_p50", "offline L=120", 153.0, 101),
        ("latency_p90", "offline L=60", 91.0, 101),
        ("latency_p99", "offline L=60", 100.0, 101),
        ("latency_max", "offline L=60", 101.0, 101),
        ("frames_per_second", "offline L=120", 120 / 0.153, 101),
        ("real_time_factor", "offline L=120", 4.0 / 0.153, 101),
        ("latency_p50", "online", 15.0, 101),
        ("frames_per_second", "online", 1 / 0.015, 101),
        ("real_time_factor", "online", 1 / 0.015 / 30.0, 101),
        ("deadline_miss", "online 30 fps", 0.0, 101),
        ("deadline_miss", "online 60 fps", 100 * 34 / 101, 101),
        ("deadline_miss", "online 120 fps", 100.0, 101),
        ("load_time", "all", 1.5, 1),
        ("first_call", "all", 250.0, 1),
        ("startup_designed", "all", 2.0, 1),
        ("startup_measured", "all", 5 / 30, 1),
        ("parameters", "all", 1000.0, 1),
        ("bytes_per_style", "all", 64.0, 1),
        ("peak_memory", "all", 200.0, 1),
    ],
)
def test_values_worked_out_by_hand(name: str, slice_name: str, value: float, n: int) -> None:
    found = by_name(timings())[name, slice_name]
    assert found.value == pytest.approx(value)
    assert found.n == n


def test_latency_carries_how_it_was_measured() -> None:
    details = by_name(timings())["latency_p50", "offline L=60"].details
    assert details == pytest.approx(
        {
            "harness_overhead_us": 2.0,
            "wall_p50_ms": 51.0,
            "waited_percent": 0.0,
            "p95_ms": 96.0,
            "iqr_ms": 50.0,
            "end_to_end": 1.0,
            "threads": 1.0,
            "companions": 2.0,
        }
    )


def test_waiting_that_nobody_counts_is_not_told() -> None:
    found = by_name(timings(replace(FACTS, waiting_known=False)))
    assert "waited_percent" not in found["latency_p50", "offline L=60"].details


def test_waiting_for_a_core_is_taken_out_and_told() -> None:
    kept = timings()
    wall = {name: values + 0.004 for name, values in kept.durations_s.items()}
    waited = {name: np.full(len(values), 0.004) for name, values in wall.items()}
    found = by_name(Timings(wall, waited, kept.overhead_s, kept.opening_s, kept.facts))
    online = found["latency_p50", ONLINE]
    assert online.value == pytest.approx(15.0) and online.details["wall_p50_ms"] == pytest.approx(19.0)
    assert online.details["waited_percent"] == pytest.approx(100 * 4 / 19)
    assert str(online.reason).endswith("kept; a busy host: over 5 % of the timed seconds went to other processes")
    assert found["deadline_miss", "online 60 fps"].value == pytest.approx(100 * 34 / 101)
    assert (
        found["latency_p50", "offline L=60"].reason
        == "a busy host: over 5 % of the timed seconds went to other processes"
    )
    assert found["latency_p50", "offline L=120"].reason is None


def test_online_says_whether_it_streams() -> None:
    padded = by_name(timings())["latency_p50", ONLINE]
    assert padded.details["streaming"] == 0.0 and padded.details["past_frames"] == 32.0
    assert padded.reason == "no stream: each frame is a call on it and the 32 before it, the last frame kept"
    assert by_name(timings())["deadline_miss", "online 60 fps"].reason == padded.reason
    streamed = by_name(timings(replace(FACTS, streams=True)))["latency_p50", ONLINE]
    assert streamed.details["streaming"] == 1.0 and streamed.details["open_stream_ms"] == pytest.approx(2.0)
    assert streamed.reason is None


def test_an_outside_program_says_what_its_calls_contain() -> None:
    found = by_name(timings(replace(FACTS, outside_program=True)))
    assert found["latency_p50", "offline L=60"].reason == OUTSIDE
    assert str(found["latency_p50", ONLINE].reason).endswith(OUTSIDE)


def test_a_method_that_only_streams_has_no_offline_numbers() -> None:
    found = by_name(timings(replace(FACTS, streams=True, transfers=False, first_call_slice=ONLINE)))
    for length in (60, 90, 120):
        missing = found["latency_p50", f"offline L={length}"]
        assert (missing.value, missing.n, missing.reason) == (None, 0, NO_TRANSFER)
    assert found["latency_p50", ONLINE].value == pytest.approx(15.0)


def test_what_is_not_known_is_undefined_with_a_reason() -> None:
    silent = replace(
        FACTS, parameters=None, bytes_per_style=None, designed_input_frames=None, look_ahead_frames=None,
        look_ahead_reason="two equal calls gave different outputs",
    )  # fmt: skip
    found = by_name(timings(silent))
    reasons = {
        "parameters": NOT_DESCRIBED,
        "bytes_per_style": NOT_DESCRIBED,
        "startup_designed": NO_DESIGN,
        "startup_measured": "two equal calls gave different outputs",
    }
    for name, reason in reasons.items():
        assert (found[name, "all"].value, found[name, "all"].reason) == (None, reason)


def test_no_parameters_is_a_number() -> None:
    assert by_name(timings(replace(FACTS, parameters=0)))["parameters", "all"].value == 0.0


def test_a_stream_is_designed_for_one_frame_unless_it_says_otherwise() -> None:
    stream = replace(FACTS, streams=True, designed_input_frames=None, look_ahead_frames=0)
    found = by_name(timings(stream))
    assert found["startup_designed", "all"].value == pytest.approx(1 / 30)
    assert found["startup_measured", "all"].value == pytest.approx(1 / 30)
    told = by_name(timings(replace(stream, designed_input_frames=24)))
    assert told["startup_designed", "all"].value == pytest.approx(0.8)


def test_look_ahead_to_the_end_of_the_window_is_marked() -> None:
    found = by_name(timings(replace(FACTS, look_ahead_frames=63, look_ahead_to_the_end=True)))[
        "startup_measured", "all"
    ]
    assert found.value == pytest.approx(64 / 30)
    assert found.reason == "the answer depends on the last of 64 frames: longer input could show more"


def test_tails_of_few_calls_carry_a_warning() -> None:
    kept = timings()
    calls = {name: np.full(8, 0.01) for name in kept.durations_s}
    waited = {name: np.zeros(8) for name in calls}
    few = Timings(calls, waited, kept.overhead_s, kept.opening_s, kept.facts)
    found = by_name(few)
    assert found["latency_p99", ONLINE].reason == "of 8 calls only: too few to see one in 100"
    assert found["latency_p90", ONLINE].reason == "of 8 calls only: too few to see one in 10"
    assert by_name(kept)["latency_p99", ONLINE].reason is None
