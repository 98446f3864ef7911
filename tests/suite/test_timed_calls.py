from __future__ import annotations

import gc
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bench.adapters.anchors import Noise, NoiseLow, PoseAdain
from bench.adapters.base import Adapter, Description, Stream, Traits
from bench.adapters.loading import AdapterSource
from bench.adapters.oracles import RealTest
from bench.adapters.session import OutOfTime
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadConfig, BadOutput
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.suite.timing.calls import repeated
from bench.suite.timing.plan import ONLINE, TimingJob, TimingPlan, offline
from bench.suite.timing.stopwatch import HostStopwatch, timed
from bench.suite.timing.worker import TimingWorker, Unsupported, failure, loaded_adapter, memory_mb
from tests.motion.factory import random_clip
from tests.suite.timing_factory import SMALL, Ticker, calls_of, job_of, world


class Slow(Adapter):
    """Copies the content in 3 ms plus 1 ms for every call before, on its own clock."""

    name = "slow"
    traits = Traits(designed_input_frames=64)

    def __init__(self, clock: Ticker) -> None:
        self.clock = clock
        self.seen: list[tuple[Take, Take, float]] = []

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        self.clock.ns += 3_000_000 + 1_000_000 * len(self.seen)
        self.seen.append((content, style, rng.random()))
        return content.clip

    def describe(self) -> Description:
        return Description(parameters=10, bytes_per_style=80)


class Echo:
    """Answers each frame with itself in 2 ms."""

    def __init__(self, clock: Ticker) -> None:
        self.clock = clock
        self.roots: list[FloatArray] = []

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.clock.ns += 2_000_000
        self.roots.append(root_xyz_m)
        return rotations_wxyz, root_xyz_m


class Streaming(Adapter):
    """Streams only; opening takes 9 ms."""

    name = "streaming"
    traits = Traits(needs_content_label=True)

    def __init__(self, clock: Ticker) -> None:
        self.clock = clock
        self.opened: list[tuple[Echo, str | None]] = []

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        self.clock.ns += 9_000_000
        self.opened.append((Echo(self.clock), content_label))
        return self.opened[-1][0]


@pytest.fixture
def clock() -> Ticker:
    return Ticker()


@pytest.fixture
def thawed() -> Iterator[None]:
    """Warm-up freezes what is alive, for good in a worker; not here."""
    yield
    gc.unfreeze()


def worker_of(folder: Path, adapter: Adapter, clock: Ticker, plan: TimingPlan = SMALL) -> TimingWorker:
    world(folder)
    worker = TimingWorker(job_of(folder, AdapterSource("mine")), plan, 1, adapter, clock)
    worker.answer({"do": "prepare"})
    return worker


def test_every_call_is_timed_by_itself_and_without_garbage_collection(clock: Ticker) -> None:
    enabled = []

    def call(milliseconds: int) -> int:
        enabled.append(gc.isenabled())
        clock.ns += milliseconds * 1_000_000
        return milliseconds

    calls = timed(call, [(1,), (5,), (2,)], clock)
    assert calls.durations_ns == [1_000_000, 5_000_000, 2_000_000] and calls.outputs == [1, 5, 2]
    assert enabled == [False] * 3 and gc.isenabled()


def test_garbage_collection_is_back_after_a_failing_call(clock: Ticker) -> None:
    with pytest.raises(ZeroDivisionError):
        timed(lambda: 1 // 0, [()], clock)
    assert gc.isenabled()


def test_waiting_for_a_core_is_kept_beside_the_duration(clock: Ticker) -> None:
    def call(milliseconds: int, waited: int) -> None:
        clock.ns += milliseconds * 1_000_000
        clock.waited += waited * 1_000_000

    calls = timed(call, [(5, 2), (5, 0), (5, -1), (5, 7)], clock)
    assert calls.durations_ns == [5_000_000] * 4
    # More waiting than the call lasted fell outside of it; less than none is what helper threads of its own computed.
    assert calls.waited_ns == [2_000_000, 0, 0, 0]


def test_the_clocks_of_this_machine_go_forward() -> None:
    stopwatch = HostStopwatch()
    start = stopwatch.now_ns()
    assert 0 < stopwatch.now_ns() - start < 10**9
    assert isinstance(stopwatch.waited_ns(), int)


def test_a_system_that_does_not_count_waiting_has_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.suite.timing.stopwatch.SCHEDULER_STATISTICS", "/nowhere")
    stopwatch = HostStopwatch()
    assert (stopwatch.knows_waiting, stopwatch.waited_ns()) == (False, 0)


def test_offline_calls_have_the_length_and_differ(tmp_path: Path, clock: Ticker) -> None:
    adapter = Slow(clock)
    calls = calls_of(tmp_path, adapter, clock)
    assert calls.slices == ("offline L=20", "offline L=30", "online")
    block = calls.block(offline(30), 1, 4)
    block.check(timed(block.call, block.arguments, clock).outputs)
    clips = [content.clip for content, _, _ in adapter.seen]
    assert [clip.n_frames for clip in clips] == [30] * 4
    assert len({clip.rotations_wxyz.tobytes() for clip in clips}) == 4
    assert len({random for _, _, random in adapter.seen}) == 1


def test_inputs_are_the_same_for_every_adapter(tmp_path: Path, clock: Ticker) -> None:
    ours, theirs = (calls_of(tmp_path, adapter, clock) for adapter in (PoseAdain(), NoiseLow()))
    for slice_name in ours.slices:
        for one, other in zip(
            ours.block(slice_name, 2, 3).arguments, theirs.block(slice_name, 2, 3).arguments, strict=True
        ):
            np.testing.assert_array_equal(one[0][0][0].clip.rotations_wxyz, other[0][0][0].clip.rotations_wxyz)


def test_labels_are_hidden_unless_declared(tmp_path: Path, clock: Ticker) -> None:
    class Needy(Slow):
        traits = Traits(needs_content_label=True, needs_source_style_label=True, needs_style_label=True)

    for kind, labels in ((Slow, (None, None, None)), (Needy, ("run", "angry", "old"))):
        adapter = kind(clock)
        block = calls_of(tmp_path, adapter, clock).block(ONLINE, 0, 1)
        timed(block.call, block.arguments, clock)
        ((content, style, _),) = adapter.seen
        assert (content.content, content.style, style.style) == labels
        assert (content.take_id, content.dataset, style.take_id, style.content) == ("", "", "", None)


def test_online_without_a_stream_gives_each_frame_with_those_before_it(tmp_path: Path, clock: Ticker) -> None:
    adapter = Slow(clock)
    calls = calls_of(tmp_path, adapter, clock)
    block = calls.block(ONLINE, 0, 3)
    timed(block.call, block.arguments, clock)
    source = calls.inputs[0].content.clip
    for number, (content, _, _) in enumerate(adapter.seen):
        np.testing.assert_array_equal(content.clip.root_xyz_m, source.root_xyz_m[number : number + 9])


def test_a_stream_has_seen_the_past_frames_and_goes_on(tmp_path: Path, clock: Ticker) -> None:
    adapter = Streaming(clock)
    calls = calls_of(tmp_path, adapter, clock)
    assert calls.slices == (ONLINE,)
    block = calls.block(ONLINE, 1, 3)
    made = timed(block.call, block.arguments, clock)
    block.check(made.outputs)
    ((stream, label),) = adapter.opened
    assert (made.durations_ns, block.opening_ns, label) == ([2_000_000] * 3, 9_000_000, "run")
    first = SMALL.calls
    source = calls.inputs[1].content.clip
    np.testing.assert_array_equal(np.stack(stream.roots), source.root_xyz_m[first : first + 11])


def test_the_first_step_of_a_stream_comes_without_a_past(tmp_path: Path, clock: Ticker) -> None:
    adapter = Streaming(clock)
    worker = worker_of(tmp_path, adapter, clock)
    assert worker.answer({"do": "first"}) == {"slice": ONLINE, "ns": 11_000_000}
    assert len(adapter.opened[0][0].roots) == 1


def test_a_method_of_one_length_gets_windows_of_that_length(tmp_path: Path, clock: Ticker) -> None:
    class OneLength(Slow):
        traits = Traits(designed_input_frames=16, only_designed_input=True)

    adapter = OneLength(clock)
    calls = calls_of(tmp_path, adapter, clock)
    block = calls.block(offline(30), 0, 1)
    made = timed(block.call, block.arguments, clock)
    block.check(made.outputs)
    assert [content.clip.n_frames for content, _, _ in adapter.seen] == [16, 16]
    assert made.durations_ns == [3_000_000 + 4_000_000]
    last = adapter.seen[1][0].clip
    np.testing.assert_array_equal(last.rotations_wxyz[13], last.rotations_wxyz[15])


def test_a_short_take_is_joined_to_itself() -> None:
    clip = random_clip(25)
    long = repeated(clip, 61)
    assert long.n_frames == 61
    np.testing.assert_allclose(crop(long, 0, 25).rotations_wxyz, clip.rotations_wxyz)
    steps = np.linalg.norm(np.diff(long.root_xyz_m[:, [0, 2]], axis=0), axis=1)
    assert steps.max() < 0.06


@pytest.mark.parametrize(
    ("outputs", "reason"),
    [
        ([(np.zeros((20, 4)), np.zeros(3))], "expected rotations"),
        ([None], "expected rotations"),
    ],
)
def test_a_stream_that_answers_something_else_is_refused(
    tmp_path: Path, clock: Ticker, outputs: list[object], reason: str
) -> None:
    block = calls_of(tmp_path, Streaming(clock), clock).block(ONLINE, 0, 1)
    with pytest.raises(BadOutput, match=reason):
        block.check(outputs)


def test_a_wrong_answer_is_refused_after_the_clock_has_stopped(tmp_path: Path, clock: Ticker) -> None:
    class Short(Slow):
        def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
            return crop(content.clip, 0, 5)

    worker = worker_of(tmp_path, Short(clock), clock)
    with pytest.raises(BadOutput, match="expected 20 frames, got 5"):
        worker.answer({"do": "block", "slice": offline(20), "round": 0, "calls": 2})


def test_the_first_call_of_a_block_is_not_kept(tmp_path: Path, clock: Ticker) -> None:
    worker = worker_of(tmp_path, Slow(clock), clock)
    block = {"do": "block", "slice": offline(20), "round": 0}
    assert worker.answer({**block, "calls": 2}) == {
        "ns": [4_000_000, 5_000_000],
        "waited_ns": [0, 0],
        "overhead_ns": [0, 0],
        "opening_ns": None,
    }
    assert worker.answer({**block, "calls": 1})["ns"] == [6_000_000]


@pytest.mark.usefixtures("thawed")
def test_warm_up_ends_with_the_calls_or_the_time(tmp_path: Path, clock: Ticker) -> None:
    worker = worker_of(tmp_path, Slow(clock), clock)
    assert worker.answer({"do": "warm_up", "slice": ONLINE}) == {"calls": 3, "ns": 4_500_000}
    short = TimingPlan(lengths=(20,), bound_s=0.001, past_frames=8)
    assert worker_of(tmp_path, Slow(clock), clock, short).answer({"do": "warm_up", "slice": ONLINE})["calls"] == 1


def test_facts_are_what_the_adapter_says(tmp_path: Path, clock: Ticker) -> None:
    facts = worker_of(tmp_path, Slow(clock), clock).answer({"do": "facts"})
    assert (facts["parameters"], facts["bytes_per_style"], facts["designed_input_frames"]) == (10, 80, 64)
    assert facts["threads"]["limit"] == 1 and facts["peak_memory_mb"] > 10
    silent = worker_of(tmp_path, Streaming(clock), clock).answer({"do": "facts"})
    assert (silent["parameters"], silent["bytes_per_style"], silent["designed_input_frames"]) == (None, None, None)


def test_look_ahead_is_measured_without_a_stream_only(tmp_path: Path, clock: Ticker) -> None:
    found = worker_of(tmp_path, Slow(clock), clock).answer({"do": "look_ahead"})
    assert found == {"frames": 0, "window": 64, "to_the_end": False, "reason": ""}
    streaming = worker_of(tmp_path, Streaming(clock), clock)
    assert streaming.answer({"do": "look_ahead"})["frames"] == 0


def test_requests_out_of_order_or_unknown_are_refused(tmp_path: Path, clock: Ticker) -> None:
    world(tmp_path)
    worker = TimingWorker(job_of(tmp_path, AdapterSource("mine")), SMALL, 1, Slow(clock), clock)
    with pytest.raises(BadConfig, match="before 'prepare'"):
        worker.answer({"do": "look_ahead"})
    with pytest.raises(BadConfig, match="unknown request 'dance'"):
        worker.answer({"do": "dance"})


def test_rows_that_look_up_answers_and_rows_without_calls_are_unsupported(tmp_path: Path) -> None:
    def job(source: AdapterSource) -> TimingJob:
        return job_of(tmp_path, source)

    with pytest.raises(Unsupported, match="nothing to time"):
        loaded_adapter(job(AdapterSource(RealTest.name)))
    (tmp_path / "none.py").write_text(
        "from bench.adapters.base import Adapter\nclass None_(Adapter):\n    name = 'x'\n"
    )
    with pytest.raises(Unsupported, match="transfers or streams"):
        loaded_adapter(job(AdapterSource("x", str(tmp_path / "none.py"))))


@pytest.mark.parametrize(
    ("error", "status", "reason"),
    [
        (BadOutput("two\nlines"), "invalid", "two lines"),
        (ValueError("clip 317"), "failed", "ValueError: clip 317"),
        (MemoryError(), "oom", "MemoryError:"),
        (OutOfTime("no answer within 5 s"), "timeout", "no answer within 5 s"),
        (Unsupported("no"), "unsupported", "no"),
    ],
)
def test_failures_have_a_status_and_one_line(error: Exception, status: str, reason: str) -> None:
    assert failure(error) == {"failed": status, "reason": reason}


def test_peak_memory_is_at_least_what_is_resident() -> None:
    resident = memory_mb("VmRSS")
    assert memory_mb("VmHWM") >= resident > 10


def test_noise_is_the_same_in_each_call(tmp_path: Path, clock: Ticker) -> None:
    class Constant(Noise):
        level_rad = 0.1

    transfer, clip = calls_of(tmp_path, Constant(), clock).look_ahead_call()
    np.testing.assert_array_equal(transfer(clip).rotations_wxyz, transfer(clip).rotations_wxyz)
