"""Papers' tables from records: every cell is a number or a reason, and nothing is called best that is not separable."""

from __future__ import annotations

import csv
import io
import shutil
import subprocess
from pathlib import Path

import pytest

from bench.adapters import ADAPTERS
from bench.errors import BadConfig
from bench.protocols import PROTOCOLS
from bench.suite.paper_tables import explain, paper_table_ids, paper_tables, protocol_of
from reports.paper_table import FORMS, PaperForm, PaperTable, render_paper_table
from reports.records import digest_of_arrays
from reports.rows import StoredRecord, load_run
from tests.reports.factory import FakeMethod, FakeTasks, make_row, write_row

TABLES = paper_table_ids()
NOT_MEASURED = {"kuriyama2022.table5", "kuriyama2022.table6", "kuriyama2022.table7", "mason2022.table1",
                "style_erd.user_study"}  # fmt: skip
PAGE = r"""\documentclass{article}
\usepackage[landscape,margin=1cm]{geometry}\usepackage[T1]{fontenc}\usepackage{booktabs}
\begin{document}\tiny
%s
\end{document}
"""


@pytest.fixture(scope="module")
def published() -> tuple[StoredRecord, ...]:
    return load_run(Path(__file__).parents[2] / "reports" / "published")


@pytest.mark.parametrize("table_id", TABLES)
def test_every_cell_is_a_number_or_a_reason(table_id: str, published: tuple[StoredRecord, ...]) -> None:
    for table in (*paper_tables(table_id, published), *paper_tables(table_id, ())):
        assert table.columns or table_id == "mason2022.fig10"
        for row in table.rows:
            assert set(row.cells) == {column.name for column in table.columns}
            for cell in row.cells.values():
                assert (cell.ours is not None and (cell.ours.value is not None or cell.ours.reason)) or cell.gap
                assert cell.comparable or cell.why or not cell.printed


@pytest.mark.parametrize("table_id", TABLES)
def test_what_is_measured_has_a_protocol_and_methods_of_ours(table_id: str) -> None:
    assert (protocol_of(table_id) == "") == (table_id in NOT_MEASURED)
    if table_id not in NOT_MEASURED:
        assert protocol_of(table_id) in PROTOCOLS
        [table] = paper_tables(table_id, ())
        assert all(row.method in ADAPTERS for row in table.rows if row.printed)


@pytest.mark.parametrize("form", FORMS)
def test_all_forms_show_what_is_printed(form: PaperForm) -> None:
    [table] = paper_tables("park2021.table2", ())
    text = render_paper_table(table, form)
    assert "42.81" in text and "Aberman" in text
    assert "evaluator, its weights and the split unpublished" in text
    assert "stylebench run --protocols" in text


def test_csv_has_a_line_a_cell() -> None:
    [table] = paper_tables("park2021.table2", ())
    lines = list(csv.DictReader(io.StringIO(render_paper_table(table, "csv"))))
    assert len(lines) == len(table.rows) * len(table.columns) == 6
    assert lines[1]["quantity"] == "CRA" and float(lines[1]["published_in_our_unit"]) == 60.86
    assert lines[1]["ours"] == "" and lines[1]["comparable"] == "False"


def test_an_unknown_table_names_the_known_ones() -> None:
    with pytest.raises(BadConfig, match=r"park2021\.table2"):
        paper_tables("park2021.table9", ())


def stored_table(folder: Path, shares: dict[str, float]) -> PaperTable:
    """Park's Table 2 from made-up records of its protocol, in which CRA is what the factory makes.

    Names of ``shares`` are those of rows: ``park2021``, or ``park2021@paper`` for another budget.
    """
    for row_name, share in shares.items():
        name, _, budget = row_name.partition("@")
        trained_on = f"fit part, budget {budget or 'small'}"
        record, arrays = make_row(FakeMethod(name, name, joint=share, trained_on=trained_on), FakeTasks())
        joint = record.find("joint_recognition")
        assert joint is not None
        renamed = {key.replace("joint_recognition", "cra"): values for key, values in arrays.items()}
        facts = {
            "protocol": "park2021",
            "condition": "table2",
            "measurements": (joint.model_copy(update={"name": "cra"}),),
        }
        write_row(folder, record.model_copy(update={**facts, "samples_digest": digest_of_arrays(renamed)}), renamed)
    [table] = paper_tables("park2021.table2", load_run(folder))
    return table


def test_numbers_stand_beside_each_other_and_only_a_separable_one_is_best(tmp_path: Path) -> None:
    table = stored_table(tmp_path, {"park2021": 60.0, "aberman2020": 30.0, "holden2016": 30.0})
    cells = {row.method: row.cells["CRA"] for row in table.rows}
    ours = cells["park2021"].ours
    assert ours is not None and ours.value == pytest.approx(60.0, abs=8.0)
    assert cells["park2021"].difference == pytest.approx((ours.value or 0.0) - 60.86)
    assert cells["park2021"].best and not cells["aberman2020"].best and not cells["holden2016"].best
    text = explain(table, "park2021:CRA", load_run(tmp_path))
    assert "published: 60.86 ± 2.06 %" in text and "again: stylebench reproduce" in text and "judge " in text
    with pytest.raises(BadConfig, match="ROW:QUANTITY"):
        explain(table, "park2021:FID", ())


def test_a_paper_stands_beside_the_row_that_was_trained_as_it_says(tmp_path: Path) -> None:
    table = stored_table(tmp_path, {"park2021": 30.0, "park2021@paper": 60.0, "aberman2020": 30.0})
    rows = {row.method: row for row in table.rows}
    assert rows["park2021@paper"].printed and not rows["park2021"].printed
    assert rows["park2021@paper"].cells["CRA"].best
    assert "budget paper" in explain(table, "park2021@paper:CRA", load_run(tmp_path))


def test_an_unmeasured_table_explains_itself() -> None:
    [table] = paper_tables("style_erd.user_study", ())
    assert "published, not measured here" in render_paper_table(table, "md")


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_all_tables_compile(tmp_path: Path, published: tuple[StoredRecord, ...]) -> None:
    tables = [render_paper_table(table, "latex") for name in TABLES for table in paper_tables(name, published)]
    (tmp_path / "all.tex").write_text(PAGE % "\n\\clearpage\n".join(tables), encoding="utf-8")
    ran = subprocess.run(
        ["pdflatex", "-interaction=nonstopmode", "-halt-on-error", "all.tex"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stdout[-2000:]
    assert (tmp_path / "all.pdf").stat().st_size > 10_000
