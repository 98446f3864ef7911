from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np
import pytest

from bench.datasets.joined import piece_ids
from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import Protocol, TaskPool
from bench.protocols.gesture import GESTURE, inter_tasks, intra_tasks, make_tasks
from bench.protocols.kuriyama2022 import TABLE_1, TABLE_2, TABLE_3, TABLE_4
from bench.protocols.scenarios import (
    FPS,
    LONGEST_S,
    N_SCENARIOS,
    SHORTEST_S,
    evaluation_sequences,
    scenarios,
    training_sequences,
)
from tests.motion.factory import person, random_clip

CONTENTS = ("gesture-clap", "gesture-point", "raise-up-left-hand", "wave-both-hands", "walk")
STYLES = ("angry", "neutral", "old")
PARTS = {"judge": 3, "fit": 3, "test": 1, "real": 1}

Parts = Mapping[str, Sequence[Take]]


def toy_parts(n_frames: int = 100) -> dict[str, list[Take]]:
    """A few takes of 4 gestures and a walk, by people of two sizes, in every part."""
    parts: dict[str, list[Take]] = {part: [] for part in PARTS}
    for content in CONTENTS:
        for style in STYLES:
            number = 0
            for part, n in PARTS.items():
                for _ in range(n):
                    skeleton = person(1.0 + 0.1 * (number % 2))
                    clip = random_clip(n_frames + 7 * number, seed=number, skeleton=skeleton)
                    parts[part].append(Take(clip, f"{content}_{style}_{number}", "toy", content, style))
                    number += 1
    return parts


@pytest.fixture(scope="module")
def evaluation() -> list[Take]:
    return evaluation_sequences(toy_parts(), None, 0)


@pytest.fixture(scope="module")
def training() -> list[Take]:
    return training_sequences(toy_parts(), None, 0)


def test_every_scenario_is_there_neutral_and_in_its_own_style(evaluation: list[Take]) -> None:
    by_scenario = Counter(take.content for take in evaluation)
    assert len(by_scenario) == N_SCENARIOS and set(by_scenario.values()) == {2}
    assert Counter(take.style for take in evaluation) == {"neutral": 15, "angry": 8, "old": 7}


def test_training_has_every_scenario_in_every_style(training: list[Take], evaluation: list[Take]) -> None:
    assert len({(take.content, take.style) for take in training}) == len(training) == N_SCENARIOS * len(STYLES)
    assert {take.content for take in training} == {take.content for take in evaluation}


def test_sequences_last_20_to_36_s_at_60_fps_on_one_skeleton(training: list[Take], evaluation: list[Take]) -> None:
    for take in (*training, *evaluation):
        assert take.clip.fps == FPS
        assert SHORTEST_S <= take.clip.duration_s <= LONGEST_S
        assert take.clip.skeleton.same_bones(evaluation[0].clip.skeleton)


def test_parts_do_not_mix_and_no_take_recurs_within_a_sequence(training: list[Take], evaluation: list[Take]) -> None:
    fit = {take.take_id for take in toy_parts()["fit"]}
    for take in (*training, *evaluation):
        pieces = piece_ids(take.take_id)
        assert len(set(pieces)) == len(pieces)
    assert {piece for take in training for piece in piece_ids(take.take_id)} <= fit
    assert not {piece for take in evaluation for piece in piece_ids(take.take_id)} & fit


def test_sequences_perform_the_scenarios_list_in_their_style(training: list[Take], evaluation: list[Take]) -> None:
    by_id = {take.take_id: take for takes in toy_parts().values() for take in takes}
    listed = {scenario.name: scenario.contents for scenario in scenarios(toy_parts())}
    for take in (*training, *evaluation):
        pieces = [by_id[piece] for piece in piece_ids(take.take_id)]
        assert tuple(piece.content for piece in pieces) == listed[str(take.content)]
        assert {piece.style for piece in pieces} == {take.style}
        assert take.take_id.startswith(f"{take.content}/{take.style}:")
        assert take.clip.n_frames == sum(2 * piece.clip.n_frames - 1 for piece in pieces)


def test_lists_differ_and_have_no_gesture_twice_in_a_row() -> None:
    lists = [scenario.contents for scenario in scenarios(toy_parts())]
    assert len(set(lists)) == N_SCENARIOS
    assert all(left != right for contents in lists for left, right in pairwise(contents))
    assert {content for contents in lists for content in contents} == set(CONTENTS) - {"walk"}


def test_sequences_depend_on_the_takes_alone(evaluation: list[Take]) -> None:
    backwards = {part: takes[::-1] for part, takes in reversed(toy_parts().items())}
    again = evaluation_sequences(backwards, None, 7)
    assert [take.take_id for take in again] == [take.take_id for take in evaluation]
    for one, other in zip(again, evaluation, strict=True):
        np.testing.assert_array_equal(one.clip.rotations_wxyz, other.clip.rotations_wxyz)


def without(parts: Parts, **labels: str) -> dict[str, list[Take]]:
    """The parts without takes that have all these labels."""
    return {
        part: [take for take in takes if any(getattr(take, key) != value for key, value in labels.items())]
        for part, takes in parts.items()
    }


def test_data_without_gestures_is_refused() -> None:
    parts = {part: [take for take in takes if take.content == "walk"] for part, takes in toy_parts().items()}
    with pytest.raises(BadData, match=r"got 0 in 0 styles.*start with gesture-, raise-up-, wave-.*leave the gesture"):
        evaluation_sequences(parts, None, 0)


def test_a_gesture_that_one_style_lacks_is_left_out() -> None:
    found = scenarios(without(toy_parts(150), content="gesture-clap", style="old"))
    assert {content for scenario in found for content in scenario.contents} == set(CONTENTS) - {"gesture-clap", "walk"}


def test_takes_that_are_too_short_are_refused() -> None:
    with pytest.raises(BadData, match=r"scenario-00: no further list of gestures.*too few or too short takes"):
        training_sequences(toy_parts(20), None, 0)


def test_data_without_a_neutral_style_is_refused() -> None:
    parts = without(toy_parts(), style="neutral")
    with pytest.raises(BadData, match="no neutral style among angry, old"):
        evaluation_sequences(parts, None, 0)


def test_intra_tasks_come_first_and_every_pair_once(evaluation: list[Take]) -> None:
    pool = TaskPool((), evaluation)
    tasks = make_tasks(pool, 225, 3)
    assert [task.same_content for task in tasks] == [True] * 15 + [False] * 210
    assert len({(task.content, task.reference_content) for task in tasks}) == 225
    assert [task.content for task in tasks[:15]] == sorted({str(take.content) for take in evaluation})
    assert make_tasks(pool, 45, 3) == tasks[:45]
    assert intra_tasks(pool, 3, 3) == tasks[:3]
    assert inter_tasks(pool, 210, 3) == tasks[15:]
    assert make_tasks(pool, 225, 4) != tasks


def test_tasks_name_sequences_and_their_labels(evaluation: list[Take]) -> None:
    by_id = {take.take_id: take for take in evaluation}
    for task in make_tasks(TaskPool((), evaluation), 225, 0):
        content, style = by_id[task.content_take_id], by_id[task.style_take_id]
        assert (content.content, content.style) == (task.content, task.source_style) and task.source_style == "neutral"
        assert (style.content, style.style) == (task.reference_content, task.target_style)
        assert task.target_style != "neutral" and task.n_frames == 0
        assert task.group == ("slice:intra" if task.same_content else "slice:inter")


def test_a_pool_without_all_sequences_is_refused(evaluation: list[Take]) -> None:
    with pytest.raises(BadData, match="expected 15 scenarios on both sides, got 14 contents"):
        make_tasks(TaskPool((), [take for take in evaluation if take.take_id != evaluation[0].take_id]), 3, 0)


@pytest.mark.parametrize("protocol", [GESTURE, TABLE_1, TABLE_2, TABLE_3, TABLE_4], ids=lambda p: p.label)
def test_every_profile_has_its_number_of_tasks(protocol: Protocol, evaluation: list[Take]) -> None:
    for n in protocol.n_samples.values():
        assert len(protocol.make_tasks(TaskPool((), evaluation), n, 0)) == n
