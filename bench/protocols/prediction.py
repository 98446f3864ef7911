"""``stylebench-prediction@1``: the next frame of a motion from its past, its style and the way ahead.

Mason 2022, sections 4.3 and 5.2.2.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import Protocol, Task, TaskPool
from bench.protocols.transfer import make_tasks

PAST_S = 1.0
"""Past and trajectory ahead, seconds (Mason 2022, section 4.1)."""


def prediction_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Single frames of test takes with a second of the take before and after them.

    The style reference is another take of the same style where there is one: the motion is predicted, not changed.

    Raises
    ------
    BadData : no take is longer than two seconds.
    """
    usable = [take for take in pool.takes if take.clip.n_frames > 2 * _second(take)]
    if not usable:
        raise BadData(f"prediction needs takes of more than {2 * PAST_S:g} s, there is none")
    by_id = {take.take_id: take for take in usable}
    rng = np.random.default_rng([seed, 2])
    tasks = []
    for task in make_tasks(TaskPool(usable), n, seed):
        take = by_id[task.content_take_id]
        n_past = _second(take)
        others = [t for t in pool.takes if t.style == take.style and t.take_id != take.take_id]
        reference = others[int(rng.integers(len(others)))] if others else take
        tasks.append(
            replace(
                task,
                start_frame=int(rng.integers(n_past, take.clip.n_frames - n_past)),
                n_frames=1,
                style_take_id=reference.take_id,
                target_style=str(take.style),
                reference_content=str(reference.content),
            )
        )
    return tasks


def _second(take: Take) -> int:
    return round(PAST_S * take.clip.fps)


PREDICTION = Protocol(
    name="stylebench-prediction",
    version=1,
    track="prediction",
    judged=False,
    summary="past second + style reference + ground path of the next second -> the next frame",
    needs="predicts",
    fps=30.0,
    n_samples={"smoke": 40, "quick": 1000, "standard": 2500},
    metrics=("next_frame_error", "bone_length_loss"),
    primary=("next_frame_error", "all"),
    make_tasks=prediction_tasks,
    facts={
        "samples": "single frames, each predicted from the true past (no feedback of outputs)",
        "features": "position, 6-D rotation and velocity of 21 joints in the local frame of the frame before, z-scored "
        "on the fit part",
        "dropout at test": "off; methods that leave it on say so in their own rows",
    },
)
