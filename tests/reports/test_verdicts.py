from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from reports.records import BadRecord, samples_path
from reports.render import render, text_frame
from reports.rows import load_run
from reports.tables import Table, TableRow, tables_of_run
from reports.verdicts import Verdict, is_one_of, sentences, verdict_of
from tests.reports.factory import ANCHORS, METHODS, FakeMethod, FakeTasks, make_row, write_row, write_run

TASKS = FakeTasks(n=400, n_clusters=80)
IDLE = FakeMethod("idle", "Idle", content_right=90.0, style_right=2.0, joint=1.0, copied_share=20.0)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    [found] = tables_of_run(write_run(tmp_path_factory.mktemp("run"), (*ANCHORS, *METHODS, IDLE), TASKS))
    return found


def names(rows: tuple[TableRow, ...]) -> set[str]:
    return {row.row.method.name for row in rows}


def test_each_ranked_method_gets_one_verdict(table: Table) -> None:
    verdict = verdict_of(table)
    assert names(verdict.transfers) >= {"park2021", "style_erd"}
    assert "mason2022" in names(verdict.like_a_trick)
    assert names(verdict.does_nothing) == {"idle"}
    assert names(verdict.copying_methods) == {"cheater"}
    ranked = [row for row in table.of("methods") if row.rank is not None]
    assert len(ranked) == len(verdict.transfers) + len(verdict.like_a_trick) + len(verdict.does_nothing)


def test_the_trick_neither_copies_nor_idles_nor_is_real(table: Table) -> None:
    trick = verdict_of(table).trick
    assert trick is not None and trick.row.method.name == "style-mean-shift"


def test_sentences_name_leaders_copiers_and_the_scale(table: Table) -> None:
    said = "\n".join(sentences(table, verdict_of(table)))
    assert "**Leads** on joint recognition (a tie" in said
    assert "**Only copy** (no rank, whatever they score): Cheater." in said
    assert "**Not separable from doing nothing:** Idle." in said
    assert "real data (" in said and "the best simple trick (style mean-shift)" in said


def verdict_with(folder: Path, *fakes: FakeMethod, primary: str = "") -> tuple[Table, Verdict]:
    """The verdict on a made-up table, with another column first where one is named."""
    [found] = tables_of_run(write_run(folder, fakes, TASKS))
    if primary:
        first = next(column for column in found.columns if column.metric == primary)
        found = replace(found, columns=(first, *found.columns))
    return found, verdict_of(found)


def test_without_a_row_that_does_nothing_nothing_is_called_better(tmp_path: Path) -> None:
    found, verdict = verdict_with(tmp_path, *ANCHORS[:3], METHODS[0])
    assert not (verdict.transfers or verdict.like_a_trick or verdict.does_nothing)
    assert names(verdict.leaders) == {"park2021"}
    said = "\n".join(sentences(found, verdict))
    assert "Not to be said from this table: no row that does nothing has a number here" in said


def test_where_doing_nothing_is_right_no_method_is_blamed(tmp_path: Path) -> None:
    copy_content = replace(ANCHORS[3], conditional_kid=0.0)
    assert copy_content.name == "copy-content"
    _, verdict = verdict_with(tmp_path, ANCHORS[1], copy_content, METHODS[0], primary="conditional_kid")
    assert not (verdict.transfers or verdict.like_a_trick or verdict.does_nothing)
    assert "doing nothing is a right answer here (copy content 0.00" in verdict.no_floor


def test_a_column_that_puts_copies_before_true_answers_says_nothing(tmp_path: Path) -> None:
    flattered = replace(ANCHORS[3], conditional_kid=0.005)
    _, verdict = verdict_with(tmp_path, ANCHORS[1], flattered, METHODS[0], primary="conditional_kid")
    assert verdict.no_floor.startswith("the column puts doing nothing before true answers (real disjoint 0.0")


def test_a_method_below_chance_is_not_better_than_nothing(tmp_path: Path) -> None:
    poor, fair = FakeMethod("poor", "Poor", joint=1.5), FakeMethod("fair", "Fair", joint=20.0)
    hopeless = FakeMethod("copy-content", "copy content", "anchor", joint=0.0)
    _, verdict = verdict_with(tmp_path, ANCHORS[1], hopeless, poor, fair)
    assert names(verdict.transfers) == {"fair"} and names(verdict.does_nothing) == {"poor"}


def test_many_do_nothing_rows_do_not_make_a_clear_difference_unclear(tmp_path: Path) -> None:
    """One method against twenty rows that do nothing: beating all of them is one claim, not twenty."""
    idle = [replace(ANCHORS[3], name=f"noise-{place}", title=f"noise {place}") for place in range(20)]
    _, verdict = verdict_with(tmp_path, ANCHORS[1], *idle, FakeMethod("fair", "Fair", joint=12.0))
    assert names(verdict.transfers) == {"fair"}


def test_methods_that_cannot_be_ranked_are_not_said_to_be_missing(table: Table) -> None:
    unranked = replace(table, rows=tuple(replace(row, rank=None) for row in table.rows))
    [first, *_] = sentences(unranked, verdict_of(unranked))
    assert first.startswith("Methods stand in order of joint recognition and carry no ranks")


def test_a_table_of_anchors_only_says_so(tmp_path: Path) -> None:
    [found] = tables_of_run(write_run(tmp_path, ANCHORS, FakeTasks(n=60, n_clusters=12)))
    assert sentences(found, verdict_of(found))[0].startswith("No method is in this table yet")


def test_a_table_without_any_number_still_prints(tmp_path: Path) -> None:
    [found] = tables_of_run(write_run(tmp_path, METHODS[-1:], FakeTasks(n=60, n_clusters=12)))
    assert sentences(found, verdict_of(found)) == ["No row of this table has finished."]
    assert "no answer within 60 s" in render(found, "md") and "timeout" in render(found, "csv")


def test_families_of_names() -> None:
    assert is_one_of("noise-0.1", ("noise",)) and is_one_of("real-test+park-ik", ("real-test",))
    assert not is_one_of("noisenet", ("noise",))


def test_every_row_says_its_n(table: Table) -> None:
    frame, _ = text_frame(table)
    assert set(frame["n"]) == {"320", "–"}


def test_profiles_and_datasets_are_tables_of_their_own(tmp_path: Path) -> None:
    small = FakeTasks(n=60, n_clusters=12)
    for dataset, profile in (("a@1", "quick"), ("a@1", "standard"), ("b@1", "quick")):
        write_row(tmp_path, *make_row(METHODS[0], small, dataset=dataset, profile=profile))
    assert [(t.key.dataset, t.key.profile) for t in tables_of_run(tmp_path)] == [
        ("a@1", "quick"),
        ("a@1", "standard"),
        ("b@1", "quick"),
    ]


def test_the_same_cell_twice_is_refused(tmp_path: Path) -> None:
    record, arrays = make_row(METHODS[0], FakeTasks(n=60, n_clusters=12))
    write_row(tmp_path / "one", record, arrays)
    write_row(tmp_path / "two", record.model_copy(update={"key": "other"}), arrays)
    with pytest.raises(BadRecord, match="is there twice"):
        tables_of_run(tmp_path)


def test_a_samples_file_that_is_no_archive_is_refused(tmp_path: Path) -> None:
    path = write_row(tmp_path, *make_row(METHODS[0], FakeTasks(n=60, n_clusters=12)))
    samples_path(path).write_bytes(b"PK\x03\x04 but not really")
    with pytest.raises(BadRecord, match="samples file cannot be read"):
        tables_of_run(tmp_path)


def test_a_json_file_that_is_no_record_is_named(tmp_path: Path) -> None:
    (tmp_path / "notes.json").write_text("{}")
    with pytest.raises(BadRecord, match=r"notes\.json: not a record"):
        load_run(tmp_path)


def test_plain_fmd_is_shown_to_prefer_rows_without_merit(tmp_path: Path) -> None:
    flattered = replace(ANCHORS[3], conditional_kid=0.001)
    assert flattered.name == "copy-content"
    [found] = tables_of_run(write_run(tmp_path, (ANCHORS[1], flattered), FakeTasks(n=60, n_clusters=12)))
    assert "these would beat real disjoint 1.03: copy content 1.00" in sentences(found, verdict_of(found))[-1]


def test_a_warning_of_a_whole_column_stands_at_its_header_once(tmp_path: Path) -> None:
    for fake in ANCHORS[:3]:
        record, arrays = make_row(fake, FakeTasks(n=60, n_clusters=12))
        warned = tuple(
            m.model_copy(update={"reason": "few windows"} if m.name == "cra" else {}) for m in record.measurements
        )
        write_row(tmp_path, record.model_copy(update={"measurements": warned}), arrays)
    [found] = tables_of_run(tmp_path)
    frame, notes = text_frame(found)
    [note] = [note for note in notes if note.endswith("few windows")]
    [header] = [name for name in frame.columns if name.startswith("CRA")]
    assert header == f"CRA, % ↑{note.split()[0]}"
    assert not frame[header].str.contains("[", regex=False).any()
