"""Which replicates a number gets: drawn anew within contents, or those of the samples files."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from reports.aggregate import estimate, paired_difference
from reports.draws import Draws, draws_of, paired_draws
from reports.records import digest_of_arrays
from reports.rows import Row, load_run, rows_of
from tests.reports.factory import METHODS, FakeTasks, make_row, write_row

TASKS = FakeTasks(n=200, n_clusters=40)
PRIMARY = ("joint_recognition", "different_content")


def row_with(folder: Path, *, contents: bool = True, shift: float = 0.0) -> Row:
    """A row all of whose variance lies between two contents of 20 takes each."""
    record, arrays = make_row(METHODS[0], TASKS)
    easy = np.isin(TASKS.cluster, np.unique(TASKS.cluster)[:20])
    if contents:
        arrays |= {f"slice/content={name}": mask & TASKS.different for name, mask in (("easy", easy), ("hard", ~easy))}
    values = np.where(easy, 90.0, 10.0)
    arrays["per_sample/joint_recognition"] = values.astype(np.float32)
    measurements = tuple(
        m.model_copy(update={"value": float(values[TASKS.inside(m.slice)].mean()) + shift})
        if m.name == PRIMARY[0]
        else m
        for m in record.measurements
    )
    digest = digest_of_arrays(arrays)
    write_row(folder, record.model_copy(update={"samples_digest": digest, "measurements": measurements}), arrays)
    [row] = rows_of(load_run(folder))
    return row


def found(row: Row, metric: str = PRIMARY[0], slice_name: str = PRIMARY[1]) -> Draws:
    draws = draws_of(row, metric, slice_name)
    assert draws is not None
    return draws


def test_takes_are_drawn_within_contents(tmp_path: Path) -> None:
    draws = found(row_with(tmp_path))
    assert draws.replicates.shape == (1000,) and np.ptp(draws.replicates) == pytest.approx(0.0, abs=1e-9)
    assert draws.stored.shape == (200,) and draws.stored.std() > 1.0
    seen = estimate(row_with(tmp_path), *PRIMARY)
    assert seen is not None and seen.low == pytest.approx(seen.value) == pytest.approx(seen.high)


def test_same_content_samples_have_the_content_of_their_take(tmp_path: Path) -> None:
    row = row_with(tmp_path)
    draws = found(row, slice_name="all")
    assert draws.values is not None and draws.values.shape == (200,)
    assert np.ptp(draws.replicates) == pytest.approx(0.0, abs=1e-9) and draws.degrees_of_freedom == 38.0


def test_without_contents_all_takes_are_alike(tmp_path: Path) -> None:
    draws = found(row_with(tmp_path, contents=False))
    assert draws.replicates.shape == (1000,) and draws.replicates.std() > 1.0


def test_a_number_that_is_no_mean_keeps_its_stored_replicates(tmp_path: Path) -> None:
    draws = found(row_with(tmp_path, shift=1.0))
    assert draws.values is None and draws.replicates is draws.stored
    assert draws_of(row_with(tmp_path), "conditional_kid", "different_content") is None


def test_a_pair_is_drawn_in_one_way(tmp_path: Path) -> None:
    anew, kept = found(row_with(tmp_path / "a")), found(row_with(tmp_path / "b", shift=1.0))
    assert paired_draws(anew, anew)[0].shape == (1000,)
    first, second, freedom = paired_draws(anew, kept)
    assert first is anew.stored and second is kept.stored and freedom == anew.n_clusters - 1.0
    difference = paired_difference(row_with(tmp_path / "a"), row_with(tmp_path / "b", shift=1.0), *PRIMARY)
    assert difference is not None and difference.value == pytest.approx(-1.0)
