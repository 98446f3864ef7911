"""Tables, sentences and figures of the tracks beside transfer."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.motion.skeleton import CANONICAL_NAMES
from reports.columns import COLUMNS, columns_of
from reports.context import context
from reports.formatting import number
from reports.heatmap import displacements, part_heatmap
from reports.records import BadRecord, Measurement
from reports.tables import Table, tables_of_run
from tests.reports.factory import ANCHORS, FakeTasks, make_row, write_row

PARTS = ("legs", "arms", "spine", "all")


def measurement(name: str, slice_name: str, value: float, unit: str = "1", **details: float) -> Measurement:
    return Measurement(name=name, version=1, slice=slice_name, value=value, unit=unit, better="lower", n=50,
                       details=details)  # fmt: skip


def table_of(folder: Path, track: str, *measurements: Measurement, condition: str = "standard") -> Table:
    """A table of two rows with these numbers."""
    for fake in ANCHORS[:2]:
        record, _ = make_row(fake, FakeTasks(n=20, n_clusters=4))
        changes = {
            "track": track, "protocol": f"stylebench-{track}", "condition": condition, "judges": (),
            "measurements": measurements, "samples_digest": "", "copies": False,
        }  # fmt: skip
        write_row(folder, record.model_copy(update=changes), {})
    [table] = tables_of_run(folder)
    return table


def moved(part: str) -> Measurement:
    inside = {"legs": range(1, 9), "arms": range(13, 21), "spine": (0, 9, 10, 11, 12), "all": range(21)}[part]
    details = {f"{j:02d} {name}": 0.2 * (j in inside) for j, name in enumerate(CANONICAL_NAMES)}
    return measurement("locality_msd", f"part={part}", 0.2, "stature^2", **details)


def test_a_heat_map_shows_parts_by_joints_in_the_order_of_the_skeleton(tmp_path: Path) -> None:
    table = table_of(tmp_path, "parts", measurement("leak_ratio", "all", 0.1), *map(moved, PARTS))
    found = displacements(table.rows[0])
    assert list(found) == list(PARTS)
    assert [name.split()[1] for name in found["legs"]] == list(CANONICAL_NAMES)
    figure = part_heatmap(table)
    panels = [axes for axes in figure.axes if axes.images]
    assert [axes.get_title(loc="left") for axes in panels] == [row.title for row in table.rows]
    shown = panels[0].images[0].get_array()
    assert shown is not None and shown.shape == (4, 21)


def test_a_heat_map_needs_displacements(tmp_path: Path) -> None:
    with pytest.raises(BadRecord, match="no row has displacements to draw"):
        part_heatmap(table_of(tmp_path, "parts", measurement("leak_ratio", "all", 0.1)))


def test_a_table_of_durations_names_overhead_threads_and_machine(tmp_path: Path) -> None:
    clock = {"harness_overhead_us": 0.7, "threads": 1.0}
    table = table_of(tmp_path, "runtime", measurement("latency_p50", "online", 1.5, "ms", **clock))
    [said] = [sentence for sentence in context(table) if "harness" in sentence]
    assert said.startswith("The harness itself takes 0.700 us of a call; threads: 1; on ")


def test_a_mean_over_trials_says_what_was_drawn(tmp_path: Path) -> None:
    drawn = measurement("fmd[stgcn]", "all", 1.5, "distance", pool=5000.0, trials=10.0)
    table = table_of(tmp_path, "transfer", drawn, condition="table2")
    assert table.columns == ()
    papers = tmp_path / "papers"
    papers.mkdir()
    for fake in ANCHORS[:1]:
        record, _ = make_row(fake, FakeTasks(n=20, n_clusters=4))
        changes = {"protocol": "park2021", "condition": "table2", "judges": (), "measurements": (drawn,),
                   "samples_digest": ""}  # fmt: skip
        write_row(papers, record.model_copy(update=changes), {})
    [table] = tables_of_run(papers)
    assert "FMD: mean of 10 trials of 50 samples out of a pool of 5000." in context(table)


def test_conditions_have_columns_of_their_own() -> None:
    assert columns_of("transfer", "stylebench-transfer", "standard") == COLUMNS["transfer"]
    assert columns_of("transfer", "stylebench-transfer", "self") == COLUMNS["transfer/self"]
    assert columns_of("transfer", "park2021", "table2") == COLUMNS["park2021/table2"]
    assert columns_of("nowhere", "x", "standard") == ()


def test_counts_have_no_decimals() -> None:
    assert number(1234.0, "count") == "1234"
    assert number(0.0, "B") == "0"
