"""``stylebench fit``: what is missing is trained once, for the track that is asked for, and its curves are drawn."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.errors import BadConfig
from bench.suite.fitting import FitOrder, fit_all, table_of


def silent(stage: str, what: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


def order(folder: Path, *methods: str, track: str = "transfer", seeds: tuple[int, ...] = (0,)) -> FitOrder:
    return FitOrder(
        data={"procedural": None}, methods=methods, out=folder / "out", store=folder / "store", track=track,
        budget="smoke", seeds=seeds, jobs=1,
    )  # fmt: skip


@pytest.mark.slow
def test_trained_once_then_found(tmp_path: Path) -> None:
    first = fit_all(order(tmp_path, "kuriyama-adain", seeds=(0, 1)), silent)
    assert [(row.method, row.seed, row.outcome.status, row.anew) for row in first] == [
        ("kuriyama-adain", 0, "ok", True),
        ("kuriyama-adain", 1, "ok", True),
    ]
    assert all(row.steps == 20 and row.size_bytes > 0 and row.losses for row in first)
    again = fit_all(order(tmp_path, "kuriyama-adain", seeds=(0, 1)), silent)
    assert [row.anew for row in again] == [False, False]
    assert [row.losses for row in again] == [row.losses for row in first]
    [figure] = (tmp_path / "out").glob("*.png")
    assert figure.name == "kuriyama-adain-smoke-transfer-procedural.png"
    headers, rows = table_of(again)
    assert len(rows) == 2 and all(len(row) == len(headers) for row in rows)


@pytest.mark.slow
def test_gestures_are_a_training_of_their_own(tmp_path: Path) -> None:
    [transfer] = fit_all(order(tmp_path, "kuriyama-adain"), silent)
    [gesture] = fit_all(order(tmp_path, "kuriyama-adain", track="gesture"), silent)
    [parts] = fit_all(order(tmp_path, "kuriyama-adain", track="parts"), silent)
    assert transfer.anew and gesture.anew and not parts.anew
    assert transfer.losses != gesture.losses and transfer.losses == parts.losses


def test_what_cannot_be_trained_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match="no method named"):
        fit_all(order(tmp_path), silent)
    with pytest.raises(BadConfig, match="unknown track 'dance'"):
        fit_all(order(tmp_path, "kuriyama-adain", track="dance"), silent)


@pytest.mark.slow
def test_a_method_that_does_not_learn_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match="copy-content does not learn"):
        fit_all(order(tmp_path, "copy-content"), silent)
