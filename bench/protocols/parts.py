"""``stylebench-parts@1``: the style of one body part at a time, and what moves that should not.

Motion Puzzle 2022, section 7.1 and Table 1, over many pairs instead of one.
"""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.base import Protocol, Task, TaskPool
from bench.protocols.transfer import WINDOW_FRAMES, make_tasks

PART_GROUPS = ("legs", "arms", "spine", "all")
"""The groups of Motion Puzzle's Table 1, and the whole body."""


def part_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Four tasks a pair, one for each group of body parts, all with the pair's source, reference and seed."""
    pairs = make_tasks(pool, -(-n // len(PART_GROUPS)), seed)
    tasks = [
        replace(task, sample_id=f"{task.sample_id}-{part}", part=part, group=task.sample_id)
        for task in pairs
        for part in PART_GROUPS
    ]
    return tasks[:n]


PARTS_PROTOCOL = Protocol(
    name="stylebench-parts",
    version=1,
    track="parts",
    judged=False,
    summary="source + style reference for some body parts -> motion; the other parts should stay as they are",
    needs="transfers parts",
    fps=30.0,
    n_samples={"smoke": 16, "quick": 800, "standard": 800},
    metrics=(
        "leak_ratio",
        "leak_ratio[position]",
        "locality_msd",
        "locality_distance",
        "joints_above_0.1",
        "joints_above_0.05",
    ),
    primary=("leak_ratio", "all"),
    make_tasks=part_tasks,
    facts={
        "pairs": "200 pairs (smoke: 4), each with legs, arms, spine and all joints in turn",
        "window": f"{WINDOW_FRAMES} frames at 30 fps",
        "displacement": "world positions over stature, not aligned; squared and plain; virtual joints left out",
        "leak ratio": "angles of local rotations, so that arms that a turning spine carries along do not count",
        "post-processing": "none",
    },
)
