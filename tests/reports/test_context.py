from __future__ import annotations

from pathlib import Path

import pytest

from reports.context import anchor_meanings, context, judge_summary
from reports.records import JudgeFacts
from reports.tables import tables_of_run
from tests.reports.factory import ANCHORS, JUDGES, METHODS, FakeMethod, FakeTasks, write_run

SMALL = FakeTasks(n=60, n_clusters=12)


def test_judges_are_summed_up_by_family_with_classifiers_first() -> None:
    said = judge_summary(JUDGES)
    assert said.startswith("Judges (canonical): stgcn-content (3 seeds, 97.0 to 97.8 % right on real motion)")
    assert said.endswith("autoencoder (3 seeds)")


def test_one_seed_is_singular_and_a_mixture_of_origins_is_said() -> None:
    facts = JudgeFacts(id="stgcn-style/0", digest="a", origin="local", real_accuracy=97.0)
    assert judge_summary([facts]) == "Judges (local): stgcn-style (1 seed, 97.0 % right on real motion)"
    other = facts.model_copy(update={"id": "stgcn-content/0", "origin": "canonical"})
    assert judge_summary([facts, other]).startswith("Judges (canonical and local)")
    assert judge_summary([]) == ""


def test_chance_the_commonest_class_and_the_real_row_stand_beside_a_table(tmp_path: Path) -> None:
    [table] = tables_of_run(write_run(tmp_path, (*ANCHORS[:3], METHODS[0]), SMALL))
    said = "\n".join(context(table))
    assert "CRA: chance 14.3 %, commonest class 24.0 %" in said
    assert "of real: 1 is the joint recognition of real disjoint motion, 95.0 %." in said


def test_a_table_without_a_finished_row_has_no_context(tmp_path: Path) -> None:
    [table] = tables_of_run(write_run(tmp_path, METHODS[-1:], SMALL))
    assert context(table) == ()


@pytest.mark.parametrize("datasets", [("a@1",), ("a@1", "b@1")])
def test_each_anchor_is_explained_once(tmp_path: Path, datasets: tuple[str, ...]) -> None:
    for dataset in datasets:
        write_run(tmp_path, (*ANCHORS, METHODS[0]), SMALL, dataset=dataset)
    meanings = anchor_meanings(tables_of_run(tmp_path))
    assert len(meanings) == len(ANCHORS)
    assert ("copy content", "returns the source", "test") in meanings


def test_an_anchor_described_differently_is_explained_twice(tmp_path: Path) -> None:
    for dataset, words in (("a@1", "one thing"), ("b@1", "another thing")):
        write_run(tmp_path, [FakeMethod("x", "X", "anchor", description=words)], SMALL, dataset=dataset)
    assert [words for _, words, _ in anchor_meanings(tables_of_run(tmp_path))] == ["one thing", "another thing"]
