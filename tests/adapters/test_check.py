from __future__ import annotations

import textwrap
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.adapters import ADAPTERS
from bench.adapters.answers import CheckRow, check_answer, checked_answer
from bench.adapters.base import Adapter, Description, ProgressCallback, Stream, Traits
from bench.adapters.check import check_adapter
from bench.adapters.check_run import check_option
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadOutput
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.skeleton import Skeleton
from tests.adapters.outside import COPY, by_hand, left_behind, with_worker
from tests.motion.factory import person, random_clip

TAKES = [
    Take(random_clip(80, seed=n), f"t{n}", "toy", content, style)
    for n, (content, style) in enumerate((c, s) for c in ("run", "walk") for s in ("old", "proud", "sad"))
]


@pytest.fixture(autouse=True)
def few_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.adapters.check.GROWTH_CALLS", 50)


class Good(Adapter):
    name = "good"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return content.clip


def failures(adapter: type[Adapter]) -> dict[str, CheckRow]:
    """The rows that fail, by name; each must say what was expected and what came."""
    rows = [row for row in check_adapter(adapter, TAKES) if row.ok is False]
    assert all(row.expected and row.got for row in rows)
    return {row.name: row for row in rows}


def answering(change: Callable[[Clip], object]) -> type[Adapter]:
    """An adapter that answers with the changed source."""

    class Changed(Good):
        def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
            return change(content.clip)  # type: ignore[return-value]

    return Changed


def test_a_good_adapter_fails_nothing() -> None:
    assert failures(Good) == {}


@pytest.mark.parametrize("name", ["copy-style", "noise-0.1", "mean-pose", "style-mean-shift"])
def test_adapters_that_ship_pass(name: str) -> None:
    assert failures(ADAPTERS[name]) == {}


def jumping(clip: Clip) -> Clip:
    jump = 5.0 * (np.arange(clip.n_frames) > 20)[:, None] * np.array([1.0, 0.0, 0.0])
    return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + jump)


@pytest.mark.parametrize(
    ("change", "name", "got"),
    [
        (lambda clip: (clip.rotations_wxyz, clip.root_xyz_m), "type", "builtins.tuple"),
        (lambda clip: crop(clip, 0, 60), "frames", "60 frames"),
        (lambda clip: replace(clip, fps=60.0), "fps", "60 fps"),
        (lambda clip: replace(clip, skeleton=person(1.1)), "bone lengths", "off by 42.0 mm"),
        (lambda clip: clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m * 100.0), "units", "95"),
        (jumping, "root path", "m/s at frame 20"),
        (lambda clip: clip.with_motion(clip.rotations_wxyz * np.nan, clip.root_xyz_m), "answers transfer()", "finite"),
        (lambda clip: 1 / 0, "answers transfer()", "ZeroDivisionError: division by zero"),
    ],
)
def test_wrong_answers_are_told_by_their_row(change: Callable[[Clip], object], name: str, got: str) -> None:
    assert got in failures(answering(change))[name].got


def test_another_skeleton_is_told_before_its_bones() -> None:
    def other(clip: Clip) -> Clip:
        old = clip.skeleton
        names = ("Pelvis", *old.names[1:])
        return replace(clip, skeleton=Skeleton(names, old.parents, old.offsets_m))

    failed = failures(answering(other))
    assert "skeleton" in failed
    assert "bone lengths" not in failed


def test_centimetres_are_guessed() -> None:
    rows = check_answer(
        random_clip().with_motion(random_clip().rotations_wxyz, random_clip().root_xyz_m * 100.0), random_clip()
    )
    [row] = [row for row in rows if row.name == "units"]
    assert row.cause == "centimetres instead of metres"


def test_checked_answer_raises_the_first_failing_row() -> None:
    clip = random_clip()
    assert checked_answer(clip, clip, "s0001") is clip
    with pytest.raises(BadOutput, match="s0001: frames: expected 40 frames, got 30 frames; likely cause: padding"):
        checked_answer(crop(clip, 0, 30), clip, "s0001")
    with pytest.raises(BadOutput, match=r"s0001: type: expected a bench\.motion\.clip\.Clip, got builtins\.NoneType"):
        checked_answer(None, clip, "s0001")


class Nameless(Good):
    name = ""


class Idle(Adapter):
    name = "idle"


class NeedsArguments(Good):
    def __init__(self, path: str) -> None: ...


@pytest.mark.parametrize(
    ("adapter", "got"), [(Nameless, "no name"), (Idle, "capabilities: none"), (NeedsArguments, "TypeError: ")]
)
def test_adapters_that_do_not_load(adapter: type[Adapter], got: str) -> None:
    assert got in failures(adapter)["loads"].got


class Hidden(Good):
    """Draws from a generator of its own."""

    generator = np.random.default_rng(0)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return content.clip.with_motion(content.clip.rotations_wxyz, content.clip.root_xyz_m + self.generator.random(3))


class Remembers(Good):
    """The same when asked twice, another when asked in another order."""

    def __init__(self) -> None:
        self.last: list[float] = []

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        first = float(content.clip.rotations_wxyz[0, 1, 1])
        if first not in self.last:
            self.last.append(first)
        shift = 0.001 * (self.last.index(first) if len(self.last) < 4 else -self.last.index(first))
        return content.clip.with_motion(content.clip.rotations_wxyz, content.clip.root_xyz_m + shift)


class BatchNormalises(Good):
    def transfer_batch(self, pairs: Sequence[tuple[Take, Take]], *, rngs: Sequence[np.random.Generator]) -> list[Clip]:
        mean = np.mean([content.clip.root_xyz_m.mean(axis=0) for content, _ in pairs], axis=0)
        return [c.clip.with_motion(c.clip.rotations_wxyz, c.clip.root_xyz_m - mean) for c, _ in pairs]


class Leaks(Good):
    kept: list[bytes]

    def __init__(self) -> None:
        self.kept = []

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        self.kept.append(b"x" * (5 << 20))
        return content.clip


class Forgets(Good):
    """Learns, and does not store what it learned."""

    learned = 0.0

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self.learned = 0.5

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return content.clip.with_motion(content.clip.rotations_wxyz, content.clip.root_xyz_m + self.learned)


class Raises(Good):
    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        raise ValueError("no such style")

    def describe(self) -> Description:
        return {"parameters": 1}  # type: ignore[return-value]


@pytest.mark.parametrize(
    ("adapter", "names"),
    [
        (Hidden, {"deterministic under seed"}),
        (Remembers, {"independent of task order"}),
        (BatchNormalises, {"independent of batch"}),
        (Leaks, {"memory growth"}),
        (Forgets, {"save and load"}),
        (Raises, {"answers sample()", "answers describe()"}),
    ],
)
def test_wrong_behaviour_is_told_by_its_row_alone(adapter: type[Adapter], names: set[str]) -> None:
    assert set(failures(adapter)) == names


class _Delayed:
    """A stream whose answers shift the root by ``delay`` metres."""

    def __init__(self, shift: float) -> None:
        self.shift = shift

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        return -rotations_wxyz, root_xyz_m + self.shift


@pytest.mark.parametrize(("shift", "look_ahead", "ok"), [(0.0, 0, True), (0.1, 0, False), (0.1, 5, None)])
def test_streaming_must_equal_offline_where_promised(shift: float, look_ahead: int, ok: bool | None) -> None:
    class Streams(Good):
        traits = Traits(look_ahead_frames=look_ahead)

        def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
            return _Delayed(shift)

    [row] = [row for row in check_adapter(Streams, TAKES) if row.name == "streaming equals offline"]
    assert row.ok is ok


def test_labels_come_only_where_asked_for() -> None:
    class Asks(Good):
        traits = Traits(needs_style_label=True)

        def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
            if (content.content, content.style, style.content) != (None, None, None) or style.style is None:
                raise ValueError("labels are not those that were asked for")
            return content.clip

    assert failures(Asks) == {}


def test_outside_program_is_checked_and_stopped(tmp_path: Path) -> None:
    rows = {row.name: row for row in check_adapter(with_worker(tmp_path, COPY), TAKES)}
    assert [row for row in rows.values() if row.ok is False] == []
    assert rows["honours cancellation"].ok
    assert rows["independent of batch"].ok
    assert left_behind(tmp_path) == []


def test_outside_program_that_does_not_stop_fails_its_row(tmp_path: Path) -> None:
    code = """
    import shutil
    folder = hello["exchange"] + "/"
    while request["call"] == "transfer":
        tasks = request["tasks"]
        if len(tasks) > 4:
            # It reads on, cancel included, and never answers: no clock decides when it is too late.
            while True:
                read()
        for task in tasks:
            shutil.copyfile(folder + task["content"]["file"], folder + task["answer"] + ".npz")
        say({"id": request["id"], "ok": True, "files": [task["answer"] + ".npz" for task in tasks]})
        request = read()
    """
    adapter = by_hand(tmp_path, code, "[timeouts]\nstop_s = 0.1")
    assert set(failures(adapter)) == {"honours cancellation"}


HEAD = """
import os, signal, subprocess, sys, time
from bench.adapters.base import Adapter
class Mine(Adapter):
    name = "mine"
    def transfer(self, content, style, *, rng):
"""


@pytest.mark.parametrize(
    ("body", "name", "got"),
    [
        ("time.sleep(600)", "answers in time", "nothing for 4 s"),
        ("os._exit(7)", "stays alive", "it ended with exit code 7"),
        ("os.kill(os.getpid(), signal.SIGSEGV)", "stays alive", "killed by signal 11"),
        ("print('noise'); return None", "type", "builtins.NoneType"),
        (
            "subprocess.Popen([sys.executable, '-c', 'import time; time.sleep(600)', __file__], "
            "start_new_session=True); time.sleep(600)",
            "answers in time",
            "nothing for 4 s",
        ),
    ],
)
def test_adapter_that_hangs_or_dies_costs_a_row(tmp_path: Path, body: str, name: str, got: str) -> None:
    file = tmp_path / "mine.py"
    file.write_text(HEAD + textwrap.indent(body, " " * 8))
    rows = list(check_option(str(file), log=tmp_path / "check.log", row_limit_s=4.0 if "sleep" in body else 60.0))
    [row] = [row for row in rows if row.ok is False]
    assert (row.name, row.got) == (name, got)
    assert left_behind(tmp_path) == []


def test_check_by_path_name_or_toml(tmp_path: Path) -> None:
    with_worker(tmp_path, COPY)
    for option in ("copy-content", str(tmp_path / "adapter.toml")):
        rows = list(check_option(option, log=tmp_path / "check.log"))
        assert [row for row in rows if row.ok is False] == []
        assert len(rows) > 10
    [row] = list(check_option("no-such-method", log=tmp_path / "check.log"))
    assert (row.name, row.ok) == ("loads", False)
    assert "unknown method 'no-such-method'" in row.got
