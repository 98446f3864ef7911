"""``stylebench-transfer@1``: our own track for style transfer, one 64-frame window a sample."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence

import numpy as np

from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.pose import random_start
from bench.protocols.base import Protocol, Task, TaskPool, pick

WINDOW_FRAMES = 64
SAME_CONTENT_EVERY = 5
"""Every fifth sample has a style reference of the source's own content."""


def make_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """The first ``n`` tasks of the fixed list; a longer list begins with the shorter one.

    Contents take turns, so that every content is source equally often; within a content the source take, the target
    style (never the source's own) and the style reference are drawn uniformly from the test part. Every fifth
    reference shows the same content as the source, the others another one.

    Raises
    ------
    BadData : no task can be made because there is one style or one content only.
    """
    return draw_tasks(pool.takes, pool.takes, n, seed)


def draw_tasks(sources: Sequence[Take], references: Sequence[Take], n: int, seed: int) -> list[Task]:
    """:func:`make_tasks` with sources and style references from different takes."""
    sources_by_content, references_by_content = _by_content(sources), _by_content(references)
    contents, styles = sorted(sources_by_content), sorted({str(take.style) for take in references})
    if len(styles) < 2 or len(references_by_content) < 2:
        raise BadData(
            f"style transfer needs at least 2 styles and 2 contents in the test part, got {len(styles)} and "
            f"{len(references_by_content)}"
        )
    rng = np.random.default_rng(seed)
    tasks: list[Task] = []
    for index in range(n):
        content = contents[index % len(contents)]
        same = (index // len(contents)) % SAME_CONTENT_EVERY == 0
        source = pick(sources_by_content[content], rng)
        tasks.append(_draw_task(f"s{index:04d}", source, same, references_by_content, styles, rng))
    return tasks


def _by_content(takes: Sequence[Take]) -> dict[str, list[Take]]:
    by_content: dict[str, list[Take]] = defaultdict(list)
    for take in sorted(takes, key=lambda take: take.take_id):
        by_content[str(take.content)].append(take)
    return by_content


def _draw_task(
    sample_id: str,
    source: Take,
    same_content: bool,
    by_content: Mapping[str, list[Take]],
    styles: list[str],
    rng: np.random.Generator,
) -> Task:
    targets = [style for style in styles if style != source.style]
    target = targets[int(rng.integers(len(targets)))]
    references = [
        take
        for name, takes in by_content.items()
        if (name == source.content) == same_content
        for take in takes
        if take.style == target
    ]
    if not references:
        references = [take for takes in by_content.values() for take in takes if take.style == target]
    reference = pick(references, rng)
    return Task(
        sample_id=sample_id,
        content_take_id=source.take_id,
        start_frame=random_start(source.clip, WINDOW_FRAMES, rng),
        style_take_id=reference.take_id,
        content=str(source.content),
        source_style=str(source.style),
        target_style=target,
        reference_content=str(reference.content),
        seed=int(rng.integers(2**31)),
    )


TRANSFER = Protocol(
    name="stylebench-transfer",
    version=1,
    track="transfer",
    summary="content window + style reference -> motion; content and style must both be right on the same sample",
    needs="transfers",
    fps=30.0,
    n_samples={"smoke": 100, "quick": 1000, "standard": 2500},
    metrics=(
        "joint_recognition",
        "joint_recognition_ratio",
        "conditional_kid",
        "conditional_fmd",
        "copied_share",
        "cra",
        "cra_balanced",
        "sra",
        "sra_balanced",
        "cra_top3",
        "sra_top3",
        "source_style_residue",
        "fmd[stgcn-content]",
        "fmd[stgcn-style]",
        "fmd[dae]",
        "kid[stgcn-content]",
        "kid[stgcn-style]",
        "jerk_ratio",
        "jerk_ratio_worst_content",
        "time_correlation",
        "bone_drift",
        "foot_skate",
        "skate[gmd]",
        "penetration",
        "float_height",
        "speed_ratio",
        "joint_range",
        "contact_precision",
        "contact_recall",
        "root_path_error",
        "density[stgcn-content]",
        "coverage[stgcn-content]",
        "density[stgcn-style]",
        "coverage[stgcn-style]",
        "diversity",
        "multimodality",
        "neighbour_ratio",
    ),
    truth_metrics=("paired_position", "paired_rotation", "paired_position_aligned", "paired_rotation_aligned"),
    primary=("joint_recognition", "different_content"),
    make_tasks=make_tasks,
    facts={
        "window": "64 frames at 30 fps, takes under 64 frames padded with their first and last pose",
        "pairs": "target style never the source's; every fifth reference of the source's own content",
        "post-processing": "none: outputs are scored as they come",
    },
)
