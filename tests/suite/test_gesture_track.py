"""What the gesture track must show, on generated and on real motion. Slow: these are real runs."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from bench.suite.request import RunRequest
from bench.suite.run import run

pytestmark = pytest.mark.slow

COPIES = ("copy-content", "copy-style-whole")
Value = Callable[[str, str], float]
"""Intra value of a row and metric."""


def numbers_of(folder: Path, data: dict[str, Path | None], methods: tuple[str, ...]) -> Value:
    request = RunRequest(data, folder / "out", folder / "store", methods, tracks=("gesture",))
    result = run(request, lambda *_: None)
    assert [record.status for record in result.records] == ["ok"] * len(methods)
    records = {record.method.name: record for record in result.records}

    def value(name: str, metric: str) -> float:
        found = records[name].find(metric, "intra")
        if found is None or found.value is None:
            raise KeyError(f"{name} has no {metric}")
        return found.value

    return value


@pytest.fixture(scope="module")
def bandai_namco(tmp_path_factory: pytest.TempPathFactory, bandai_namco_zip: Path) -> Value:
    data: dict[str, Path | None] = {"bandai-namco": bandai_namco_zip}
    return numbers_of(tmp_path_factory.mktemp("bandai"), data, (*COPIES, "real-answer", "take-to-take"))


@pytest.fixture(scope="module")
def procedural(tmp_path_factory: pytest.TempPathFactory) -> Value:
    rows = (*COPIES, "real-answer", "take-to-take", "gesture-truth", "gesture-imitation")
    return numbers_of(tmp_path_factory.mktemp("procedural"), {"procedural": None}, rows)


@pytest.mark.parametrize("data", ["procedural", "bandai_namco"])
def test_copies_are_without_error_on_their_own_side(data: str, request: pytest.FixtureRequest) -> None:
    value: Value = request.getfixturevalue(data)
    for metric in ("content_error", "content_error_worst", "content_error_worst_quarter", "content_error[world]"):
        assert value("copy-content", metric) == 0.0
    for metric in ("style_error", "style_error_worst", "style_error[1.07s]", "style_error[4.27s]"):
        assert value("copy-style-whole", metric) == 0.0


def test_a_real_answer_has_less_than_half_the_style_error_of_the_source(bandai_namco: Value) -> None:
    assert bandai_namco("real-answer", "style_error") < bandai_namco("copy-content", "style_error") / 2.0


def test_two_takes_of_the_same_gestures_are_not_at_zero(bandai_namco: Value) -> None:
    floor = bandai_namco("take-to-take", "content_error")
    assert 0.03 < floor < bandai_namco("real-answer", "content_error") / 2.0


def test_read_against_the_truth_it_is_below_both_copies(procedural: Value) -> None:
    truth = procedural("gesture-truth", "gesture_error[truth]")
    assert truth == procedural("gesture-truth", "content_error")
    assert truth < min(procedural(name, "gesture_error[truth]") for name in COPIES)
    assert procedural("gesture-imitation", "content_error") > procedural("gesture-truth", "content_error")
