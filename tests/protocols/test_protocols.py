"""Every protocol of the table, on takes that are made here."""

from __future__ import annotations

import json
from collections import Counter
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from bench.datasets.base import Dataset
from bench.datasets.split import PARTS, deal
from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol, Task, TaskPool, neutral_style
from bench.protocols.conditions import long_sequences
from bench.suite.setting import read_tasks
from tests.motion.factory import random_clip

CONTENTS, STYLES = ("gesture-beat", "gesture-wave", "run", "walk"), ("angry", "neutral", "old", "proud")
LISTED = [protocol for protocol in PROTOCOLS.values() if protocol.track != "gesture"]


def dataset(name: str = "toy", contents: tuple[str, ...] = CONTENTS) -> Dataset:
    """Twenty-one takes in each cell, so that every part has some."""
    takes = [
        Take(random_clip(120 + number % 5, seed=number), f"{content}_{style}_{number:02d}", name, content, style)
        for content in contents
        for style in STYLES
        for number in range(21)
    ]
    return Dataset(name, f"{name}@1", name, tuple(takes), {c: c for c in contents}, "none", "none")


@pytest.fixture(scope="module")
def toy() -> Dataset:
    return dataset()


def pool_of(protocol: Protocol, toy: Dataset) -> TaskPool:
    split = deal(toy.takes)
    by_part = {part: split.select(toy.takes, part) for part in PARTS}
    other = dataset("other", ("run", "walk"))
    extra = protocol.extra_takes(by_part, other, 0) if protocol.extra_takes else []
    return TaskPool(split.select(toy.takes, *protocol.source_parts), extra)


@pytest.mark.parametrize("protocol", LISTED, ids=lambda p: p.label)
def test_task_lists_are_fixed_and_grow_at_the_end(protocol: Protocol, toy: Dataset) -> None:
    pool = pool_of(protocol, toy)
    tasks = protocol.make_tasks(pool, 40, 7)
    assert protocol.make_tasks(pool, 40, 7) == tasks
    assert protocol.make_tasks(pool, 20, 7) == tasks[:20]
    assert len({task.sample_id for task in tasks}) == len(tasks) == 40
    known = {take.take_id for take in (*pool.takes, *pool.extra)}
    for task in tasks:
        assert {task.content_take_id, task.style_take_id} <= known
        assert not task.start_take_id or task.start_take_id in known


@pytest.mark.parametrize("protocol", LISTED, ids=lambda p: p.label)
def test_tasks_survive_json(protocol: Protocol, toy: Dataset, tmp_path_factory: pytest.TempPathFactory) -> None:
    tasks = protocol.make_tasks(pool_of(protocol, toy), 20, 7)
    path = tmp_path_factory.mktemp("tasks") / "tasks.json"
    path.write_text(json.dumps([task.as_dict() for task in tasks]))
    assert read_tasks(path) == tuple(tasks)


def tasks_of(label: str, toy: Dataset, n: int = 40) -> list[Task]:
    return PROTOCOLS[label].make_tasks(pool_of(PROTOCOLS[label], toy), n, 3)


def test_self_tasks_ask_for_the_source(toy: Dataset) -> None:
    for task in tasks_of("stylebench-transfer@1/self", toy):
        assert (task.style_take_id, task.target_style) == (task.content_take_id, task.source_style)


def test_short_tasks_share_all_but_their_length(toy: Dataset) -> None:
    tasks = tasks_of("stylebench-transfer@1/short", toy)
    assert [task.n_frames for task in tasks[:4]] == [10, 16, 32, 64]
    for first in range(0, 40, 4):
        group = tasks[first : first + 4]
        assert len({(t.group, t.content_take_id, t.start_frame, t.style_take_id, t.seed) for t in group}) == 1


def test_long_sequences_have_their_lengths_and_name_their_pieces(toy: Dataset) -> None:
    tasks = tasks_of("stylebench-transfer@1/long", toy, 10)
    sequences = {take.take_id: take for take in pool_of(PROTOCOLS["stylebench-transfer@1/long"], toy).extra}
    frames = Counter(sequences[task.content_take_id].clip.n_frames for task in tasks)
    assert frames == {1000: 8, 3600: 2}
    for task in tasks:
        starts = [start for start, _ in task.segments]
        assert starts[0] == 0 and starts == sorted(starts)
        contents = [content for _, content in task.segments]
        assert all(a != b for a, b in pairwise(contents))
        assert task.source_style != task.target_style


def test_long_sequences_need_no_second_dataset(toy: Dataset) -> None:
    split = deal(toy.takes)
    by_part = {part: split.select(toy.takes, part) for part in PARTS}
    assert [t.take_id for t in long_sequences(by_part, None, 1)] == [
        t.take_id for t in long_sequences(by_part, None, 1)
    ]


def test_foreign_contents_come_from_the_other_dataset_and_are_shared(toy: Dataset) -> None:
    for task in tasks_of("stylebench-transfer@1/foreign", toy):
        assert task.content_take_id.startswith("other:") and not task.style_take_id.startswith("other:")
        assert task.content in ("run", "walk") and task.target_style in STYLES


def test_foreign_needs_another_dataset_with_a_content_in_common(toy: Dataset) -> None:
    make = PROTOCOLS["stylebench-transfer@1/foreign"].extra_takes
    assert make is not None
    with pytest.raises(BadData, match="there is only one"):
        make({"test": toy.takes}, None, 0)
    with pytest.raises(BadData, match="no content in common with other@1"):
        make({"test": toy.takes}, dataset("other", ("swim",)), 0)


def test_parts_go_round_within_a_pair(toy: Dataset) -> None:
    tasks = tasks_of("stylebench-parts@1", toy)
    assert [task.part for task in tasks[:4]] == ["legs", "arms", "spine", "all"]
    assert len({task.group for task in tasks}) == 10


def test_interpolation_groups_rise_in_weight_and_half_start_from_a_third_style(toy: Dataset) -> None:
    tasks = tasks_of("stylebench-interpolation@1", toy)
    by_id = {take.take_id: take for take in toy.takes}
    for number in range(8):
        group = tasks[5 * number : 5 * number + 5]
        assert [task.weight for task in group] == [0.0, 0.25, 0.5, 0.75, 1.0]
        starts = {task.start_take_id for task in group}
        assert len(starts) == 1
        assert bool(starts.pop()) == bool(number % 2)
        for task in group:
            if task.start_take_id:
                assert by_id[task.start_take_id].style not in (task.source_style, task.target_style)


def test_prediction_has_a_second_on_both_sides(toy: Dataset) -> None:
    by_id = {take.take_id: take for take in toy.takes}
    for task in tasks_of("stylebench-prediction@1", toy):
        frames = by_id[task.content_take_id].clip.n_frames
        assert 30 <= task.start_frame <= frames - 30 and task.n_frames == 1
        assert by_id[task.style_take_id].style == task.source_style


def test_prediction_refuses_short_takes(toy: Dataset) -> None:
    short = [replace(take, clip=random_clip(50, seed=1)) for take in toy.takes[:40]]
    with pytest.raises(BadData, match="more than 2 s"):
        PROTOCOLS["stylebench-prediction@1"].make_tasks(TaskPool(short), 4, 0)


@pytest.mark.parametrize("label", ["park2021@1/table2-neutral", "style_erd@1/table1-neutral"])
def test_neutral_sources_only(label: str, toy: Dataset) -> None:
    assert {task.source_style for task in tasks_of(label, toy)} == {"neutral"}


def test_papers_stylise_the_half_they_say(toy: Dataset) -> None:
    part_of = deal(toy.takes).part_of
    for label, parts in (("park2021@1/table2", {"fit", "test", "real"}), ("park2021@1/table2-cls", {"judge"})):
        assert {part_of[task.content_take_id] for task in tasks_of(label, toy, 200)} == parts


def test_a_neutral_style_must_be_there() -> None:
    assert neutral_style(["old", "normal"]) == "normal"
    with pytest.raises(BadData, match="no neutral style among angry, old"):
        neutral_style(["old", "angry"])


def test_only_differences_from_the_default_are_written() -> None:
    task = Task("s0", "a", 0, "b", "walk", "old", "angry", "run", 1)
    assert set(task.as_dict()) == {
        "sample_id", "content_take_id", "start_frame", "style_take_id", "content", "source_style", "target_style",
        "reference_content", "seed",
    }  # fmt: skip
    assert Task.from_dict(task.as_dict()) == task
    assert np.isclose(task.weight, 1.0)
