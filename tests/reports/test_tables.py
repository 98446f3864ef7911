from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from reports.aggregate import estimate, front, paired_difference, tie_groups, variance_split
from reports.figures import interval_bars, recognition_scatter, save_figure
from reports.leaderboard import check, render_leaderboard
from reports.records import BadRecord
from reports.render import render
from reports.rows import Row, check_comparable, load_run, rows_of
from reports.significance import holm, leader_ranks, pareto_front, replicate_difference
from reports.tables import Table, tables_of_run
from tests.reports.factory import ANCHORS, METHODS, FakeMethod, FakeTasks, make_row, write_row, write_run

PRIMARY = ("joint_recognition", "different_content")
EVIL = FakeMethod("evil", "<script>alert('x')</script> | a_b & 50% #1", trained_on="fit part")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_run(tmp_path_factory.mktemp("run"), (*ANCHORS, *METHODS, EVIL), FakeTasks(n=200, n_clusters=40))


@pytest.fixture(scope="module")
def table(folder: Path) -> Table:
    [found] = tables_of_run(folder)
    return found


def rows(folder: Path) -> dict[str, Row]:
    return {row.method.name: row for row in rows_of(load_run(folder))}


def test_methods_are_ranked_best_first_and_anchors_are_not(table: Table) -> None:
    methods = table.of("methods")
    assert [row.row.method.name for row in methods][:2] in (["park2021", "style_erd"], ["style_erd", "park2021"])
    assert methods[0].rank == methods[1].rank == 1
    assert all(row.rank is None for row in table.of("anchors"))


def test_a_row_that_copies_stands_among_the_anchors(table: Table) -> None:
    [cheater] = [row for row in table.rows if row.row.method.name == "cheater"]
    assert cheater.section == "anchors" and cheater.rank is None
    assert any("copies" in mark for mark in cheater.marks)


def test_a_row_that_failed_is_shown_with_its_reason(table: Table) -> None:
    [broken] = table.of("unfinished")
    assert broken.row.method.name == "broken"
    assert "no answer within 60 s for task 17" in render(table, "text")


def test_a_method_trained_longer_stands_beside_itself(tmp_path: Path) -> None:
    usual = replace(METHODS[0], joint=30.0)
    longer = replace(usual, joint=80.0, trained_on="fit part, budget paper")
    write_run(tmp_path, (*ANCHORS, usual, longer), FakeTasks(n=200, n_clusters=40))
    [table] = tables_of_run(tmp_path)
    best, other = table.of("methods")
    assert (best.row.method.row_name, best.title) == (f"{usual.name}@paper", f"{usual.title} (paper budget)")
    assert (other.row.method.row_name, other.title) == (usual.name, usual.title)
    assert (best.rank, other.rank) == (1, 2)
    assert best.row.method.budget == "paper" and other.row.method.budget == "small"


def test_a_row_says_how_many_seeds_it_is_the_mean_of(tmp_path: Path) -> None:
    write_run(tmp_path, METHODS[:1], FakeTasks(n=60, n_clusters=12), seeds=(0, 1))
    [table] = tables_of_run(tmp_path)
    assert "2 seeds" in table.rows[0].marks
    page = render_leaderboard(tmp_path)
    assert re.search(r"\| method +\| joint recognition, % ↑ +\| seeds +\|", page)
    assert re.search(r"\| 1 +\| Park 2021 +\| [0-9.]+ +\| 2 +\|", page)
    assert all(record.key in page for record, _ in load_run(tmp_path))


def test_only_a_row_that_was_trained_here_has_a_budget() -> None:
    record, _ = make_row(FakeMethod("theirs", "Theirs", trained_on="their data, budget paper"), FakeTasks())
    assert record.method.budget == "" and record.method.row_name == "theirs"


def test_estimate_of_one_seed_is_the_measurement_and_of_two_their_mean(tmp_path: Path) -> None:
    write_run(tmp_path, METHODS[:1], FakeTasks(n=200, n_clusters=40), seeds=(0, 1))
    [row] = rows_of(load_run(tmp_path))
    found = estimate(row, *PRIMARY)
    values = [measurement.value for measurement in row.measurements(*PRIMARY)]
    assert found is not None and found.seeds == 2 and None not in values
    assert found.value == pytest.approx(np.mean([value for value in values if value is not None]))
    assert found.low is not None and found.high is not None and found.low < (found.value or 0) < found.high
    split = variance_split(row, *PRIMARY)
    assert split.method_seed is not None and split.task_sampling is not None and split.judge_seed is not None


def test_difference_of_a_row_with_itself_is_nothing(folder: Path) -> None:
    row = rows(folder)["park2021"]
    found = paired_difference(row, row, *PRIMARY)
    assert found is not None and (found.value, found.low, found.high, found.p) == (0.0, 0.0, 0.0, 1.0)


def test_difference_changes_sign_with_the_order(folder: Path) -> None:
    by_name = rows(folder)
    one, other = by_name["park2021"], by_name["mason2022"]
    forth, back = paired_difference(one, other, *PRIMARY), paired_difference(other, one, *PRIMARY)
    assert forth is not None and back is not None
    assert forth.value == pytest.approx(-back.value) and forth.value > 20 and forth.p < 1e-3
    assert forth.low < forth.value < forth.high


def test_difference_of_rows_on_other_samples_is_refused(tmp_path: Path) -> None:
    first = FakeTasks(n=100, n_clusters=20)
    second = FakeTasks(n=100, n_clusters=20, seed=8)
    write_row(tmp_path, *make_row(METHODS[0], first))
    write_row(tmp_path, *make_row(METHODS[1], second))
    one, other = rows(tmp_path).values()
    with pytest.raises(BadRecord, match="were not scored on the same samples"):
        paired_difference(one, other, *PRIMARY)


def test_ties_are_groups_around_leaders(folder: Path) -> None:
    ranks = tie_groups(list(rows(folder).values()), *PRIMARY)
    assert ranks["park2021"] == ranks["style_erd"] == 1
    assert 1 < ranks["motion_puzzle"] <= ranks["mason2022"]
    assert "cheater" not in ranks and "broken" not in ranks and "label-oracle" not in ranks


def test_holm_by_hand() -> None:
    np.testing.assert_allclose(holm([0.01, 0.04, 0.03]), [0.03, 0.06, 0.06])
    assert holm([]).size == 0
    with pytest.raises(ValueError, match="must lie in"):
        holm([1.2])


def test_leader_ranks_by_hand() -> None:
    apart = np.array([[False, False, True], [False, False, False], [True, False, False]])
    assert leader_ranks(apart) == [1, 1, 3]


def test_pareto_front_by_hand_and_nan_never_leads(folder: Path) -> None:
    points = np.array([[1.0, 0.0], [0.0, 1.0], [0.5, 0.4], [0.2, 0.2], [np.nan, 9.0]])
    np.testing.assert_array_equal(pareto_front(points), [True, True, True, False, False])
    names = front(list(rows(folder).values()), ("cra", "sra"), "different_content")
    assert "copy-content" in names and "mean-pose" not in names


@pytest.mark.parametrize(
    ("a", "b", "freedom", "message"),
    [
        (np.zeros(3), np.zeros(4), 5, "paired replicates must be"),
        (np.zeros(3), np.zeros(3), 0, "at least 2 clusters"),
        (np.full(3, np.nan), np.zeros(3), 5, "are finite"),
    ],
)
def test_differences_refuse_what_is_not_paired(a: np.ndarray, b: np.ndarray, freedom: int, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        replicate_difference(0.0, 0.0, a, b, freedom)


@pytest.mark.parametrize(("field", "value"), [("protocol_version", 2), ("dataset_digest", "other"), ("judges", ())])
def test_records_that_do_not_belong_together_are_refused(tmp_path: Path, field: str, value: object) -> None:
    tasks = FakeTasks(n=40, n_clusters=10)
    record, arrays = make_row(METHODS[0], tasks)
    other, other_arrays = make_row(METHODS[1], tasks)
    if field == "judges":
        value = (other.judges[0].model_copy(update={"digest": "other"}), *other.judges[1:])
    write_row(tmp_path, record, arrays)
    write_row(tmp_path, other.model_copy(update={field: value}), other_arrays)
    with pytest.raises(BadRecord):
        check_comparable(load_run(tmp_path))


@pytest.mark.parametrize("form", ["text", "md", "csv", "latex", "html"])
def test_every_form_names_every_row(table: Table, form: str) -> None:
    text = render(table, form)  # type: ignore[arg-type]
    assert "Park 2021" in text and "label oracle" in text


def test_names_are_escaped(table: Table) -> None:
    assert "<script>" not in render(table, "html")
    assert "<script>" not in render(table, "md") and "\\|" in render(table, "md")
    latex = render(table, "latex")
    assert r"a\_b \& 50\% \#1" in latex and latex.count("{") == latex.count("}")


def test_undefined_cells_have_a_footnote(table: Table) -> None:
    text = render(table, "md", "details")
    assert "–" in text and "output does not move" in text


def test_leaderboard_is_the_same_bytes_and_notices_a_changed_digit(folder: Path, tmp_path: Path) -> None:
    page = render_leaderboard(folder)
    assert page == render_leaderboard(folder)
    assert "Park 2021" in page and "stgcn-content" in page and "Kobayashi" in page
    path = tmp_path / "leaderboard.md"
    path.write_text(page)
    assert check(path, folder) == ""
    path.write_text(page.replace("Park 2021", "Park 2022"))
    assert "Park 2022" in check(path, folder)
    assert "missing" in check(tmp_path / "none.md", folder)


def test_the_first_screen_says_who_transfers_who_copies_and_what_it_costs(folder: Path) -> None:
    page = render_leaderboard(folder)
    head = page[: page.index("## At a glance")]
    [line] = [line for line in head.splitlines() if line.startswith("| transfer, bandai-namco")]
    cells = [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]]
    assert "Park 2021" in cells[1] and "%" in cells[1]
    assert "Cheater" in cells[4] and "copy content" in cells[4]
    assert "parameters" in cells[5] and "budget small" in cells[5] and "run" in cells[5]
    order = ["## Who transfers style", "## How to read the tables", "## How to reproduce", "## How to submit"]
    assert [page.index(title) for title in order] == sorted(page.index(title) for title in order)


def test_local_judges_never_enter_the_leaderboard(tmp_path: Path) -> None:
    tasks = FakeTasks(n=40, n_clusters=10)
    for fake in (*ANCHORS[:3], METHODS[0]):
        write_row(tmp_path, *make_row(fake, tasks))
    record, arrays = make_row(replace(METHODS[1], name="homemade", title="Homemade"), tasks, dataset="mine")
    local = tuple(judge.model_copy(update={"origin": "local"}) for judge in record.judges)
    write_row(tmp_path, record.model_copy(update={"judges": local}), arrays)
    page = render_leaderboard(tmp_path)
    assert "Park 2021" in page
    assert not any("Homemade" in line and line.startswith("|") for line in page.splitlines())


def test_empty_or_missing_folders_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadRecord):
        load_run(tmp_path / "none")


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_figures_are_written(table: Table, tmp_path: Path, suffix: str) -> None:
    for name, figure in (("scatter", recognition_scatter(table)), ("bars", interval_bars(table))):
        path = tmp_path / f"{name}.{suffix}"
        save_figure(figure, path)
        assert path.stat().st_size > 5000
