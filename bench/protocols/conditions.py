"""Conditions of the transfer track: what happens at its edges, each a tagged slice with its own tasks and rows.

``self``: content and style are one take. ``long``: sequences of 1000 and 3600 frames joined from several contents.
``short``: only the first 10, 16, 32 or 64 frames are given. ``foreign``: the content comes from another dataset.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bench.datasets.base import Dataset
from bench.datasets.joined import joined_take, piece_ids
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.protocols.base import Task, TaskPool, pick
from bench.protocols.transfer import TRANSFER, WINDOW_FRAMES, draw_tasks, make_tasks

LONG_FRAMES = (1000, 1000, 1000, 1000, 3600)
"""Frames of long sequences, in turn."""
N_LONG = 50
PREFIX_FRAMES = (10, 16, 32, 64)


def self_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Tasks of the transfer track whose style reference is the source's own take."""
    return [
        replace(
            task,
            style_take_id=task.content_take_id,
            target_style=task.source_style,
            reference_content=task.content,
        )
        for task in make_tasks(pool, n, seed)
    ]


def short_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Groups of four tasks: the first 10, 16, 32 and 64 frames of one source, the same style reference and seed.

    Sources are takes of at least 64 frames: in a padded window a prefix would be repetitions of the first pose.
    """
    long_enough = TaskPool([take for take in pool.takes if take.clip.n_frames >= WINDOW_FRAMES])
    groups = make_tasks(long_enough, -(-n // len(PREFIX_FRAMES)), seed)
    tasks = [
        replace(task, sample_id=f"{task.sample_id}-{frames:02d}", n_frames=frames, group=task.sample_id)
        for task in groups
        for frames in PREFIX_FRAMES
    ]
    return tasks[:n]


def long_sequences(parts: Mapping[str, Sequence[Take]], foreign: Dataset | None, seed: int) -> list[Take]:
    """Joined sequences of test takes: one style each, contents in random order, poses blended over 0.3 s.

    The native contents of the pieces are not judged here; tasks name the judged ones.
    """
    by_style: dict[str, list[Take]] = {}
    for take in sorted(parts["test"], key=lambda take: take.take_id):
        by_style.setdefault(str(take.style), []).append(take)
    rng = np.random.default_rng(seed)
    styles = sorted(by_style)
    return [_sequence(number, styles[number % len(styles)], by_style, rng) for number in range(N_LONG)]


def _sequence(number: int, style: str, by_style: Mapping[str, list[Take]], rng: np.random.Generator) -> Take:
    n_frames = LONG_FRAMES[number % len(LONG_FRAMES)]
    pieces = [pick(by_style[style], rng)]
    while sum(piece.clip.n_frames for piece in pieces) < n_frames:
        others = [take for take in by_style[style] if take.content != pieces[-1].content]
        pieces.append(pick(others or by_style[style], rng))
    first = pieces[0].clip
    sequence = joined_take(f"long-{number:02d}", pieces, first.skeleton, first.fps, content="joined")
    return sequence.with_clip(crop(sequence.clip, 0, n_frames))


def long_tasks(
    pool: TaskPool, n: int, seed: int, *, references: Callable[[Clip], bool] = lambda clip: True
) -> list[Task]:
    """One task a joined sequence, with the judged content of each piece; styles are takes that ``references`` lets."""
    by_id = {take.take_id: take for take in pool.takes}
    rng = np.random.default_rng(seed)
    tasks = []
    for index, sequence in enumerate(pool.extra[:n]):
        others = [take for take in pool.takes if take.style != sequence.style and references(take.clip)]
        reference = pick(others, rng)
        pieces = [by_id[take_id] for take_id in piece_ids(sequence.take_id)]
        starts = np.cumsum([0, *(piece.clip.n_frames for piece in pieces[:-1])])
        tasks.append(
            Task(
                sample_id=f"s{index:04d}",
                content_take_id=sequence.take_id,
                start_frame=0,
                style_take_id=reference.take_id,
                content="joined",
                source_style=str(sequence.style),
                target_style=str(reference.style),
                reference_content=str(reference.content),
                seed=int(rng.integers(2**31)),
                n_frames=0,
                group=f"slice:frames={sequence.clip.n_frames}",
                segments=tuple((int(s), str(piece.content)) for s, piece in zip(starts, pieces, strict=True)),
            )
        )
    return tasks


def foreign_takes(parts: Mapping[str, Sequence[Take]], foreign: Dataset | None, seed: int) -> list[Take]:
    """Takes of the other dataset whose content both datasets judge under the same name, ids prefixed by its name.

    Raises
    ------
    BadData : there is no other dataset, or no content in common.
    """
    if foreign is None:
        raise BadData(
            "the foreign condition takes its contents from a second dataset, and there is only one",
            remedy="give two datasets with --data",
        )
    own = {take.content for takes in parts.values() for take in takes}
    shared = [take for take in foreign.takes if take.content in own]
    if not shared:
        raise BadData(f"no content in common with {foreign.dataset_id}", where="foreign")
    return [replace(take, take_id=f"{foreign.name}:{take.take_id}", style=f"{foreign.name}:{take.style}")
            for take in shared]  # fmt: skip


def foreign_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Tasks of the transfer track with sources from the other dataset."""
    return draw_tasks(pool.extra, pool.takes, n, seed)


_RECOGNITION = ("joint_recognition", "cra", "sra")

SELF = replace(
    TRANSFER,
    condition="self",
    summary="content and style are one take: a method should give back its source",
    n_samples={"smoke": 24, "quick": 200, "standard": 500},
    metrics=("reconstruction_position", "reconstruction_rotation", *_RECOGNITION, "jerk_ratio", "time_correlation"),
    truth_metrics=(),
    primary=("reconstruction_position", "all"),
    make_tasks=self_tasks,
    facts={"pairs": "the style reference is the source's own take", "window": TRANSFER.facts["window"]},
)

LONG = replace(
    TRANSFER,
    condition="long",
    summary="sequences of 1000 and 3600 frames joined from several contents, judged piece by piece",
    n_samples={"smoke": 2, "quick": 20, "standard": 50},
    metrics=(*_RECOGNITION, "join_jerk_ratio"),
    truth_metrics=(),
    primary=("joint_recognition", "different_content"),
    make_tasks=long_tasks,
    extra_takes=long_sequences,
    facts={
        "sequences": "4 of 5 have 1000 frames, 1 of 5 has 3600; test takes of one style, blended over 0.3 s",
        "samples": "every 64 frames inside a piece, clear of the blends",
    },
)

SHORT = replace(
    TRANSFER,
    condition="short",
    judged=False,
    summary="only the first 10, 16, 32, 64 frames are given; compared with the answer to all 64",
    n_samples={"smoke": 16, "quick": 400, "standard": 1000},
    metrics=("prefix_error",),
    truth_metrics=(),
    primary=("prefix_error", "frames=32"),
    make_tasks=short_tasks,
    facts={"samples": "groups of four: 10, 16, 32 and 64 frames of one source from its start, same style and seed"},
)

FOREIGN = replace(
    TRANSFER,
    condition="foreign",
    summary="contents of another dataset (those both share) in styles of this one",
    n_samples={"smoke": 24, "quick": 400, "standard": 1000},
    metrics=(*_RECOGNITION, "jerk_ratio", "bone_drift"),
    truth_metrics=(),
    primary=("joint_recognition", "different_content"),
    make_tasks=foreign_tasks,
    extra_takes=foreign_takes,
    facts={"pairs": "source from any take of the other dataset, style reference from the test part; else as standard"},
)
