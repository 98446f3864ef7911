"""A toy setting for scores: judge outputs that are right or wrong on purpose."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from bench.arrays import IntArray
from bench.datasets.pack import Pack, write_pack
from bench.datasets.take import Take
from bench.metrics.frechet import PrincipalComponents
from bench.motion.edit import window
from bench.protocols.base import Task, TaskPool
from bench.protocols.transfer import make_tasks
from bench.suite.copying import DescriptorBank
from bench.suite.embedding import Embedding
from bench.suite.motions import Motions
from bench.suite.reference import label_indices
from bench.suite.scores.base import Labelled, Reference, Row
from bench.suite.scores.distances import SET_FEATURES
from reports.bootstrap import cluster_counts
from tests.motion.factory import random_clip

CONTENTS, STYLES = ("run", "walk"), ("angry", "old", "proud")
N_SEEDS, N_TASKS = 2, 90
FLOORS = {name: 0.01 for name in (*SET_FEATURES, "conditional_kid", "conditional_fmd")}


def toy_takes(first_seed: int) -> list[Take]:
    """Four takes of 80 frames in each of 2 x 3 cells."""
    return [
        Take(random_clip(80, seed=first_seed + 10 * place + number), f"{c}_{s}_{number}", "toy", c, s)
        for place, (c, s) in enumerate((c, s) for c in CONTENTS for s in STYLES)
        for number in range(4)
    ]


def features_of(labels: IntArray, d: int, seed: int) -> NDArray[np.float32]:
    """Features ``[S, n, d]`` whose mean depends on the label."""
    rng = np.random.default_rng(seed)
    centres = np.random.default_rng(99).normal(size=(4, d))
    return (centres[labels] + 0.3 * rng.normal(size=(N_SEEDS, len(labels), d))).astype(np.float32)


def certain(labels: IntArray, n_classes: int) -> NDArray[np.float32]:
    """Log probabilities ``[S, n, K]`` of judges that have no doubt."""
    sure = np.where(np.arange(n_classes) == labels[:, None], 0.0, -20.0)
    return np.tile(sure, (N_SEEDS, 1, 1)).astype(np.float32)


def embedding_of(contents: IntArray, styles: IntArray, seed: int = 0) -> Embedding:
    """Judges that see exactly these labels."""
    return Embedding(
        features_of(contents, 8, seed),
        features_of(styles, 8, seed + 1),
        certain(contents, len(CONTENTS)),
        certain(styles, len(STYLES)),
        features_of(styles, 6, seed + 2),
    )


def pack_of(takes: list[Take]) -> Pack:
    """Takes as a pack in memory."""
    with TemporaryDirectory() as folder:
        write_pack(Path(folder), takes)
        pack = Pack.open(Path(folder))
        return replace(pack, rotations_wxyz=np.array(pack.rotations_wxyz), root_xyz_m=np.array(pack.root_xyz_m))


def sources_of(tasks: Sequence[Task]) -> Motions:
    """The source windows, labelled as answers are."""
    by_id = {take.take_id: take for take in toy_takes(0)}
    return Motions.of(
        [
            Take(window(by_id[t.content_take_id].clip, t.start_frame, 64), content=t.content, style=t.target_style)
            for t in tasks
        ]
    )


def reference() -> Reference:
    """Test takes as sources, other takes as fit; 120 real windows."""
    test, fit = toy_takes(0), [replace(take, take_id=f"fit_{take.take_id}") for take in toy_takes(500)]
    tasks = make_tasks(TaskPool(test), N_TASKS, 0)
    rng = np.random.default_rng(5)
    contents, styles = rng.integers(0, 2, 120), rng.integers(0, 3, 120)
    real = Labelled(embedding_of(contents, styles, 10), contents, styles)
    floor_contents, floor_styles = rng.integers(0, 2, N_TASKS), rng.integers(0, 3, N_TASKS)
    floor = Labelled(embedding_of(floor_contents, floor_styles, 20), floor_contents, floor_styles)
    components = tuple(
        PrincipalComponents.fit(real.embedding.style_features[s].astype(np.float64), 4) for s in range(N_SEEDS)
    )
    return Reference(
        tasks=tasks,
        content_labels=CONTENTS,
        style_labels=STYLES,
        real=real,
        floor=floor,
        style_components=components,
        content_components=components,
        fit_bank=DescriptorBank.of(fit, 4),
        test_bank=DescriptorBank.of(test, 1),
        copy_threshold=0.01,
        floor_jerk=np.full(N_TASKS, 50.0),
        floors=FLOORS,
        counts=cluster_counts(np.array([task.content_take_id for task in tasks]), 50, seed=0),
        pack=pack_of([*test, *fit]),
        fit_take_ids=tuple(take.take_id for take in fit),
        truth=sources_of(tasks),
        activations={},
    )


def row(reference: Reference, *, content_right: float = 1.0, style_right: float = 1.0, outputs: Motions | None = None,
        given: bool = True) -> Row:  # fmt: skip
    """A row whose judges see the right content and style on these shares of the samples; outputs default to sources."""
    source = sources_of(reference.tasks)
    contents = label_indices([task.content for task in reference.tasks], CONTENTS)
    styles = label_indices([task.target_style for task in reference.tasks], STYLES)
    sources = label_indices([task.source_style for task in reference.tasks], STYLES)
    place = np.arange(len(contents)) / len(contents)
    seen_contents = np.where(place < content_right, contents, 1 - contents)
    seen_styles = np.where(place < style_right, styles, sources)
    return Row(
        motions=outputs or source,
        embedding=embedding_of(seen_contents, seen_styles),
        source=source,
        contents=contents,
        styles=styles,
        source_styles=sources,
        given=given,
    )
