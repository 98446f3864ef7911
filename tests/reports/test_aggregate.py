from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reports.aggregate import badness, estimate, paired_difference, ranked_order, tie_groups, variance_split
from reports.records import BadRecord, digest_of_arrays
from reports.rows import Row, check_comparable, load_run, rows_of
from reports.significance import mean_and_sd
from tests.reports.factory import ANCHORS, METHODS, FakeMethod, FakeTasks, make_row, write_row, write_run

TASKS = FakeTasks(n=200, n_clusters=40)
PRIMARY = ("joint_recognition", "different_content")


def rows_in(folder: Path) -> dict[str, Row]:
    return {row.method.name: row for row in rows_of(load_run(folder))}


@pytest.mark.parametrize(
    ("field", "value", "what"),
    [
        ("protocol_version", 2, "version of protocol stylebench-transfer differs: stylebench-transfer@1 in"),
        ("dataset_digest", "other", "digest of dataset bandai-namco@1 differs:"),
        ("judges", None, "digest of judge stgcn-content/0 differs:"),
        ("measurements", None, "version of metric joint_recognition differs: 1 in"),
    ],
)
def test_what_differs_is_named_with_both_files(tmp_path: Path, field: str, value: object, what: str) -> None:
    record, arrays = make_row(METHODS[0], TASKS)
    other, other_arrays = make_row(METHODS[1], TASKS)
    if field == "judges":
        value = (other.judges[0].model_copy(update={"digest": "other"}), *other.judges[1:])
    if field == "measurements":
        value = (other.measurements[0].model_copy(update={"version": 9}), *other.measurements[1:])
    paths = [
        write_row(tmp_path, record, arrays),
        write_row(tmp_path, other.model_copy(update={field: value}), other_arrays),
    ]
    pattern = f"{re.escape(what)}.*{re.escape(paths[0].name)}.*{re.escape(paths[1].name)}"
    with pytest.raises(BadRecord, match=pattern):
        check_comparable(load_run(tmp_path))


def test_local_and_canonical_judges_never_share_a_table(tmp_path: Path) -> None:
    record, arrays = make_row(METHODS[0], TASKS)
    other, other_arrays = make_row(METHODS[1], TASKS)
    local = tuple(judge.model_copy(update={"origin": "local"}) for judge in other.judges)
    write_row(tmp_path, record, arrays)
    write_row(tmp_path, other.model_copy(update={"judges": local}), other_arrays)
    with pytest.raises(BadRecord, match=r"\(canonical\).*\(local\)"):
        check_comparable(load_run(tmp_path))


def test_only_finished_methods_that_do_not_copy_are_ranked(tmp_path: Path) -> None:
    folder = write_run(tmp_path, (*ANCHORS, *METHODS), TASKS)
    rows = rows_of(load_run(folder))
    ranks = tie_groups(rows, *PRIMARY)
    assert set(ranks) == {"park2021", "style_erd", "motion_puzzle", "mason2022"}
    assert [row.method.name for row in ranked_order(rows, *PRIMARY)] == sorted(
        ranks, key=lambda name: badness(rows_in(folder)[name], *PRIMARY)
    )


def test_a_method_without_replicates_carries_no_rank(tmp_path: Path) -> None:
    folder = write_run(tmp_path, METHODS[:2], TASKS)
    assert tie_groups(rows_of(load_run(folder)), "cra", "different_content") == {}
    rows = rows_in(folder)
    assert paired_difference(rows["park2021"], rows["style_erd"], "cra", "different_content") is None


def test_ranks_of_a_lower_is_better_metric_start_at_its_lowest(tmp_path: Path) -> None:
    for fake, kid in ((METHODS[0], 0.9), (METHODS[1], 0.2)):
        record, arrays = make_row(replace(fake, conditional_kid=kid), TASKS)
        draws = kid + 0.01 * np.random.default_rng(0).standard_normal(TASKS.n_replicates)
        arrays["replicates/conditional_kid|different_content"] = draws

        write_row(tmp_path, record.model_copy(update={"samples_digest": digest_of_arrays(arrays)}), arrays)
    ranks = tie_groups(rows_of(load_run(tmp_path)), "conditional_kid", "different_content")
    assert ranks == {"style_erd": 1, "park2021": 2}


def test_percentages_do_not_leave_their_range(tmp_path: Path) -> None:
    folder = write_run(tmp_path, [FakeMethod("low", "Low", joint=0.6), FakeMethod("high", "High", joint=99.6)], TASKS)
    for row in rows_in(folder).values():
        found = estimate(row, *PRIMARY)
        assert found is not None and found.low is not None and found.high is not None
        assert 0.0 <= found.low <= found.high <= 100.0


def test_variance_is_split_by_its_three_sources(tmp_path: Path) -> None:
    folder = write_run(tmp_path, METHODS[:1], TASKS, seeds=(0, 1, 2))
    row = rows_in(folder)["park2021"]
    split = variance_split(row, *PRIMARY)
    found = estimate(row, *PRIMARY)
    assert found is not None and found.seeds == 3
    assert split.method_seed == found.seed_sd == mean_and_sd([m.value or 0.0 for m in row.measurements(*PRIMARY)])[1]
    assert split.judge_seed is not None and split.judge_seed < 5.0
    # About sqrt(p (1 - p) / n) times the design effect of clusters.
    assert split.task_sampling is not None and 2.0 < split.task_sampling < 8.0
    assert variance_split(row, "nothing", "all").task_sampling is None


def test_a_missing_seed_is_said_beside_the_mean_of_the_others(tmp_path: Path) -> None:
    write_row(tmp_path, *make_row(METHODS[0], TASKS))
    failed = replace(METHODS[0], status="oom", reason="killed at 8 GB")
    write_row(tmp_path, *make_row(failed, TASKS, seed=1))
    row = rows_in(tmp_path)["park2021"]
    assert row.status == "ok" and row.can_rank
    assert row.reason == "1 of 2 cells left out: oom: killed at 8 GB"


def test_replicates_in_another_unit_than_the_value_are_refused(tmp_path: Path) -> None:

    record, arrays = make_row(METHODS[0], TASKS)
    arrays["replicates/joint_recognition|different_content"] /= 100.0
    write_row(tmp_path, record.model_copy(update={"samples_digest": digest_of_arrays(arrays)}), arrays)
    with pytest.raises(BadRecord, match="shares up to 1, but the record's value is in percent"):
        tie_groups(rows_of(load_run(tmp_path)), *PRIMARY)
