from __future__ import annotations

from collections import Counter
from itertools import pairwise, product

import pytest

from bench.datasets.split import KINDS, PARTS, SEQUENCE, deal, leak
from bench.datasets.take import Take
from bench.errors import BadConfig, BadData
from tests.motion.factory import random_clip

CONTENTS, STYLES = ("jump", "run", "walk"), ("angry", "neutral", "old")


def takes(per_cell: int = 20) -> list[Take]:
    """Labelled takes, all different."""
    return [
        Take(
            random_clip(8, seed=number + 100 * place, amount_rad=0.1),
            f"{content}_{style}_{number:03d}",
            "toy",
            content,
            style,
        )
        for place, (content, style) in enumerate(product(CONTENTS, STYLES))
        for number in range(per_cell)
    ]


def test_sequence_has_the_shares_and_no_long_gap() -> None:
    assert Counter(SEQUENCE) == {"judge": 8, "fit": 6, "test": 3, "real": 3}
    for start in range(20):
        neighbours = {SEQUENCE[(start + k) % 20] for k in range(4)}
        assert {"judge", "fit"} <= neighbours


@pytest.mark.parametrize("kind", KINDS)
def test_every_take_is_in_exactly_one_part(kind: str) -> None:
    all_takes = takes()
    split = deal(all_takes, kind=kind)
    parts = [take.take_id for part in PARTS for take in split.select(all_takes, part)]
    assert sorted(parts) == sorted(take.take_id for take in all_takes)


def test_blocks_of_three_neighbours_stay_together() -> None:
    split = deal(takes())
    for content in CONTENTS:
        for style in STYLES:
            parts = [split.part_of[f"{content}_{style}_{number:03d}"] for number in range(18)]
            assert all(len(set(parts[k : k + 3])) == 1 for k in range(0, 18, 3))


def test_later_takes_move_nothing() -> None:
    before, after = deal(takes(20)), deal(takes(31))
    assert all(after.part_of[take_id] == part for take_id, part in before.part_of.items())


def test_contiguous_parts_are_runs() -> None:
    split = deal(takes(20), kind="contiguous")
    parts = [split.part_of[f"walk_old_{number:03d}"] for number in range(20)]
    changes = sum(a != b for a, b in pairwise(parts))
    assert changes == 3 and Counter(parts) == {"judge": 8, "fit": 6, "test": 3, "real": 3}


def test_seed_changes_the_split_and_the_digest() -> None:
    assert deal(takes(), seed=0).digest == deal(takes(), seed=0).digest
    assert deal(takes(), seed=0).digest != deal(takes(), seed=1).digest


def test_too_few_takes_are_refused_by_name() -> None:
    with pytest.raises(BadData, match="part has no take of content"):
        deal(takes(1)[:5])


def test_unlabelled_takes_and_unknown_kinds_are_refused() -> None:
    with pytest.raises(BadData, match="'x' lacks one"):
        deal([Take(random_clip(8), "x")])
    with pytest.raises(BadConfig, match="unknown split kind 'random'"):
        deal(takes(), kind="random")
    with pytest.raises(BadConfig, match="unknown part"):
        deal(takes()).select(takes(), "train")


def test_leak_of_independent_takes_is_near_chance() -> None:
    all_takes = takes(24)
    found = leak(all_takes, deal(all_takes))
    assert 0.5 < found.chance < 0.9
    assert abs(found.share - found.chance) < 0.25
    assert found.n > 0


def test_leak_of_duplicated_takes_is_seen() -> None:
    originals = takes(24)
    twins = [
        take.with_clip(originals[index - index % 2].clip) for index, take in enumerate(originals)
    ]  # each take has an identical neighbour
    split = deal(twins, kind="interleaved")
    expected = [
        split.part_of[twins[index + (1 if index % 2 == 0 else -1)].take_id] in ("judge", "fit")
        for index, take in enumerate(twins)
        if split.part_of[take.take_id] == "test"
    ]
    assert leak(twins, split).share == pytest.approx(sum(expected) / len(expected))
