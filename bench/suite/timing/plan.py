"""What is timed and how long: the job of one process, and the plan that all of them share."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from bench.adapters.loading import AdapterSource

ONLINE = "online"


def offline(length: int) -> str:
    """The slice of whole-clip calls on ``length`` frames: ``offline L=60``."""
    return f"offline L={length}"


@dataclass(frozen=True)
class TimingJob:
    """One adapter to be timed, in a process of its own.

    Attributes
    ----------
    key : names the job in what :func:`bench.suite.timing.harness.time_adapters` returns.
    pack : folder of stored takes, tasks_file : the tasks whose takes are the inputs.
    store, fit_key : where the fitted state lies; an empty key where nothing is fitted.
    seed : seeds the generator that every call is given anew.
    """

    key: str
    source: AdapterSource
    pack: str
    store: str
    fit_key: str
    tasks_file: str
    seed: int


@dataclass(frozen=True)
class TimingPlan:
    """How all adapters of a run are timed.

    Attributes
    ----------
    fps : frame rate of all inputs.
    lengths : frames of the whole-clip calls (Style-ERD, Table 2).
    past_frames : what a method that does not stream is given beside the current frame (Style-ERD, section 4).
    n_inputs : the first tasks of the list, taken in turn.
    warm_up_calls : calls before the clock counts, for each slice.
    rounds, calls : every adapter of a group gets its turn once a round, for a block of that many calls.
    block_s, bound_s : slow adapters get shorter blocks and fewer rounds, to stay about under these seconds a slice.
    group_size : adapters that are alive together and take turns.
    look_ahead_window : frames of the window in which look-ahead is measured.
    seed : shuffles the order of turns.
    """

    fps: float = 30.0
    lengths: tuple[int, ...] = (60, 90, 120)
    past_frames: int = 32
    n_inputs: int = 8
    warm_up_calls: int = 10
    rounds: int = 30
    calls: int = 10
    block_s: float = 0.25
    bound_s: float = 10.0
    group_size: int = 6
    look_ahead_window: int = 64
    seed: int = 0

    @property
    def input_frames(self) -> int:
        """Frames of an input from which each call gets its own cut."""
        return max(*self.lengths, self.look_ahead_window, self.past_frames + 1) + self.rounds * self.calls

    @property
    def slices(self) -> dict[str, int]:
        """What is timed, with the frames that one call of it answers."""
        return {**{offline(length): length for length in self.lengths}, ONLINE: 1}

    def turns(self, seconds_per_call: float, calls_before: int = 0) -> Turns:
        """Rounds and calls that fit the bounds: at least two calls, at most what the plan wants.

        ``calls_before`` each block are made but not timed.
        """
        calls = int(min(max(self.block_s / seconds_per_call, 1.0), self.calls))
        block_calls = calls_before + calls + (calls > 1)
        rounds = int(min(max(self.bound_s / (seconds_per_call * block_calls), 1.0), self.rounds))
        return Turns(rounds, max(calls, 2) if rounds == 1 else calls)


@dataclass(frozen=True)
class Turns:
    """In how many rounds an adapter takes part, and its calls each time."""

    rounds: int
    calls: int

    def takes_part(self, round_number: int, all_rounds: int) -> bool:
        """True in ``rounds`` of ``all_rounds`` rounds, evenly spread."""
        return (round_number + 1) * self.rounds // all_rounds > round_number * self.rounds // all_rounds


def write_job(path: Path, job: TimingJob, plan: TimingPlan, threads: int) -> None:
    """Store what a timing process needs, as JSON."""
    path.write_text(json.dumps({"job": asdict(job), "plan": asdict(plan), "threads": threads}))


def read_job(path: Path) -> tuple[TimingJob, TimingPlan, int]:
    """Restore what :func:`write_job` stored."""
    data = json.loads(path.read_text())
    job = TimingJob(**{**data["job"], "source": AdapterSource(**data["job"]["source"])})
    plan = TimingPlan(**{**data["plan"], "lengths": tuple(data["plan"]["lengths"])})
    return job, plan, int(data["threads"])
