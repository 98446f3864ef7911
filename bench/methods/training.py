"""Training shared by all methods: a seeded loop that can be stopped anywhere and leaves loss curves.

Trainings are counted in steps, never in seconds, and every random number comes from a generator whose state is part
of a checkpoint: a training that was killed and started again ends with the same weights as one that was not.
"""

from __future__ import annotations

import contextlib
import os
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol, TypeAlias

import numpy as np
import torch
from torch import Tensor

from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.errors import BadConfig, MethodFailed

BUDGETS = ("smoke", "small", "paper")
"""How much training: seconds for tests, minutes on one core, the paper's schedule and width."""

CURVE_POINTS = 200
CHECKPOINT_EVERY_S = 60.0
REPORT_EVERY_S = 0.5

Progress = Callable[[str, int, int], None]
"""Called as ``progress(what, steps done, steps in total)``."""

Losses: TypeAlias = Mapping[str, Tensor | float]


def checked_budget(budget: str) -> str:
    """The budget, if there is one of that name.

    Raises
    ------
    BadConfig : an unknown budget.
    """
    if budget not in BUDGETS:
        raise BadConfig(f"unknown budget {budget!r}", where="--budget", remedy=f"choose from {', '.join(BUDGETS)}")
    return budget


@dataclass(frozen=True)
class FitRequest:
    """What a training is asked for.

    Attributes
    ----------
    takes : the fit part, labelled.
    seed, budget, device : ``device`` is ``cpu`` or ``cuda``.
    checkpoints : folder for what an interrupted training leaves behind; None for nowhere.
    progress : called as ``progress(what, done, total)``.
    """

    takes: Sequence[Take]
    seed: int
    budget: str
    device: str
    checkpoints: Path | None
    progress: Progress


class Stateful(Protocol):
    """A network, an optimiser, a schedule, an average: anything whose state can be stored and restored."""

    def state_dict(self) -> dict[str, Any]: ...

    def load_state_dict(self, state_dict: Any, /) -> Any: ...


class Trainable(ABC):
    """What :func:`train` runs: one optimiser step at a time.

    Attributes
    ----------
    generator : the source of all random numbers of a step, on the CPU.
    """

    generator: torch.Generator

    @abstractmethod
    def step(self, index: int) -> Losses:
        """Do optimiser step ``index`` and return its losses by name; names may differ from step to step."""

    @abstractmethod
    def parts(self) -> Mapping[str, Stateful]:
        """Everything that a step changes, by name."""

    def state_dict(self) -> dict[str, Any]:
        """All that is needed to go on from here."""
        parts = {name: part.state_dict() for name, part in self.parts().items()}
        return {"generator": self.generator.get_state(), "parts": parts}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        """Go on from where :meth:`state_dict` was taken."""
        self.generator.set_state(state["generator"])
        for name, part in self.parts().items():
            part.load_state_dict(state["parts"][name])


@dataclass(frozen=True, eq=False)
class Curves:
    """Losses of one training over its steps.

    Attributes
    ----------
    names : of the losses.
    steps : ``[n]`` optimiser steps done at the end of each stretch.
    values : ``[n, len(names)]`` mean loss over each stretch; NaN where a loss was not computed in it.
    seconds : wall-clock seconds of the training, interruptions not counted.
    """

    names: tuple[str, ...]
    steps: IntArray
    values: FloatArray
    seconds: float

    @property
    def last(self) -> dict[str, float]:
        """The mean losses over the last stretch."""
        return dict(zip(self.names, self.values[-1].tolist(), strict=True)) if len(self.steps) else {}

    def save(self, path: Path) -> None:
        """Store as one ``.npz`` without pickles."""
        np.savez(
            path,
            names=np.array(self.names, dtype=np.str_),
            steps=self.steps,
            values=self.values,
            seconds=np.array(self.seconds),
        )

    @classmethod
    def one_after_the_other(cls, stages: Sequence[Curves]) -> Curves:
        """The curves of trainings that followed each other; a loss is NaN in the stages that do not have it."""
        names = tuple(dict.fromkeys(name for stage in stages for name in stage.names))
        starts = np.cumsum([0, *(int(stage.steps[-1]) for stage in stages[:-1])])
        values = [np.full((len(stage.steps), len(names)), np.nan) for stage in stages]
        for stage, rows in zip(stages, values, strict=True):
            rows[:, [names.index(name) for name in stage.names]] = stage.values
        steps = [start + stage.steps for start, stage in zip(starts, stages, strict=True)]
        return cls(names, np.concatenate(steps), np.concatenate(values), sum(stage.seconds for stage in stages))

    @classmethod
    def load(cls, path: Path) -> Curves:
        """Restore what :meth:`save` stored."""
        with np.load(path, allow_pickle=False) as stored:
            names = tuple(str(name) for name in stored["names"])
            return cls(names, stored["steps"], stored["values"], float(stored["seconds"]))


@contextmanager
def seeded(seed: int, device: str = "cpu") -> Iterator[torch.Generator]:
    """Torch seeded, on one thread, both put back afterwards; yields a CPU generator of its own.

    Initial weights and dropout draw from torch's global generator, all else from the one that is yielded.

    Raises
    ------
    BadConfig : a GPU is asked for and there is none.
    """
    if torch.device(device).type == "cuda" and not torch.cuda.is_available():
        raise BadConfig("torch finds no CUDA device here", where="--device", remedy="--device cpu")
    threads = torch.get_num_threads()
    devices = [torch.cuda.current_device()] if torch.device(device).type == "cuda" else []
    with torch.random.fork_rng(devices=devices):
        torch.default_generator.manual_seed(seed)
        if devices:
            torch.cuda.default_generators[devices[0]].manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield torch.Generator().manual_seed(seed)
        finally:
            torch.set_num_threads(threads)


def train(
    trainable: Trainable,
    n_steps: int,
    *,
    progress: Progress,
    name: str = "training",
    checkpoints: Path | None = None,
    checkpoint_every_s: float = CHECKPOINT_EVERY_S,
) -> Curves:
    """Run the steps that are still to be done; call it inside :func:`seeded`.

    Parameters
    ----------
    trainable : freshly built, with the same seed each time.
    n_steps : steps in total.
    progress : hears the latest losses twice a second.
    name : of this training among those of one method; also the checkpoint's file name.
    checkpoints : folder in which an interrupted training left its state and a new one leaves it; None for nowhere.

    Raises
    ------
    MethodFailed : a loss is NaN or infinite.
    BadConfig : the checkpoint is of another training.
    """
    path = checkpoints / f"{name}.pt" if checkpoints else None
    log = _Log(n_steps)
    done = _resume(path, trainable, log)
    started = last_report = last_checkpoint = time.monotonic()
    for index in range(done, n_steps):
        log.add(index, trainable.step(index), name)
        now = time.monotonic()
        if now - last_report >= REPORT_EVERY_S or index + 1 == n_steps:
            last_report = now
            progress(f"{name}: {log.latest()}", index + 1, n_steps)
        if path and (now - last_checkpoint >= checkpoint_every_s or index + 1 == n_steps):
            last_checkpoint = now
            _checkpoint(path, trainable, log, index + 1, log.seconds_before + now - started)
    return log.curves(log.seconds_before + time.monotonic() - started)


class _Log:
    """Means of losses over stretches of steps."""

    def __init__(self, n_steps: int) -> None:
        self.n_steps = n_steps
        self.stretch = max(1, n_steps // CURVE_POINTS)
        self.rows: list[tuple[int, dict[str, float]]] = []
        self.sums: dict[str, tuple[float | Tensor, int]] = {}
        self.seconds_before = 0.0

    def add(self, index: int, losses: Losses, name: str) -> None:
        for loss, value in losses.items():
            value = value.detach() if isinstance(value, Tensor) else value
            total, count = self.sums.get(loss, (0.0, 0))
            self.sums[loss] = total + value, count + 1
        if (index + 1) % self.stretch and index + 1 != self.n_steps:
            return
        means = {loss: float(total) / count for loss, (total, count) in self.sums.items()}
        for loss, value in means.items():
            if not np.isfinite(value):
                raise MethodFailed(
                    f"the training diverged: {loss} is {value}", where=f"{name}, step {index}", remedy="another seed"
                )
        self.rows.append((index + 1, means))
        self.sums = {}

    def latest(self) -> str:
        losses = self.rows[-1][1] if self.rows else {}
        return ", ".join(f"{name} {value:.3g}" for name, value in losses.items())

    def curves(self, seconds: float) -> Curves:
        names = tuple(dict.fromkeys(name for _, losses in self.rows for name in losses))
        values = [[losses.get(name, np.nan) for name in names] for _, losses in self.rows]
        steps = np.array([step for step, _ in self.rows], dtype=np.int64)
        return Curves(names, steps, np.array(values, dtype=np.float64).reshape(len(steps), len(names)), seconds)

    def state_dict(self) -> dict[str, Any]:
        sums = {name: (float(total), count) for name, (total, count) in self.sums.items()}
        return {"n_steps": self.n_steps, "rows": list(self.rows), "sums": sums}

    def load_state_dict(self, state: Mapping[str, Any]) -> None:
        self.rows, self.sums = list(state["rows"]), dict(state["sums"])


def _checkpoint(path: Path, trainable: Trainable, log: _Log, done: int, seconds: float) -> None:
    state = {
        "done": done,
        "seconds": seconds,
        "log": log.state_dict(),
        "trainable": trainable.state_dict(),
        "global": _global_state(),
    }
    # another process at the same training writes the same states, and may be done and tidy up at any time
    with contextlib.suppress(FileNotFoundError):
        path.parent.mkdir(parents=True, exist_ok=True)
        draft = path.with_suffix(f".{os.getpid()}")
        torch.save(state, draft)
        draft.replace(path)


def _resume(path: Path | None, trainable: Trainable, log: _Log) -> int:
    """Restore a checkpoint where there is one; the steps that it had done."""
    if path is None or not path.is_file():
        return 0
    state = torch.load(path, map_location="cpu", weights_only=True)
    if state["log"]["n_steps"] != log.n_steps:
        raise BadConfig(
            f"the checkpoint is of a training of {state['log']['n_steps']} steps, this one has {log.n_steps}",
            where=str(path),
            remedy="remove the file",
        )
    trainable.load_state_dict(state["trainable"])
    log.load_state_dict(state["log"])
    log.seconds_before = float(state["seconds"])
    _restore_global(state["global"])
    return int(state["done"])


def _global_state() -> list[Tensor]:
    on_gpu = [torch.cuda.get_rng_state()] if torch.cuda.is_available() else []
    return [torch.get_rng_state(), *on_gpu]


def _restore_global(states: Sequence[Tensor]) -> None:
    torch.set_rng_state(states[0])
    for state in states[1:]:
        torch.cuda.set_rng_state(state)
