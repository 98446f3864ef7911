"""What a first run must show, on generated and on real motion. Slow: these are real runs."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.suite.request import RunRequest
from bench.suite.run import run
from reports.records import Record

pytestmark = pytest.mark.slow

METHODS = (
    "real-test",
    "real-disjoint",
    "label-oracle",
    "copy-content",
    "copy-style",
    "coin-flip",
    "noise-0.03",
    "noise-0.1",
    "noise-0.3",
    "style-mean-shift",
    "retrieve-nearest-pose",
)
REAL_ROWS = ("real-test", "real-disjoint", "label-oracle", "procedural-truth")


class Numbers:
    """Values of a run by row, metric and slice."""

    def __init__(self, records: tuple[Record, ...]) -> None:
        self.records = {record.method.name: record for record in records}

    def __call__(self, name: str, metric: str, slice_name: str = "different_content") -> float:
        found = self.records[name].find(metric, slice_name)
        if found is None or found.value is None:
            raise KeyError(f"{name} has no {metric} on {slice_name}")
        return found.value


def numbers_of(folder: Path, data: dict[str, Path | None], methods: tuple[str, ...]) -> Numbers:
    request = RunRequest(data, folder / "out", folder / "store", methods)
    result = run(request, lambda *_: None)
    assert [record.status for record in result.records] == ["ok"] * len(methods)
    assert all(judge.origin == "canonical" for record in result.records for judge in record.judges)
    return Numbers(result.records)


@pytest.fixture(scope="module")
def procedural(tmp_path_factory: pytest.TempPathFactory) -> Numbers:
    return numbers_of(tmp_path_factory.mktemp("procedural"), {"procedural": None}, (*METHODS, "procedural-truth"))


@pytest.fixture(scope="module")
def bandai_namco(tmp_path_factory: pytest.TempPathFactory, bandai_namco_zip: Path) -> Numbers:
    return numbers_of(tmp_path_factory.mktemp("bandai"), {"bandai-namco": bandai_namco_zip}, METHODS)


@pytest.mark.parametrize("data", ["procedural", "bandai_namco"])
def test_rows_stand_where_their_meaning_puts_them(data: str, request: pytest.FixtureRequest) -> None:
    value: Numbers = request.getfixturevalue(data)
    joint = {name: value(name, "joint_recognition") for name in value.records}
    assert joint["label-oracle"] > 90.0
    assert joint["copy-content"] <= 3.0 and joint["copy-style"] <= 3.0
    assert 40.0 <= value("coin-flip", "cra") <= 60.0 and 40.0 <= value("coin-flip", "sra") <= 60.0
    low, high = sorted((joint["copy-content"], joint["copy-style"]))
    assert low - 0.5 <= joint["coin-flip"] <= high + 0.5
    assert joint["style-mean-shift"] <= 60.0


@pytest.mark.parametrize("data", ["procedural", "bandai_namco"])
@pytest.mark.parametrize("metric", ["jerk_ratio", "fmd[stgcn-content]", "fmd[stgcn-style]"])
def test_noise_is_seen_step_by_step(data: str, metric: str, request: pytest.FixtureRequest) -> None:
    value: Numbers = request.getfixturevalue(data)
    steps = [value(name, metric, "all") for name in ("copy-content", "noise-0.03", "noise-0.1", "noise-0.3")]
    assert steps == sorted(steps) and len(set(steps)) == 4


@pytest.mark.parametrize("data", ["procedural", "bandai_namco"])
def test_real_motion_leads_conditional_kid(data: str, request: pytest.FixtureRequest) -> None:
    value: Numbers = request.getfixturevalue(data)
    others = [name for name, record in value.records.items() if name not in REAL_ROWS and not record.copies]
    best = min(value(name, "conditional_kid") for name in others)
    for name in set(REAL_ROWS) & set(value.records):
        assert value(name, "conditional_kid") <= best / 2.0, name


@pytest.mark.parametrize("data", ["procedural", "bandai_namco"])
def test_copies_are_found_and_real_takes_are_not(data: str, request: pytest.FixtureRequest) -> None:
    value: Numbers = request.getfixturevalue(data)
    for name in ("copy-content", "copy-style", "coin-flip", "retrieve-nearest-pose"):
        assert value(name, "copied_share", "all") >= 90.0, name
        assert value.records[name].copies
    assert value("real-test", "copied_share", "all") <= 15.0
