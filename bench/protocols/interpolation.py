"""``stylebench-interpolation@1``: styles mixed at five weights, for the whole body and by body part.

The papers show interpolations as pictures only (Motion Puzzle 2022, Figure 12; Style-ERD 2022, Figure 6; Mason 2022,
Figure 8).
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.metrics.interpolation import WEIGHTS
from bench.protocols.base import Protocol, Task, TaskPool, pick
from bench.protocols.transfer import WINDOW_FRAMES, make_tasks

PARTS = ("legs", "arms", "spine")


def interpolation_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Groups of five tasks, one a weight; every second group starts from a third style, the others from the source.

    The start style's reference is drawn like the target's and never of the target style.
    """
    rng = np.random.default_rng([seed, 1])
    tasks = []
    for number, task in enumerate(make_tasks(pool, -(-n // len(WEIGHTS)), seed)):
        start = ""
        if number % 2:
            others = [take for take in pool.takes if take.style not in (task.target_style, task.source_style)]
            start = pick(others, rng).take_id if others else ""
        tasks += [
            replace(
                task,
                sample_id=f"{task.sample_id}-{round(100 * weight):03d}",
                weight=weight,
                start_take_id=start,
                group=task.sample_id,
            )
            for weight in WEIGHTS
        ]
    return tasks[:n]


def part_interpolation_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """The same groups with a body part each, in turn legs, arms and spine."""
    tasks = interpolation_tasks(pool, n, seed)
    return [replace(task, part=PARTS[(index // len(WEIGHTS)) % len(PARTS)]) for index, task in enumerate(tasks)]


INTERPOLATION = Protocol(
    name="stylebench-interpolation",
    version=1,
    track="interpolation",
    summary="source + two styles at weights 0, .25, .5, .75, 1 -> motions that go evenly from one to the other",
    needs="interpolates",
    fps=30.0,
    n_samples={"smoke": 40, "quick": 1000, "standard": 2500},
    metrics=("monotonicity", "evenness", "end_recognition", "middle_content"),
    primary=("monotonicity", "all"),
    make_tasks=interpolation_tasks,
    facts={
        "samples": "groups of five outputs, one a weight",
        "pairs": "half of the groups go from the source's style, half from a third style's reference",
        "window": f"{WINDOW_FRAMES} frames at 30 fps",
    },
)

INTERPOLATION_PARTS = replace(
    INTERPOLATION,
    condition="parts",
    summary="the same for one body part at a time, the other parts staying the source's",
    needs="interpolates parts",
    metrics=("monotonicity", "evenness", "middle_content"),
    make_tasks=part_interpolation_tasks,
    facts={**INTERPOLATION.facts, "parts": "legs, arms and spine in turn"},
)
