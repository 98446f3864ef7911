from __future__ import annotations

import numpy as np
import pytest

from bench.adapters.gesture_oracles import (
    GESTURE_ORACLES,
    GestureImitation,
    GestureTruth,
    RealAnswer,
    TakeToTake,
    WholeStyle,
)
from bench.adapters.oracles import World
from bench.datasets.joined import joined_take
from bench.datasets.procedural import imitated, true_answer
from bench.datasets.procedural.dataset import performance_of
from bench.datasets.procedural.performance import render
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton
from tests.motion.factory import person, random_clip

SKELETON = person()


def sequence(scenario: str, style: str, seed: int, *, skeleton: Skeleton = SKELETON, n_frames: int = 30) -> Take:
    pieces = [
        Take(random_clip(n_frames, seed=seed + i, skeleton=skeleton), f"{seed}-{i}", "toy", "wave", style)
        for i in range(2)
    ]
    return joined_take(f"{scenario}/{style}", pieces, skeleton, 60.0, content=scenario)


CONTENT, STYLE = sequence("scenario-00", "neutral", 0), sequence("scenario-01", "old", 10, n_frames=40)
WORLD = World(
    fit=[sequence(f"scenario-0{i}", style, 100 * i + 20) for i in range(2) for style in ("neutral", "old")],
    disjoint=(),
)


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def test_whole_style_keeps_the_styles_length_on_the_contents_bones() -> None:
    big = sequence("scenario-01", "old", 10, skeleton=person(1.2), n_frames=40)
    answer = WholeStyle().answer(CONTENT, 0, big, WORLD, rng=rng())
    assert answer.clip.n_frames == big.clip.n_frames != CONTENT.clip.n_frames
    assert answer.clip.skeleton.same_bones(CONTENT.clip.skeleton)
    np.testing.assert_allclose(answer.clip.rotations_wxyz, big.clip.rotations_wxyz, atol=1e-15)


def test_real_answer_has_the_contents_scenario_in_the_target_style() -> None:
    answer = RealAnswer().answer(CONTENT, 0, STYLE, WORLD, rng=rng())
    assert (answer.content, answer.style) == ("scenario-00", "old")
    assert answer.take_id in {take.take_id for take in WORLD.fit}


def test_take_to_take_has_the_contents_own_labels() -> None:
    answer = TakeToTake().answer(CONTENT, 0, STYLE, WORLD, rng=rng())
    assert (answer.content, answer.style) == ("scenario-00", "neutral")
    assert answer.take_id != CONTENT.take_id


def test_a_scenario_that_was_not_performed_is_refused() -> None:
    other = sequence("scenario-07", "neutral", 0)
    with pytest.raises(BadData, match="the fit part has no sequence of scenario-07 in old"):
        RealAnswer().answer(other, 0, STYLE, WORLD, rng=rng())


@pytest.fixture(scope="module")
def procedural_world() -> World:
    takes = {}
    for take_id in ("gesture-wave_neutral_001", "gesture-point_neutral_002"):
        performance = performance_of(take_id)
        content, style, _ = take_id.split("_")
        takes[take_id] = Take(render(performance, style), take_id, "procedural", content, style)
    return World(fit=(), disjoint=(), takes=takes, true_answer=true_answer, performed_by=imitated)


@pytest.fixture(scope="module")
def procedural_content(procedural_world: World) -> Take:
    return joined_take("scenario-00/neutral", list(procedural_world.takes.values()), SKELETON, 60.0, content="s")


def turned(answer: Clip, source: Clip) -> float:
    """Mean angle between joint rotations, radians."""
    return float(quat.angle_between(answer.rotations_wxyz, source.rotations_wxyz).mean())


def test_truth_in_the_sources_own_style_is_the_source(procedural_world: World, procedural_content: Take) -> None:
    style = sequence("scenario-01", "neutral", 10)
    answer = GestureTruth().answer(procedural_content, 0, style, procedural_world, rng=rng())
    assert turned(answer.clip, procedural_content.clip) < 1e-9
    np.testing.assert_allclose(answer.clip.root_xyz_m, procedural_content.clip.root_xyz_m, atol=1e-9)


def test_truth_keeps_the_timing_and_changes_the_style(procedural_world: World, procedural_content: Take) -> None:
    answer = GestureTruth().answer(procedural_content, 0, STYLE, procedural_world, rng=rng())
    assert (answer.content, answer.style) == ("s", "old")
    assert answer.clip.n_frames == procedural_content.clip.n_frames
    assert 0.02 < turned(answer.clip, procedural_content.clip) < 0.5


def test_imitation_is_another_performance_of_the_truth(procedural_world: World, procedural_content: Take) -> None:
    truth = GestureTruth().answer(procedural_content, 0, STYLE, procedural_world, rng=rng())
    answer = GestureImitation().answer(procedural_content, 0, STYLE, procedural_world, rng=rng())
    again = GestureImitation().answer(procedural_content, 0, STYLE, procedural_world, rng=np.random.default_rng(1))
    assert answer.clip.skeleton.same_bones(procedural_content.clip.skeleton)
    assert 0.01 < turned(answer.clip, truth.clip) < 0.3
    np.testing.assert_array_equal(answer.clip.rotations_wxyz, again.clip.rotations_wxyz)


@pytest.mark.parametrize(("oracle", "what"), [(GestureTruth, "true answers"), (GestureImitation, "imitations")])
def test_captured_gestures_have_neither(oracle: type[GestureTruth] | type[GestureImitation], what: str) -> None:
    with pytest.raises(BadData, match=f"{what} exist for the procedural dataset only"):
        oracle().answer(CONTENT, 0, STYLE, WORLD, rng=rng())
    assert oracle.needs_truth


def test_rows_belong_to_the_gesture_track() -> None:
    assert {oracle.tracks for oracle in GESTURE_ORACLES} == {("gesture",)}
    assert len({oracle.name for oracle in GESTURE_ORACLES}) == 5
