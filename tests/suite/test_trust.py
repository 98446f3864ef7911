"""Sessions, curves and refusals of what ``stylebench trust`` measures; the whole of it is in test_acceptance."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.errors import BadConfig, JudgeRefused
from bench.suite.trust import measure
from bench.suite.trust_curves import curve
from bench.suite.trust_rows import judged_measurements, session_facts, sessions_of
from reports.rows import load_run
from tests.suite.tiny import tiny_dataset, tiny_tables


def test_sessions_worked_by_hand() -> None:
    # styles 0 and 1 are of one session, style 2 of another
    sessions = np.array([0, 0, 1])
    probabilities = np.array([[[0.2, 0.3, 0.5], [0.5, 0.3, 0.2], [0.1, 0.1, 0.8], [0.5, 0.4, 0.1]]])
    wanted = np.array([1, 1, 2, 2])
    facts = session_facts(np.log(probabilities).astype(np.float32), wanted, sessions)
    # likeliest of the wanted session: 1, 0, 2, 2; likeliest of all: 2, 0, 2, 0
    assert facts.within == 75.0 and facts.session_right == 50.0
    assert facts.chance == pytest.approx(100.0 * (0.5 + 0.5 + 1.0 + 1.0) / 4)


def test_sessions_are_known_only_if_every_take_names_one() -> None:
    takes = tiny_dataset().takes
    assert sessions_of(takes) == {}
    named = [replace(take, session="a" if take.style == "bent" else "b") for take in takes]
    assert sessions_of(named) == {"a": ("bent",), "b": ("plain",)}


def test_a_frechet_distance_falls_with_n_and_a_kernel_distance_does_not() -> None:
    rng = np.random.default_rng(0)
    real, generated = (rng.normal(size=(2, n, 8)).astype(np.float32) for n in (500, 400))
    frechet, kernel, again = (
        curve("floor", "floor", metric, real, generated, draws=5)
        for metric in ("fmd[stgcn-content]", "kid[stgcn-content]", "fmd[stgcn-content]")
    )
    assert frechet == again and frechet.n == kernel.n == (100, 150, 200, 300, 400)
    assert frechet.mean[0] > 2.0 * frechet.mean[-1] and frechet.sd[0] > 0.0 and frechet.sd[-1] < 1e-9
    assert max(map(abs, kernel.mean)) < 0.05


def test_ranked_slice_is_compared_where_there_is_one(undisturbed: Path) -> None:
    record = load_run(undisturbed / "out")[0].record
    # one judge seed: nothing to compare between seeds
    assert judged_measurements(record) == {}


def test_runs_that_cannot_be_measured_are_refused(undisturbed: Path, tmp_path: Path) -> None:
    (tmp_path / "records").mkdir()
    with pytest.raises(BadConfig, match="no finished record of stylebench-transfer@1"):
        measure([tmp_path], {"procedural": None}, tmp_path / "store", lambda *_: None)
    with pytest.raises(BadConfig, match="there are records of tiny, but not the dataset"):
        measure([undisturbed / "out"], {"procedural": None}, tmp_path / "store", lambda *_: None)
    with tiny_tables(), pytest.raises(JudgeRefused, match="there is no second judge family"):
        measure([undisturbed / "out"], {"tiny": None}, undisturbed / "store", lambda *_: None)
