"""What timing one adapter gave: every measured duration, and facts; stored without pickles."""

from __future__ import annotations

import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray
from bench.errors import BadFile
from reports.records import digest_of, digest_of_arrays, write_bytes_atomically, write_text_atomically

ARRAYS_FILE, FACTS_FILE = "timings.npz", "timings.json"


@dataclass(frozen=True)
class TimingFacts:
    """Single numbers about one timed adapter.

    Attributes
    ----------
    fps : frame rate of the inputs.
    frames_per_call : slice of the plan -> frames that a call answers, whether the adapter could be timed on it or not.
    transfers, streams : what the adapter can; a streaming one is timed step by step in the slice ``online``.
    outside_program : motions travel to another program and back, in each call.
    past_frames : frames before the current one that a call without a stream is given online.
    load_s : from the start of the process to the loaded adapter; harness_load_s : of that, before its first import.
    first_call_s, first_call_slice : the first call of all, and on what; warm_up_calls : those after it, in each slice.
    threads : ``limit`` that was set, and what BLAS and torch, where they are there, then say of themselves.
    waiting_known : whether the system counts how long a call waited for a core.
    companions : adapters that took turns with this one.
    start_memory_mb, peak_memory_mb : resident memory before the first import of the adapter, and the most it had.
    parameters, bytes_per_style, designed_input_frames : as declared; None where they are not.
    look_ahead_frames : as measured in a window of look_ahead_window frames; None with look_ahead_reason.
    look_ahead_to_the_end : the answer depends on the window's last frame, which therefore bounds the number.
    """

    fps: float
    frames_per_call: Mapping[str, int]
    transfers: bool
    streams: bool
    outside_program: bool
    past_frames: int
    load_s: float
    harness_load_s: float
    first_call_s: float
    first_call_slice: str
    warm_up_calls: int
    threads: Mapping[str, int]
    waiting_known: bool
    companions: int
    start_memory_mb: float
    peak_memory_mb: float
    parameters: int | None
    bytes_per_style: int | None
    designed_input_frames: int | None
    look_ahead_frames: int | None
    look_ahead_window: int
    look_ahead_to_the_end: bool
    look_ahead_reason: str


@dataclass(frozen=True, eq=False)
class Timings:
    """Durations of one adapter's calls, seconds, in the order they were made.

    Attributes
    ----------
    durations_s : slice -> ``[n]`` wall-clock time of each steady-state call.
    waited_s : slice -> ``[n]`` the part of it in which the call had no core to run on; 0 where that is not counted.
    overhead_s : slice -> ``[n]`` the same for calls that do nothing, made beside them in the same loop.
    opening_s : ``[m]`` durations of ``open_stream``; empty where the adapter does not stream.
    facts : everything else.
    """

    durations_s: Mapping[str, FloatArray]
    waited_s: Mapping[str, FloatArray]
    overhead_s: Mapping[str, FloatArray]
    opening_s: FloatArray
    facts: TimingFacts

    def own_s(self, slice_name: str) -> FloatArray:
        """Durations ``[n]`` without the waiting for a core: what the calls would last on a machine of their own."""
        return self.durations_s[slice_name] - self.waited_s[slice_name]

    @cached_property
    def arrays(self) -> dict[str, NDArray[np.float64]]:
        """The arrays by name, as stored and digested."""
        return {
            **{f"durations_s/{name}": values for name, values in self.durations_s.items()},
            **{f"waited_s/{name}": values for name, values in self.waited_s.items()},
            **{f"overhead_s/{name}": values for name, values in self.overhead_s.items()},
            "opening_s": self.opening_s,
        }

    @cached_property
    def digest(self) -> str:
        return digest_of({"arrays": digest_of_arrays(self.arrays), "facts": asdict(self.facts)})

    def save(self, folder: Path) -> None:
        """Store into an existing folder."""
        stored = io.BytesIO()
        np.savez(stored, **self.arrays)  # type: ignore[arg-type]
        write_bytes_atomically(folder / ARRAYS_FILE, stored.getvalue())
        facts = {"digest": self.digest, "facts": asdict(self.facts)}
        write_text_atomically(folder / FACTS_FILE, json.dumps(facts, indent=1, sort_keys=True) + "\n")

    @classmethod
    def load(cls, folder: Path) -> Timings:
        """Read what :meth:`save` stored.

        Raises
        ------
        BadFile : missing, damaged, or changed since.
        """
        try:
            # From memory: numpy leaves the file open where it is no archive.
            with np.load(io.BytesIO((folder / ARRAYS_FILE).read_bytes()), allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            told = json.loads((folder / FACTS_FILE).read_text())
            timings = cls(
                _under("durations_s/", arrays),
                _under("waited_s/", arrays),
                _under("overhead_s/", arrays),
                arrays["opening_s"],
                TimingFacts(**told["facts"]),
            )
        except (OSError, ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
            raise BadFile(f"stored timings cannot be read: {error}", where=str(folder)) from error
        if timings.digest != told["digest"]:
            raise BadFile("stored timings were changed: their digest is another", where=str(folder))
        return timings


def _under(prefix: str, arrays: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
    return {name.removeprefix(prefix): values for name, values in arrays.items() if name.startswith(prefix)}
