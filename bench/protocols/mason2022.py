"""``mason2022@1``: Table 2 and Figure 10 of Mason et al. 2022, and rollouts of ten seconds.

Everything here is locomotion: takes that travel.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from bench.datasets.base import Dataset
from bench.datasets.joined import joined_take
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.edit import crop, resample
from bench.motion.locomotion import travels
from bench.protocols.base import Task, TaskPool, pick
from bench.protocols.conditions import long_tasks
from bench.protocols.prediction import PREDICTION, prediction_tasks
from bench.protocols.runtime import RUNTIME
from bench.protocols.transfer import TRANSFER

FPS = 60.0
ROLLOUT_S = 10.0
N_ROLLOUTS = 60


def locomotion_takes(parts: Mapping[str, Sequence[Take]], foreign: Dataset | None, seed: int) -> list[Take]:
    """Test takes that travel, at 60 fps; their ids say so.

    Raises
    ------
    BadData : none does.
    """
    found = [take for take in parts["test"] if travels(take.clip)]
    if not found:
        raise BadData("style modelling needs takes of locomotion, and no test take travels")
    return [replace(take, take_id=f"60fps:{take.take_id}", clip=resample(take.clip, FPS)) for take in found]


def frame_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Single frames of locomotion, as in the prediction track."""
    return prediction_tasks(TaskPool(pool.extra), n, seed)


def rollout_sequences(parts: Mapping[str, Sequence[Take]], foreign: Dataset | None, seed: int) -> list[Take]:
    """Ten seconds of one style and one gait each, joined from test takes.

    Raises
    ------
    BadData : no test take travels.
    """
    cells: dict[tuple[str, str], list[Take]] = {}
    for take in sorted(parts["test"], key=lambda take: take.take_id):
        if travels(take.clip):
            cells.setdefault((str(take.content), str(take.style)), []).append(take)
    if not cells:
        raise BadData("rollouts follow takes of locomotion, and no test take travels")
    rng = np.random.default_rng([seed, 3])
    names = sorted(cells)
    return [_sequence(number, cells[names[number % len(names)]], rng) for number in range(N_ROLLOUTS)]


def _sequence(number: int, takes: Sequence[Take], rng: np.random.Generator) -> Take:
    first = pick(takes, rng)
    n_frames = round(ROLLOUT_S * first.clip.fps)
    pieces = [first]
    while sum(piece.clip.n_frames for piece in pieces) < n_frames:
        pieces.append(pick(takes, rng))
    sequence = joined_take(f"rollout-{number:02d}", pieces, first.clip.skeleton, first.clip.fps, content="joined")
    return sequence.with_clip(crop(sequence.clip, 0, n_frames))


def rollout_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """One task a sequence; style references travel too, and have another style."""
    return long_tasks(TaskPool(pool.takes, pool.extra), n, seed, references=travels)


TABLE_2 = replace(
    RUNTIME,
    name="mason2022",
    condition="table2",
    summary="Table 2: duration of the next frame at 60 fps, parameters, numbers a style",
    needs="streams",
    fps=FPS,
    facts={
        **{name: fact for name, fact in RUNTIME.facts.items() if name != "offline"},
        "online": "one frame in, one frame out; the first frame of a stream is not timed",
    },
)

FIG_10 = replace(
    PREDICTION,
    name="mason2022",
    condition="fig10",
    summary="Figure 10: error of the next frame at 60 fps, on unseen frames of seen styles",
    fps=FPS,
    make_tasks=frame_tasks,
    extra_takes=locomotion_takes,
    facts={
        **PREDICTION.facts,
        "samples": "single frames of test takes that travel, resampled to 60 fps, each from its true past",
    },
)

ROLLOUT = replace(
    TRANSFER,
    name="mason2022",
    condition="rollout",
    summary="ten seconds along the path of a joined walk or run, in another style, frame by frame",
    needs="streams",
    n_samples={"smoke": 3, "quick": 30, "standard": N_ROLLOUTS},
    metrics=("sra", "cra", "path_drift", "foot_skate", "jerk_ratio"),
    truth_metrics=(),
    primary=("sra", "all"),
    make_tasks=rollout_tasks,
    extra_takes=rollout_sequences,
    facts={
        "sequences": "10 s of one style and one gait, test takes that travel, blended over 0.3 s; two joins or more",
        "samples": "every 64 frames inside a piece, clear of the blends",
        "given": "one pose of the sequence a step; its path is the user's wish, its future is not shown",
    },
)
