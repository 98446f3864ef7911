"""The papers' numbers: complete, readable, and honest about what can be compared."""

from __future__ import annotations

import csv
from collections import Counter
from pathlib import Path

import pytest

from bench.adapters import ADAPTERS
from bench.errors import BadConfig, BadFile
from bench.metrics import METRICS
from bench.protocols.published import FIELDS, PUBLISHED_CSV, Published, published_numbers, read_published_numbers
from bench.suite.timing.plan import ONLINE, TimingPlan, offline

NUMBERS_PER_TABLE = {
    "park2021.table1": 6,
    "park2021.table2": 6,
    "park2021.text": 2,
    "kuriyama2022.table1": 12,
    "kuriyama2022.table2": 24,
    "kuriyama2022.table3": 24,
    "kuriyama2022.table4": 30,
    "kuriyama2022.table5": 8,
    "kuriyama2022.table6": 7,
    "kuriyama2022.table7": 15,
    "kuriyama2022.text": 7,
    "mason2022.table1": 27,
    "mason2022.table2": 28,
    "motion_puzzle.table1": 6,
    "motion_puzzle.table2": 11,
    "motion_puzzle.text": 3,
    "style_erd.table1": 8,
    "style_erd.table2": 20,
    "style_erd.user_study": 9,
    "style_erd.text": 2,
}
ALL = published_numbers()


def find(table_id: str, method: str, metric: str) -> Published:
    (row,) = (row for row in published_numbers(table_id) if (row.method, row.metric) == (method, metric))
    return row


def test_every_number_of_every_table_is_there() -> None:
    assert Counter(row.table_id for row in ALL) == NUMBERS_PER_TABLE
    assert len(ALL) == 255
    assert tuple(row for table_id in NUMBERS_PER_TABLE for row in published_numbers(table_id)) == ALL


def test_no_cell_of_a_table_stands_twice() -> None:
    cells = Counter((row.table_id, row.method, row.metric) for row in ALL)
    assert [cell for cell, times in cells.items() if times > 1] == []


def test_numbers_as_printed() -> None:
    ours = find("motion_puzzle.table2", "Ours", "FMD")
    assert (ours.printed, ours.value, ours.sd, ours.unit) == ("9.38", 9.38, 1.10, "distance")
    assert find("motion_puzzle.table2", "Holden2016", "FMD").printed == "29.40"
    assert find("park2021.table1", "L_adv+L_cyc+L_id+L_sty+L_ds", "CRA").value == 72.64
    assert find("park2021.table2", "Ours (ST-GCN)", "CRA").sd == 2.06
    assert find("kuriyama2022.table2", "Soft swap (ours)", "style_error_mean").value == 0.646
    assert find("mason2022.table2", "LPN Resad", "style_modulation_network_params").value == 24_952_320
    assert find("style_erd.table1", "Park2021", "FMD (auto-encoder)").value == 190.94
    assert find("style_erd.table2", "Ours", "runtime_online").value == 1.73
    assert find("motion_puzzle.text", "Ours (real-time variant)", "memory_reduction").value is None


def test_lists_of_joints_are_no_numbers() -> None:
    row = find("motion_puzzle.table1", "spine-only transfer", "joints_with_MSD>0.05")
    assert row.value is None and row.joints == (11, 12, 13, 17)
    assert {row.table_id for row in ALL if row.joints} == {"motion_puzzle.table1"}


@pytest.mark.parametrize("row", ALL, ids=lambda row: f"{row.table_id}-{row.method}-{row.metric}")
def test_every_row_is_sound(row: Published) -> None:
    assert row.value is not None or row.joints or row.printed == ">80"
    assert row.value is None or row.value >= 0.0
    assert row.sd is None or row.sd > 0.0
    assert row.comparable or row.why
    assert row.our_method == "" or row.our_method in ADAPTERS
    assert row.our_metric == "" or row.our_metric in METRICS
    assert not row.our_slice or row.our_metric, "a slice of nothing"
    assert row.factor is None or row.our_metric, "a factor to nothing"


@pytest.mark.parametrize("row", [row for row in ALL if row.our_metric], ids=lambda row: f"{row.method}-{row.metric}")
def test_units_meet(row: Published) -> None:
    unit = METRICS[row.our_metric].unit
    if row.factor is None:
        assert (row.unit, unit) == ("frames", "s")
    elif row.factor == 1.0:
        assert row.unit == unit
    else:
        assert (row.unit, unit, row.factor) in {("count", "B", 4.0), ("KB", "count", 250.0)}


def test_slices_are_those_of_our_tracks() -> None:
    timed = {ONLINE, *(offline(length) for length in TimingPlan().lengths)}
    allowed = {
        "fmd": {"all"}, "cra": {"all"}, "sra": {"all"}, "startup_designed": {"all"}, "parameters": {"all"},
        "bytes_per_style": {"all"}, "joints_above_0.1": {f"part={part}" for part in ("legs", "arms", "spine")},
        "joints_above_0.05": {f"part={part}" for part in ("legs", "arms", "spine")}, "latency_p50": timed,
        "frames_per_second": {""},
    }  # fmt: skip
    errors = {"intra", "inter", "all", "intra:against_style_sample", "intra:against_content_sample"}
    for row in ALL:
        if row.our_metric:
            assert row.our_slice in allowed.get(row.our_metric.split("[")[0], errors), row


def test_one_method_and_metric_and_slice_stand_once_in_a_table() -> None:
    cells = Counter((row.table_id, row.our_method, row.our_metric, row.our_slice) for row in ALL if row.our_metric)
    assert [cell for cell, times in cells.items() if times > 1] == []


def test_only_declared_counts_and_public_data_are_comparable() -> None:
    comparable = {(row.table_id, row.unit) for row in ALL if row.comparable}
    assert comparable == {
        ("kuriyama2022.text", "KB"),
        ("mason2022.table1", "frames"),
        ("mason2022.table1", "min"),
        ("mason2022.table1", "%"),
        ("mason2022.table2", "count"),
        ("style_erd.table2", "frames"),
    }
    film = [r for r in published_numbers("mason2022.table2") if r.metric == "style_modulation_network_params"]
    assert [row.method for row in film if not row.comparable] == ["PFNN FiLM", "MANN FiLM", "LPN FiLM"]


def test_quoted_and_derived_times_say_so() -> None:
    times = [row for row in published_numbers("style_erd.table2") if row.method == "Xia2015" and row.unit == "ms"]
    assert [("quoted" in row.why, "derived" in row.why) for row in times] == [(True, False)] + 3 * [(False, True)]
    for row, frames in zip(times[1:], (60, 90, 120), strict=True):
        assert row.value == pytest.approx(18.10 * frames / 5)


def test_frames_of_100style_add_up() -> None:
    frames = {row.method: row.value or 0.0 for row in published_numbers("mason2022.table1") if row.unit == "frames"}
    assert sum(frames.values()) == 2 * frames["Total"] == 2 * 4_055_978


def test_real_motion_is_an_anchor_row() -> None:
    real = [row for row in ALL if row.method.startswith("Real motions")]
    assert {row.our_method for row in real} == {"real-test"} <= set(ADAPTERS) and len(real) == 3


def test_imitation_is_read_as_an_output() -> None:
    rows = published_numbers("kuriyama2022.table1")
    assert {row.our_method for row in rows} == {"gesture-imitation"}
    assert find("kuriyama2022.table1", "Content sample", "content_error_mean").our_slice == "intra"
    crossed = find("kuriyama2022.table1", "Style sample", "content_error_mean")
    assert (crossed.our_metric, crossed.our_slice) == ("content_error", "intra:against_style_sample")
    crossed = find("kuriyama2022.table1", "Content sample", "style_error_w25%")
    assert (crossed.our_metric, crossed.our_slice) == ("style_error_worst_quarter", "intra:against_content_sample")


def test_unknown_table_names_the_known_ones() -> None:
    with pytest.raises(BadConfig, match=r"table_id: no published table is called 'park2021.t9'; .*park2021.table1, "):
        published_numbers("park2021.t9")


def broken(tmp_path: Path, **changes: str) -> Path:
    with PUBLISHED_CSV.open(encoding="utf-8", newline="") as file:
        first = next(csv.DictReader(file))
    path = tmp_path / "numbers.csv"
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.DictWriter(file, FIELDS, lineterminator="\n")
        writer.writeheader()
        writer.writerows([first, first | changes])
    return path


def test_reads_what_it_wrote(tmp_path: Path) -> None:
    assert read_published_numbers(broken(tmp_path)) == (ALL[0], ALL[0])


@pytest.mark.parametrize(
    ("column", "value", "message"),
    [
        ("value", "many", r"numbers.csv:3: value must be a number, got 'many'"),
        ("value", "nan", r"numbers.csv:3: value must be a number, got 'nan'"),
        ("unit", "joints", r"numbers.csv:3: value must be a list of joints, got '14.14'"),
        ("sd", "inf", r"numbers.csv:3: sd must be a number, got 'inf'"),
        ("factor", "x", r"numbers.csv:3: factor must be a number, got 'x'"),
        ("method", "", r"numbers.csv:3: method must not be empty"),
        ("comparable", "perhaps", r"numbers.csv:3: comparable must be yes or no, got 'perhaps'"),
        ("why", "", r"numbers.csv:3: a number that is not comparable needs its reason in why"),
    ],
)
def test_refuses_a_broken_row(tmp_path: Path, column: str, value: str, message: str) -> None:
    with pytest.raises(BadFile, match=message):
        read_published_numbers(broken(tmp_path, **{column: value}))


def test_refuses_what_is_no_such_file(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"missing.csv: cannot read published numbers"):
        read_published_numbers(tmp_path / "missing.csv")
    path = tmp_path / "other.csv"
    path.write_text("a,b\n1,2\n", encoding="utf-8")
    with pytest.raises(BadFile, match=r"other.csv:1: columns must be table_id, "):
        read_published_numbers(path)
    path.write_text(",".join(FIELDS) + "\nx,y\n", encoding="utf-8")
    with pytest.raises(BadFile, match=r"other.csv:2: a row must have 15 columns"):
        read_published_numbers(path)
    path.write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadFile, match=r"other.csv: cannot read published numbers"):
        read_published_numbers(path)
