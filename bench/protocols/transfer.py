"""``stylebench-transfer@1``: our own track for style transfer, one 64-frame window a sample."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence

import numpy as np

from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import Protocol, Task

WINDOW_FRAMES = 64
SAME_CONTENT_EVERY = 5
"""Every fifth sample has a style reference of the source's own content."""


def make_tasks(test_takes: Sequence[Take], n: int, seed: int) -> list[Task]:
    """The first ``n`` tasks of the fixed list; a longer list begins with the shorter one.

    Contents take turns, so that every content is source equally often; within a content the source take, the target
    style (never the source's own) and the style reference are drawn uniformly from the test part. Every fifth
    reference shows the same content as the source, the others another one.

    Raises
    ------
    BadData : no task can be made because there is one style or one content only.
    """
    by_content: dict[str, list[Take]] = defaultdict(list)
    for take in sorted(test_takes, key=lambda take: take.take_id):
        by_content[str(take.content)].append(take)
    contents = sorted(by_content)
    styles = sorted({str(take.style) for take in test_takes})
    if len(styles) < 2 or len(contents) < 2:
        raise BadData(
            f"style transfer needs at least 2 styles and 2 contents in the test part, got {len(styles)} and "
            f"{len(contents)}"
        )
    rng = np.random.default_rng(seed)
    tasks: list[Task] = []
    for index in range(n):
        content = contents[index % len(contents)]
        same = (index // len(contents)) % SAME_CONTENT_EVERY == 0
        tasks.append(_draw_task(f"s{index:04d}", content, same, by_content, styles, rng))
    return tasks


def _draw_task(
    sample_id: str,
    content: str,
    same_content: bool,
    by_content: dict[str, list[Take]],
    styles: list[str],
    rng: np.random.Generator,
) -> Task:
    source = _pick(by_content[content], rng)
    targets = [style for style in styles if style != source.style]
    target = targets[int(rng.integers(len(targets)))]
    references = [
        take
        for name, takes in by_content.items()
        if (name == content) == same_content
        for take in takes
        if take.style == target
    ]
    if not references:
        references = [take for takes in by_content.values() for take in takes if take.style == target]
    reference = _pick(references, rng)
    return Task(
        sample_id=sample_id,
        content_take_id=source.take_id,
        start_frame=int(rng.integers(max(source.clip.n_frames - WINDOW_FRAMES, 0) + 1)),
        style_take_id=reference.take_id,
        content=content,
        source_style=str(source.style),
        target_style=target,
        reference_content=str(reference.content),
        seed=int(rng.integers(2**31)),
    )


def _pick(takes: list[Take], rng: np.random.Generator) -> Take:
    return takes[int(rng.integers(len(takes)))]


TRANSFER = Protocol(
    name="stylebench-transfer",
    version=1,
    track="transfer",
    summary="content window + style reference -> motion; content and style must both be right on the same sample",
    needs="transfers",
    window_frames=WINDOW_FRAMES,
    fps=30.0,
    n_samples={"smoke": 60, "quick": 1000, "standard": 2500},
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
    ),
    primary=("joint_recognition", "different_content"),
    make_tasks=make_tasks,
    facts={
        "window": "64 frames at 30 fps, takes under 64 frames padded with their first and last pose",
        "pairs": "target style never the source's; every fifth reference of the source's own content",
        "post-processing": "none: outputs are scored as they come",
    },
)
