from __future__ import annotations

import io
from pathlib import Path

import pandas as pd
import pytest

from reports.records import Record
from reports.render import anchor_table, floor_cells, number_frame, render, sections, text_frame
from reports.tables import Table, tables_of_run
from tests.reports.factory import ANCHORS, LEFT_OUT, METHODS, FakeMethod, FakeTasks, make_row, write_row, write_run

TASKS = FakeTasks(n=200, n_clusters=40)
EVIL = FakeMethod("evil", "<script>alert('x')</script> | a_b & 50% $1 {x}\n~^", trained_on="fit part")
FAR = FakeMethod("far", "Far", conditional_kid=40.0, joint=5.0)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    [found] = tables_of_run(write_run(tmp_path_factory.mktemp("run"), (*ANCHORS, *METHODS, EVIL, FAR), TASKS))
    return found


def without(record: Record, metric: str, reason: str) -> Record:
    """The record with that metric undefined."""
    changed = tuple(
        m.model_copy(update={"value": None, "low": None, "high": None, "reason": reason}) if m.name == metric else m
        for m in record.measurements
    )
    return record.model_copy(update={"measurements": changed})


def test_text_fits_a_wide_terminal_and_its_columns_stand_below_each_other(table: Table) -> None:
    text = render(table, "text")
    grid = text.split("\n\nNot finished")[0]
    assert max(map(len, grid.splitlines())) <= 200
    lines = {
        line.split("  ")[1 if line[:6].strip() else 0]: line for line in grid.splitlines() if line.endswith("copies")
    }
    assert len({line.index("  copies") for line in lines.values()}) == 1


def test_text_explains_what_a_reader_meets(table: Table) -> None:
    text = render(table, "text")
    assert text.count("returns the source (from test)") == 1
    assert "Judges (canonical): stgcn-content (3 seeds" in text and "commonest class" in text
    assert "Broken | [net]_1  timeout: no answer within 60 s for task 17 (logs/broken.log)" in text
    assert "What the anchor rows are" not in render(table, "text", "details")


def test_a_warning_of_a_whole_column_stands_at_its_header_once(table: Table) -> None:
    frame, notes = text_frame(table)
    [header] = [name for name in frame.columns if name.startswith("conditional KID")]
    assert header.endswith("[a]") and notes[0] == f"[a] {LEFT_OUT}"
    assert not frame[header].str.contains("[a]", regex=False).any()


def test_undefined_cells_share_a_footnote_for_one_reason(table: Table) -> None:
    frame, notes = text_frame(table, "details")
    cells = frame.set_index("row")["source style left, % ↓"]
    assert cells["label oracle"] == cells["real test"] == "–[a]" and cells["copy style"] != "–[a]"
    assert notes[0].startswith("[a] scored under its source's own style")
    assert any("output does not move" in note for note in notes)


def test_frechet_undefined_in_one_row_only(tmp_path: Path) -> None:
    for fake in METHODS[:2]:
        record, arrays = make_row(fake, TASKS)
        few = without(record, "fmd[dae]", "n = 50 is below 2 d = 64") if fake is METHODS[0] else record
        write_row(tmp_path, few, arrays)
    [found] = tables_of_run(tmp_path)
    text = render(found, "text", "details")
    assert "–[" in text and text.count("n = 50 is below 2 d = 64") == 1


def test_floor_is_the_last_line_of_the_anchors(table: Table) -> None:
    found, _ = sections(table)
    assert [section for section, _ in found] == ["methods", "anchors", "unfinished"]
    assert found[1][1]["row"].iloc[-1].startswith("floor")
    floors = floor_cells(table)
    assert floors is not None and "0.0110" in floors


def test_csv_holds_unrounded_numbers_of_all_columns(table: Table) -> None:
    read = pd.read_csv(io.StringIO(render(table, "csv"))).set_index("method")
    estimate = {row.row.method.name: row for row in table.rows}["park2021"].estimates["fmd[dae]|all"]
    assert read.loc["park2021", "fmd[dae]|all"] == estimate.value
    assert read.loc["broken", "status"] == "timeout" and bool(read["rank"].isna()["broken"])
    assert len(number_frame(table)) == len(table.rows) == len(read)


def test_html_escapes_names_and_names_each_section(table: Table) -> None:
    html = render(table, "html")
    assert "<script>" not in html and "&lt;script&gt;" in html
    assert html.count("<tr>") + html.count('<tr class="section">') == html.count("</tr>")
    assert "<caption>transfer" in html and "no answer within 60 s" in html


def test_markdown_tables_keep_their_number_of_cells(table: Table) -> None:
    for part in ("main", "details"):
        lines = [line for line in render(table, "md", part).splitlines() if line.startswith("|")]
        widths = {line.replace(r"\|", "").count("|") for line in lines}
        assert len(widths) <= 3
    assert r"\<script\>" in render(table, "md") and "<script>" not in render(table, "md")


def test_latex_is_balanced_and_every_line_has_all_cells(table: Table) -> None:
    latex = render(table, "latex")
    bare = latex.replace(r"\{", "").replace(r"\}", "")
    assert bare.count("{") == bare.count("}")
    for name in ("tabular", "flushleft"):
        assert latex.count(f"\\begin{{{name}}}") == latex.count(f"\\end{{{name}}}") == 1
    rows = [line for line in latex.splitlines() if " & " in line]
    n_columns = len(text_frame(table)[0].columns)
    assert {line.replace(r"\&", "").count(" & ") for line in rows} == {n_columns - 1}
    assert r"\textless{}script\textgreater{}" in latex and r"50\% \$1 \{x\}" in latex


def test_anchor_table_is_empty_without_anchors(table: Table, tmp_path: Path) -> None:
    assert anchor_table([table, table]).count("\n") == len(ANCHORS) + 1
    assert anchor_table(tables_of_run(write_run(tmp_path, METHODS[:1], FakeTasks(n=60, n_clusters=12)))) == ""
