from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from bench.adapters.loading import AdapterSource
from bench.datasets.pack import write_pack
from bench.datasets.take import Take
from bench.protocols.base import TaskPool
from bench.protocols.transfer import make_tasks
from bench.suite.cell import GenerateJob, Job
from bench.suite.motions import Motions
from bench.suite.store import Store
from bench.suite.workers import Limits, Outcome, run_job, tree_rss_mb
from tests.motion.factory import random_clip

HEAD = """
import os, sys, time
import numpy as np
from bench.adapters.base import Adapter
from bench.motion.clip import Clip

class Mine(Adapter):
    name = "mine"

    def transfer(self, content, style, *, rng):
        clip = content.clip
"""


def make_job(folder: Path, body: str) -> Job:
    """A job of six tasks for an adapter whose ``transfer`` has this body."""
    (folder / "mine.py").write_text(HEAD + "\n".join(f"        {line}" for line in body.splitlines()) + "\n")
    takes = [
        Take(random_clip(80, seed=i), f"{c}_{s}_{i}", "toy", c, s)
        for i in range(3)
        for c in ("walk", "run")
        for s in ("old", "angry")
    ]
    (folder / "pack").mkdir()
    write_pack(folder / "pack", takes)
    tasks = folder / "tasks.json"
    tasks.write_text(json.dumps([task.as_dict() for task in make_tasks(TaskPool(takes), 6, 0)]))
    return Job(
        AdapterSource("mine", str(folder / "mine.py")), "toy", str(folder / "pack"), str(folder / "store"), (), (), "",
        "smoke", 0, (GenerateJob("cell", str(tasks), "transfer", 30.0),),
    )  # fmt: skip


def outcome(folder: Path, body: str, limits: Limits | None = None) -> Outcome:
    job = make_job(folder, body)
    return run_job(job, folder / "logs", limits=limits or Limits(wall_s=60), listener=lambda *_: None)["cell"]


def test_good_adapter_leaves_motions(tmp_path: Path) -> None:
    assert outcome(tmp_path, "print('noise on stdout')\nreturn clip").status == "ok"
    store = Store(tmp_path / "store")
    motions = Motions.load(store.folder("motions", "cell"))
    assert motions.n == 6 and motions.digest == store.facts("motions", "cell")["motions_digest"]


@pytest.mark.parametrize(
    ("body", "status", "reason"),
    [
        ("raise ValueError('clip 317')", "failed", "ValueError: clip 317"),
        ("return None", "invalid", "s0000: type: expected a bench.motion.clip.Clip, got builtins.NoneType"),
        ("return Clip(clip.skeleton, clip.rotations_wxyz[:9], clip.root_xyz_m[:9], 30.0)", "invalid",
         "s0000: frames: expected 64 frames, got 9"),
        ("return Clip(clip.skeleton, clip.rotations_wxyz, clip.root_xyz_m, 60.0)", "invalid",
         "expected 30 fps, got 60 fps"),
        ("return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m * np.nan)", "invalid", "must be finite"),
        ("from bench.motion.skeleton import canonical_skeleton as c\n"
         "return Clip(c(clip.skeleton.offsets_m * 1.1), clip.rotations_wxyz, clip.root_xyz_m, 30.0)", "invalid",
         "expected the content's bones to 0.1 mm"),
        ("os.abort()", "failed", "the worker was killed by SIGABRT"),
        ("os._exit(3)", "failed", "exit code 3"),
    ],
)  # fmt: skip
def test_bad_adapter_has_its_own_status(tmp_path: Path, body: str, status: str, reason: str) -> None:
    found = outcome(tmp_path, body)
    assert found.status == status
    assert reason in found.reason
    assert (tmp_path / "logs" / found.log).is_file()
    assert not Store(tmp_path / "store").has("motions", "cell")


def test_hanging_adapter_is_stopped(tmp_path: Path) -> None:
    found = outcome(tmp_path, "time.sleep(600)", Limits(wall_s=4))
    assert (found.status, found.reason) == ("timeout", "no answer within 4 s")


def test_a_training_that_takes_too_long_says_what_to_do(tmp_path: Path) -> None:
    job = replace(make_job(tmp_path, "return clip"), fit_key="key")
    with (tmp_path / "mine.py").open("a") as file:
        file.write("\n    def fit(self, takes, *, seed, budget, progress):\n"
                   "        progress('learning', 1, 9)\n        time.sleep(600)\n")  # fmt: skip
    for wall_s in (6, 60, 300):  # on a busy machine the training may not have begun by then
        found = run_job(job, tmp_path / "logs", limits=Limits(wall_s=wall_s), listener=lambda *_: None)["cell"]
        assert found.status == "timeout"
        if "in training" in found.reason:
            break
    assert found.reason.startswith(f"no answer within {wall_s} s, in training; `stylebench fit` takes as long")


def test_adapter_that_grows_is_stopped(tmp_path: Path) -> None:
    body = "self.kept = np.ones((2000, 2**18))\ntime.sleep(600)"
    found = outcome(tmp_path, body, Limits(wall_s=60, rss_mb=1500))
    assert found.status == "oom"
    assert "the limit is 1500 MB" in found.reason


def test_job_survives_the_trip_through_json(tmp_path: Path) -> None:
    job = make_job(tmp_path, "return clip")
    path = tmp_path / "job.json"
    path.write_text(json.dumps(asdict(job)))
    assert Job.read(path) == job


def test_memory_of_a_process_is_seen_and_of_none_is_zero() -> None:
    assert tree_rss_mb(os.getpid()) > 10
    assert tree_rss_mb(2**22 - 1) == 0.0
