from __future__ import annotations

from collections import Counter

import pytest

from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import TaskPool, stable_seed
from bench.protocols.transfer import make_tasks
from tests.motion.factory import random_clip

CONTENTS, STYLES = ("jump", "run", "walk"), ("angry", "neutral", "old")


def takes() -> list[Take]:
    return [
        Take(random_clip(40 + 30 * number, seed=number), f"{content}_{style}_{number}", "toy", content, style)
        for content in CONTENTS
        for style in STYLES
        for number in range(3)
    ]


def pool(of: list[Take] | None = None) -> TaskPool:
    return TaskPool(of or takes())


def test_the_longer_list_begins_with_the_shorter() -> None:
    assert make_tasks(pool(), 200, 7)[:60] == make_tasks(pool(), 60, 7)


def test_order_of_takes_does_not_matter_and_the_seed_does() -> None:
    assert make_tasks(pool(takes()[::-1]), 60, 7) == make_tasks(pool(), 60, 7)
    assert make_tasks(pool(), 60, 8) != make_tasks(pool(), 60, 7)


def test_target_style_is_never_the_sources() -> None:
    by_id = {take.take_id: take for take in takes()}
    for task in make_tasks(pool(), 300, 0):
        source, reference = by_id[task.content_take_id], by_id[task.style_take_id]
        assert task.target_style != task.source_style
        assert (source.content, source.style) == (task.content, task.source_style)
        assert (reference.content, reference.style) == (task.reference_content, task.target_style)


def test_contents_take_turns_and_every_fifth_round_shares_the_content() -> None:
    tasks = make_tasks(pool(), 300, 0)
    assert set(Counter(task.content for task in tasks).values()) == {100}
    assert sum(task.same_content for task in tasks) == 60


def test_windows_lie_inside_their_takes() -> None:
    by_id = {take.take_id: take for take in takes()}
    for task in make_tasks(pool(), 300, 0):
        spare = by_id[task.content_take_id].clip.n_frames - 64
        assert 0 <= task.start_frame <= max(spare, 0)


def test_one_style_or_one_content_is_refused() -> None:
    with pytest.raises(BadData, match="at least 2 styles and 2 contents"):
        make_tasks(pool([take for take in takes() if take.style == "old"]), 10, 0)


def test_stable_seed_is_the_same_everywhere() -> None:
    assert stable_seed("a", "b") == 6716935227060484305
    assert stable_seed("a", "b") != stable_seed("b", "a")
