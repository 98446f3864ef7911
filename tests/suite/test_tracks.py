"""Every protocol as a user runs it, at smoke size, on generated and on captured motion."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

import pytest

from bench.protocols import PROTOCOLS
from bench.suite.output import write_report
from bench.suite.request import RunRequest
from bench.suite.run import run
from bench.suite.workers import Limits
from reports.records import Record

pytestmark = pytest.mark.slow

METHODS = (
    "real-test", "label-oracle", "copy-content", "copy-style", "splice", "linear-blend", "repeat-last", "mean-pose",
    "style-mean-shift", "retrieve-nearest-pose", "procedural-truth",
)  # fmt: skip


class Rows:
    """Records by protocol label and method."""

    def __init__(self, records: tuple[Record, ...], folder: Path) -> None:
        self.found: dict[str, dict[str, Record]] = defaultdict(dict)
        self.folder = folder
        for record in records:
            self.found[record.protocol_label][record.method.name] = record

    def value(self, label: str, method: str, metric: str, slice_name: str = "all") -> float:
        found = self.found[label][method].find(metric, slice_name)
        assert found is not None and found.value is not None, (label, method, metric)
        return found.value


ALL = tuple(label for label, protocol in PROTOCOLS.items() if protocol.track != "gesture")
"""The gesture track has tests of its own."""
OWN = tuple(label for label in ALL if label.startswith("stylebench-"))


def rows_of(folder: Path, data: dict[str, Path | None], labels: tuple[str, ...]) -> Rows:
    request = RunRequest(
        data, folder / "out", folder / "store", METHODS, tracks=(), protocols=labels, profile="smoke",
        limits=Limits(wall_s=600.0),
    )  # fmt: skip
    return Rows(run(request, lambda *_: None).records, folder / "out")


@pytest.fixture(scope="module")
def procedural(tmp_path_factory: pytest.TempPathFactory) -> Rows:
    return rows_of(tmp_path_factory.mktemp("procedural"), {"procedural": None}, ALL)


@pytest.fixture(scope="module")
def bandai_namco(tmp_path_factory: pytest.TempPathFactory, bandai_namco_zip: Path) -> Iterator[Rows]:
    yield rows_of(tmp_path_factory.mktemp("bandai"), {"bandai-namco": bandai_namco_zip}, OWN)


@pytest.fixture(params=["procedural", "bandai_namco"])
def rows(request: pytest.FixtureRequest) -> Rows:
    found: Rows = request.getfixturevalue(request.param)
    return found


def test_no_row_fails_and_every_table_is_written(rows: Rows) -> None:
    for label, records in rows.found.items():
        for record in records.values():
            assert record.status in ("ok", "unsupported"), (label, record.method.name, record.reason)
    texts = write_report(rows.folder)
    assert len(texts) == len(rows.found)


def test_a_copy_gives_back_its_source(rows: Rows) -> None:
    label = "stylebench-transfer@1/self"
    assert rows.value(label, "copy-content", "reconstruction_position") == pytest.approx(0.0, abs=1e-3)
    assert rows.value(label, "mean-pose", "reconstruction_position") > 5.0


def test_copies_of_long_sources_keep_their_content(rows: Rows) -> None:
    label = "stylebench-transfer@1/long"
    assert rows.value(label, "copy-content", "cra") > 60.0
    assert rows.value(label, "copy-content", "join_jerk_ratio") == pytest.approx(1.0)


def test_a_copy_of_a_prefix_is_the_prefix_of_a_copy(rows: Rows) -> None:
    for n in (10, 16, 32):
        found = rows.value("stylebench-transfer@1/short", "copy-content", "prefix_error", f"frames={n}")
        assert found == pytest.approx(0.0, abs=1e-3)


def test_splice_is_perfectly_local_and_a_whole_copy_is_not(rows: Rows) -> None:
    for label in {"stylebench-parts@1", "motion_puzzle@1/table1"} & set(rows.found):
        assert rows.value(label, "splice", "leak_ratio") == pytest.approx(0.0, abs=1e-4)
        assert rows.value(label, "copy-style", "leak_ratio") > 0.2
        assert rows.found[label]["copy-content"].find("leak_ratio") is not None


def test_a_blend_is_even_and_a_switch_is_one_step(rows: Rows) -> None:
    label = "stylebench-interpolation@1"
    assert rows.value(label, "linear-blend", "evenness") < 1.5
    assert rows.value(label, "copy-style", "evenness") == pytest.approx(4.0, abs=1e-3)
    assert rows.value(label, "linear-blend", "monotonicity") > 0.7


def test_the_last_frame_predicts_better_than_the_mean_pose(rows: Rows) -> None:
    label = "stylebench-prediction@1"
    assert rows.value(label, "repeat-last", "next_frame_error") < rows.value(label, "mean-pose", "next_frame_error")


def test_the_true_answer_is_the_true_answer(procedural: Rows) -> None:
    for label in ("stylebench-transfer@1", "stylebench-latent@1"):
        assert procedural.value(label, "procedural-truth", "paired_position") == pytest.approx(0.0, abs=1e-3)
        assert procedural.value(label, "copy-content", "paired_position") > 1.0


def test_timed_rows_say_what_a_call_costs(rows: Rows) -> None:
    for label in {"stylebench-runtime@1", "style_erd@1/table2"} & set(rows.found):
        assert rows.value(label, "copy-content", "latency_p50", "online") < 1.0
        assert rows.value(label, "style-mean-shift", "latency_p50", "offline L=120") > 0.0
