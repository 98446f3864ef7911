"""Canonical judges still say what they said when they were committed, on this machine too."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.suite.judges import PRETRAINED, load_judges
from bench.suite.second_judges import load_second_judges

from .golden import FOLDER, WINDOWS_FILE, answers, second_answers

CANONICAL = sorted(path.parent for path in PRETRAINED.glob("*/card.json"))


@pytest.mark.parametrize("folder", CANONICAL, ids=lambda folder: folder.name)
def test_features_of_stored_windows(folder: Path) -> None:
    judges = load_judges(folder, "canonical")
    with np.load(WINDOWS_FILE, allow_pickle=False) as stored:
        found = answers(judges, stored["features"])
    with np.load(FOLDER / f"{folder.name}.npz", allow_pickle=False) as golden:
        assert str(golden["digest"]) == judges.digest, (
            "judges were trained anew: run python -m tests.classifiers.golden"
        )
        for name, array in found.items():
            scale = np.abs(golden[name]).max()
            assert np.abs(array - golden[name]).max() <= 1e-4 * scale, name


@pytest.mark.parametrize("folder", CANONICAL, ids=lambda folder: folder.name)
def test_second_family_says_what_it_said(folder: Path) -> None:
    judges = load_second_judges(folder)
    with np.load(WINDOWS_FILE, allow_pickle=False) as stored:
        found, again = (second_answers(judges, stored["features"]) for _ in range(2))
    with np.load(FOLDER / f"{folder.name}.second.npz", allow_pickle=False) as golden:
        assert str(golden["digest"]) == judges.digest, "trained anew: run python -m tests.classifiers.golden"
        for name, array in found.items():
            assert np.array_equal(array, again[name]), name
            assert np.abs(array - golden[name]).max() <= 1e-4 * np.abs(golden[name]).max(), name


PUBLISHED_JUDGES = {
    "procedural@1": "fade5730f2ae4c2b961be6a65421c10c",
    "bandai-namco@1": "7e8a2304b04b2c37681a12ea4e0a3142",
}
"""Published records refer to these."""


@pytest.mark.parametrize("folder", CANONICAL, ids=lambda folder: folder.name)
def test_second_family_is_an_addition(folder: Path) -> None:
    judges, second = load_judges(folder, "canonical"), load_second_judges(folder)
    assert judges.digest == PUBLISHED_JUDGES[folder.name]
    assert [fact.id for fact in second.facts] == [
        f"temporal-{t}/{seed}" for t in ("content", "style") for seed in range(3)
    ]
    assert not {fact.id for fact in second.facts} & {fact.id for fact in judges.facts}
    assert all((folder / fact.file).stat().st_size < 300_000 for fact in second.facts)
    assert all(fact.pooled.accuracy >= 95.0 for fact in second.facts)


@pytest.mark.parametrize("folder", CANONICAL, ids=lambda folder: folder.name)
def test_canonical_judges_pass_their_bars(folder: Path) -> None:
    card = load_judges(folder, "canonical").card
    assert {judge.seed for judge in card.classifiers} == {judge.seed for judge in card.autoencoders} == {0, 1, 2}
    assert all(judge.pooled.accuracy >= 95.0 for judge in card.of("content"))
    assert all(judge.pooled.accuracy >= (97.0 if card.native_labels else 95.0) for judge in card.of("style"))
    assert card.licence and card.split_kind == "default"
    assert all(path.stat().st_size < 2_000_000 for path in folder.iterdir())


def test_unseen_actors_are_recognised() -> None:
    card = load_judges(PRETRAINED / "procedural@1", "canonical").card
    for judge in (*card.of("content"), *card.of("style")):
        assert judge.unseen_actor_accuracy is not None and judge.unseen_actor_accuracy >= 95.0, judge.id
