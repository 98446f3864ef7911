"""A tiny benchmark in a process of its own: ``python -m tests.suite.tiny OUT STORE [SCHEDULER]``.

Twelve samples, four anchors and two small judges, on a few takes that are made here; everything else is the real thing.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np

from bench.datasets.base import Dataset, DatasetEntry
from bench.datasets.table import DATASETS
from bench.datasets.take import Take
from bench.metrics import METRICS
from bench.motion import quat
from bench.protocols import PROTOCOLS
from bench.suite import judging
from bench.suite.judge_training import JudgeRecipe
from bench.suite.judges import train_judges
from bench.suite.request import RunRequest
from bench.suite.run import RunResult, run
from classifiers.train import TrainingConfig
from tests.motion.factory import random_clip

CONTENTS, STYLES = ("bow", "wave"), ("bent", "plain")
METHODS = ("real-test", "copy-content", "mean-pose", "noise-0.1")


def tiny_dataset() -> Dataset:
    """Twenty takes in each of 2 x 2 cells that any judge can tell apart."""
    takes = []
    for place, (content, style) in enumerate((c, s) for c in CONTENTS for s in STYLES):
        for number in range(20):
            clip = random_clip(130, seed=100 * place + number, amount_rad=0.1)
            rotations = clip.rotations_wxyz.copy()
            raised = np.array([0.0, 0.0, 1.2 if content == "wave" else 0.0])
            rotations[:, 13] = quat.multiply(rotations[:, 13], quat.from_rotation_vector(raised))
            bent = np.array([0.6 if style == "bent" else 0.0, 0.0, 0.0])
            rotations[:, 9] = quat.multiply(rotations[:, 9], quat.from_rotation_vector(bent))
            take_id = f"{content}_{style}_{number:02d}"
            takes.append(Take(clip.with_motion(rotations, clip.root_xyz_m), take_id, "tiny", content, style))
    return Dataset("tiny", "tiny@1", "tiny-1", tuple(takes), {c: c for c in CONTENTS}, "none", "this test")


@contextmanager
def tiny_tables() -> Iterator[None]:
    """The tiny dataset, task lists of twelve and small judges in the tables of this process, while it lasts."""
    name = "stylebench-transfer@1"
    quick = JudgeRecipe(TrainingConfig(n_steps=60), TrainingConfig(n_steps=20))
    protocol = replace(PROTOCOLS[name], n_samples={"smoke": 12, "quick": 12, "standard": 12})
    with ExitStack() as stack:
        tiny = DatasetEntry(lambda path, progress: tiny_dataset(), "tiny", "none", "none", needs_path=False)
        stack.enter_context(mock.patch.dict(DATASETS, {"tiny": tiny}))
        stack.enter_context(mock.patch.dict(PROTOCOLS, {name: protocol}))
        stack.enter_context(mock.patch.dict(METRICS))
        stack.enter_context(mock.patch.object(judging, "train_judges", partial(train_judges, seeds=(0,), recipe=quick)))
        yield


def tiny_run(out: Path, store: Path, versions: dict[str, int] | None = None, **options: Any) -> RunResult:
    """Run the tiny benchmark; ``versions`` raises the versions of metrics, ``options`` are those of the request."""
    request = replace(RunRequest({"tiny": None}, out, store, METHODS, profile="smoke", jobs=1), **options)
    with tiny_tables():
        for metric, version in (versions or {}).items():
            METRICS[metric] = replace(METRICS[metric], version=version)
        return run(request, lambda *_: None)


def contents(out: Path) -> dict[str, Any]:
    """Records without times, memory and host facts, and the arrays of the samples files, by file name."""
    found: dict[str, Any] = {}
    for path in sorted((out / "records").iterdir()):
        if path.suffix == ".json":
            record = json.loads(path.read_text())
            del record["provenance"], record["log"]
            found[path.name] = record
        else:
            with np.load(path, allow_pickle=False) as arrays:
                found[path.name] = {name: arrays[name].tobytes() for name in arrays.files}
    return found


if __name__ == "__main__":
    tiny_run(Path(sys.argv[1]), Path(sys.argv[2]), scheduler="".join(sys.argv[3:]))
