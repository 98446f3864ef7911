"""The page of a run: what is written, that names stay text, and that motions survive their packing."""

from __future__ import annotations

import base64
import json
from pathlib import Path

import numpy as np
import plotly.graph_objects as go
import pytest

from reports.curves import TrainingCurves
from reports.page import FARTHEST_MM, Body, PlayerTable, Section, table_section, write_page
from reports.plots import confusion, latencies, pareto, plain, plot_of, training
from reports.records import Measurement
from reports.tables import Table, tables_of_run
from tests.reports.factory import ANCHORS, METHODS, FakeMethod, FakeTasks, make_row, write_row, write_run

MARKUP = "</script><script>window.hacked = 1</script>"


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    named = FakeMethod("markup", MARKUP, "method", 66.0, 64.0, trained_on="fit part")
    tasks = FakeTasks(n=100, n_clusters=25)
    [found] = tables_of_run(write_run(tmp_path_factory.mktemp("run"), (*ANCHORS, *METHODS, named), tasks))
    return found


def player(title: str = "copy", n_samples: int = 2, n_bodies: int = 2) -> PlayerTable:
    rng = np.random.default_rng(0)

    def body(title: str) -> Body:
        positions = [rng.normal(size=(64, 21, 3)) for _ in range(n_samples)]
        contacts = [rng.random((64, 4)) > 0.5 for _ in range(n_samples)]
        return Body(title, positions, contacts, {"cra": np.array([1.0, np.nan])})

    return PlayerTable(
        name="table", title="transfer", fps=30.0, parents=[-1] + [0] * 20, sides=["middle"] * 21, hands=[15, 19],
        feet=[3, 4, 7, 8], head=12, samples=[(f"s{i}", f"walk, old to {MARKUP}") for i in range(n_samples)],
        bodies={f"body{i}": body(title) for i in range(n_bodies)}, better={"cra": "higher"},
    )  # fmt: skip


def test_the_folder_is_complete_and_names_nothing_outside_of_it(tmp_path: Path, table: Table) -> None:
    page = write_page(
        tmp_path, "A run", "of today", [table_section([table]), Section("motions", "Motions")], [player()]
    )
    assert {path.name for path in tmp_path.iterdir()} == {
        "index.html", "page.css", "page.js", "player.js", "plotly.min.js", "data",
    }  # fmt: skip
    text = page.read_text()
    assert "http://" not in text and "https://" not in text
    assert text.count("<script") == 3
    assert all(title in text for title in ("A run", "of today", "Motions"))


def test_markup_in_names_is_text_everywhere(tmp_path: Path, table: Table) -> None:
    figure = pareto(table)
    assert figure is not None
    section = Section("pareto", MARKUP, (MARKUP,), (), (plot_of("pareto-0", MARKUP, figure),))
    sections = [table_section([table]), section, Section("motions", "M")]
    page = write_page(tmp_path, MARKUP, MARKUP, sections, [player(MARKUP)])
    assert "<script>window" not in page.read_text()
    data = (tmp_path / "data" / "table.js").read_text()
    assert "<" not in data
    assert data.startswith('stylebench.load("table", {')


def test_positions_come_back_in_millimetres_from_the_start(tmp_path: Path) -> None:
    shown = player()
    write_page(tmp_path, "t", "s", [Section("motions", "M")], [shown])
    text = (tmp_path / "data" / "table.js").read_text()
    data = json.loads(text.partition(", ")[2].rstrip().removesuffix(");"))
    packed = data["motions"]["body0"]["positions"][0]
    whole = np.frombuffer(base64.b64decode(packed), dtype="<i2").reshape(64, 21, 3)
    positions = shown.bodies["body0"].positions_m[0]
    expected = positions - positions[:1, :1] * np.array([1.0, 0.0, 1.0])
    assert np.abs(whole / 1000.0 - expected).max() <= 0.5001e-3
    assert data["motions"]["body0"]["scores"]["cra"] == [1.0, None]
    contacts = np.frombuffer(base64.b64decode(data["motions"]["body0"]["contacts"][0]), dtype=np.uint8)
    assert np.array_equal(contacts & 4 > 0, shown.bodies["body0"].contacts[0][:, 2])


def test_what_is_too_far_away_is_held_at_the_edge(tmp_path: Path) -> None:
    far = player()
    far.bodies["body0"].positions_m[0][5] = 1e6
    write_page(tmp_path, "t", "s", [Section("motions", "M")], [far])
    text = (tmp_path / "data" / "table.js").read_text()
    packed = json.loads(text.partition(", ")[2].rstrip().removesuffix(");"))["motions"]["body0"]["positions"][0]
    whole = np.frombuffer(base64.b64decode(packed), dtype="<i2").reshape(64, 21, 3)
    assert (whole[5] == FARTHEST_MM).all()


def test_twelve_methods_and_thirty_samples_are_small(tmp_path: Path) -> None:
    write_page(tmp_path, "t", "s", [Section("motions", "M")], [player(n_samples=30, n_bodies=15)])
    assert sum(path.stat().st_size for path in tmp_path.rglob("*") if path.is_file()) < 15_000_000


def test_deadlines_stand_where_their_lines_are(tmp_path: Path) -> None:
    record, _ = make_row(FakeMethod("quick", "Quick"), FakeTasks())
    times = [
        Measurement(name=f"latency_{name}", version=1, slice="online", value=value, unit="ms", better="lower", n=200)
        for name, value in (("p50", 1.0), ("p90", 2.0), ("p99", 3.0), ("max", 4.0))
    ]
    facts = {"track": "runtime", "protocol": "stylebench-runtime", "measurements": tuple(times), "samples_digest": ""}
    write_row(tmp_path, record.model_copy(update=facts), {})
    [timed] = tables_of_run(tmp_path)
    figure = latencies(timed)
    assert figure is not None
    places = {item.text: item.x for item in figure.layout.annotations}
    assert places == pytest.approx({"30": 1.5229, "60": 1.2218, "120": 0.9208}, abs=1e-4)
    assert sorted(line.x0 for line in figure.layout.shapes) == pytest.approx([1000 / 120, 1000 / 60, 1000 / 30])


def test_plots_show_what_they_are_given(table: Table) -> None:
    figure = pareto(table)
    assert figure is not None
    names = {str(text) for trace in figure.data for text in (trace.text or ())}
    assert plain(MARKUP) in names
    assert latencies(table) is None
    shares = confusion(("walk", "run"), ((3, 1), (0, 0))).data[0].z
    assert np.allclose(shares, [[0.0, 0.0], [75.0, 25.0]])
    curves = TrainingCurves("seed 0", ("a", "b"), np.array([1, 2]), np.array([[1.0, np.nan], [0.5, 2.0]]))
    assert [list(trace.y) for trace in training([curves]).data] == [[1.0, 0.5], [2.0]]


def test_a_figure_s_json_cannot_end_its_element() -> None:
    plot = plot_of("a", "b", go.Figure(go.Scatter(x=[1], y=[1], name=MARKUP)))
    assert "<" not in plot.json and json.loads(plot.json)["data"][0]["name"] == MARKUP
