"""A run with several seeds: who is trained is trained with each, and all of its records make one row."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest

from reports.rows import load_run, rows_of
from reports.tables import tables_of_run
from tests.suite.tiny import tiny_run

pytestmark = pytest.mark.slow

LEARNER = """
import numpy as np
from bench.adapters.base import Adapter

class Learner(Adapter):
    name = "learner"

    def fit(self, takes, *, seed, budget, progress=None):
        self.seed = seed

    def save(self, folder):
        (folder / "seed").write_text(str(self.seed))

    def load(self, folder):
        self.seed = int((folder / "seed").read_text())

    def transfer(self, content, style, *, rng):
        clip = content.clip
        return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + np.array([0.0, 0.05 * self.seed, 0.0]))
"""


def test_a_trained_method_has_one_row_of_all_seeds_and_the_others_run_once(undisturbed: Path, tmp_path: Path) -> None:
    shutil.copytree(undisturbed / "store", tmp_path / "store")
    (tmp_path / "learner.py").write_text(LEARNER)
    result = tiny_run(
        tmp_path / "out",
        tmp_path / "store",
        methods=("copy-content", "mean-pose"),
        adapter_files=(str(tmp_path / "learner.py"),),
        seeds=(3, 5),
    )
    found = {(record.method.name, record.seed, record.status) for record in result.records}
    assert found == {
        ("copy-content", 3, "ok"),
        ("mean-pose", 3, "ok"),
        ("learner", 3, "ok"),
        ("learner", 5, "ok"),
    }
    [table] = tables_of_run(tmp_path / "out")
    assert [shown.row.method.name for shown in table.rows].count("learner") == 1
    rows = {row.method.name: row for row in rows_of(load_run(tmp_path / "out"))}
    assert {name: len(row.ok) for name, row in rows.items()} == {"copy-content": 1, "mean-pose": 1, "learner": 2}
    digests = {record.motions_digest for record in rows["learner"].ok}
    assert len(digests) == 2
