from __future__ import annotations

from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

from bench.datasets.procedural import performed_by, true_answer, unseen_takes
from bench.datasets.procedural.actors import ACTORS, make_actor
from bench.datasets.procedural.dataset import TAKES_PER_CELL, digest, load, performance_of
from bench.datasets.procedural.performance import CONTENTS, render
from bench.datasets.procedural.styles import STYLES
from bench.errors import BadConfig, BadInput
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.kinematics import FOOT_JOINTS, world_positions

ON_FLOOR_M = 1e-4
DIGEST = "903e55a46939db0e05d324eca44bdda4"
HEAD_OF_KICK_OLD_003 = [
    [0.0037152846, 1.3861712429, 0.1198348709],
    [0.1327890281, 1.3605644720, 0.2337166949],
    [0.1230674539, 1.3553621970, 0.2479187838],
]
SOME = [f"{content}_{style}_{number:03d}" for content, (style, number) in zip(
    sorted(CONTENTS), product(sorted(STYLES), (1, 5)), strict=False
)]  # fmt: skip


def clip_of(take_id: str) -> Clip:
    return render(performance_of(take_id), take_id.split("_")[1])


@pytest.mark.parametrize("take_id", SOME)
def test_planted_feet_do_not_slide(take_id: str) -> None:
    """A toe that is on the floor in two neighbouring frames has moved by less than a millimetre."""
    feet = world_positions(clip_of(take_id))[:, FOOT_JOINTS]
    for foot in (1, 3):
        planted = feet[:, foot, 1] < ON_FLOOR_M
        held = planted[1:] & planted[:-1]
        steps = np.linalg.norm(np.diff(feet[:, foot], axis=0), axis=-1)
        assert not held.any() or steps[held].max() < 1e-3
    assert (feet[..., 1].min(axis=1) < ON_FLOOR_M).mean() > 0.3


@pytest.mark.parametrize("take_id", SOME)
def test_nothing_is_below_the_floor_and_bones_are_rigid(take_id: str) -> None:
    clip = clip_of(take_id)
    positions = world_positions(clip)
    assert positions[..., 1].min() > -1e-3
    bones = np.linalg.norm(positions[:, 1:] - positions[:, clip.skeleton.parents[1:]], axis=-1)
    assert np.ptp(bones, axis=0).max() < 1e-9


@pytest.mark.parametrize("take_id", SOME)
def test_motion_is_smooth(take_id: str) -> None:
    clip = clip_of(take_id)
    acceleration = np.diff(clip.root_xyz_m, n=2, axis=0) * clip.fps**2
    assert np.linalg.norm(acceleration, axis=-1).max() < 40.0
    turns = quat.angle_between(clip.rotations_wxyz[1:], clip.rotations_wxyz[:-1])
    assert turns.max() < 1.0
    assert np.isfinite(clip.rotations_wxyz).all() and np.isfinite(clip.root_xyz_m).all()
    # The same turn has two quaternions; neighbouring frames use the same one.
    assert np.sum(clip.rotations_wxyz[1:] * clip.rotations_wxyz[:-1], axis=-1).min() > 0.0


@pytest.mark.parametrize("take_id", SOME)
def test_the_truth_in_its_own_style_is_the_take(take_id: str) -> None:
    clip = clip_of(take_id)
    n_frames = min(32, clip.n_frames - 3)
    truth = true_answer(take_id, 3, n_frames, take_id.split("_")[1])
    np.testing.assert_array_equal(truth.rotations_wxyz, window(clip, 3, n_frames).rotations_wxyz)


def test_the_truth_has_the_sources_timing() -> None:
    """Over styles, the feet of one walk leave the floor within a few frames of each other."""
    lifts = []
    for style in sorted(STYLES):
        truth = true_answer("walk_neutral_001", 0, 64, style)
        toe = world_positions(truth)[:, FOOT_JOINTS[1], 1]
        lifted = (toe > 0.01).astype(float)
        lifts.append(lifted - lifted.mean())
    for lifted in lifts[1:]:
        correlation = np.correlate(lifted, lifts[0], mode="full")
        assert abs(int(np.argmax(correlation)) - 63) <= 6


def test_generation_is_deterministic_and_stays_what_it_is() -> None:
    """Reference positions of the head, metres; they change only with a new generator version."""
    first, second = clip_of("kick_old_003"), clip_of("kick_old_003")
    np.testing.assert_array_equal(first.rotations_wxyz, second.rotations_wxyz)
    head = world_positions(first)[[0, 20, 40], 12]
    np.testing.assert_allclose(head, HEAD_OF_KICK_OLD_003, atol=1e-6)
    assert digest() == DIGEST


def test_the_digest_changes_with_any_parameter_of_a_style_or_content(monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setitem(STYLES, "old", replace(STYLES["old"], limp=0.33))
        assert digest() != DIGEST
    with monkeypatch.context() as patch:
        patch.setitem(CONTENTS, "walk", replace(CONTENTS["walk"], cycles_per_s=0.93))
        assert digest() != DIGEST
    assert digest() == DIGEST


def test_actors_differ_in_body_and_are_who_they_are() -> None:
    statures = [make_actor(name).skeleton.stature_m for name in ACTORS]
    assert max(statures) - min(statures) > 0.15
    assert make_actor("somebody").skeleton.same_bones(make_actor("somebody").skeleton, 0.0)
    assert {performance_of(f"run_sexy_{n:03d}").actor.name for n in range(1, TAKES_PER_CELL + 1)} == set(ACTORS)


def test_an_imitation_is_the_same_task_by_another_body() -> None:
    actor = make_actor("imitator")
    done = performed_by("gesture-wave_neutral_002", "proud", actor)
    assert done.skeleton.same_bones(actor.skeleton, 0.0)
    assert done.n_frames == performance_of("gesture-wave_neutral_002").n_frames


def test_unseen_takes_have_every_label_and_no_known_actor() -> None:
    takes = unseen_takes(takes_per_cell=1)
    assert {(take.content, take.style) for take in takes} == set(product(CONTENTS, STYLES))
    assert not {take.actor for take in takes} & set(ACTORS)


@pytest.mark.parametrize("take_id", ["walk_neutral_999", "walk_grumpy_001", "swim_neutral_001", "nonsense"])
def test_unknown_takes_are_refused(take_id: str) -> None:
    with pytest.raises(BadInput, match="no take"):
        performance_of(take_id)
    with pytest.raises(BadInput, match="unknown style 'grumpy'"):
        true_answer("walk_neutral_001", 0, 10, "grumpy")


def test_a_window_outside_the_take_and_a_path_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadInput):
        true_answer("walk_neutral_001", 100, 1000, "old")
    with pytest.raises(BadConfig, match="takes no path"):
        load(tmp_path)


@pytest.mark.slow
def test_the_whole_dataset_is_complete_and_cached(tmp_path_factory: pytest.TempPathFactory) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("STYLEBENCH_CACHE", str(tmp_path_factory.mktemp("cache")))
        dataset, again = load(None), load(None)
    cells = {(take.content, take.style) for take in dataset.takes}
    assert len(dataset.takes) == len(cells) * TAKES_PER_CELL == 960 and cells == set(product(CONTENTS, STYLES))
    short = {take.actor for take in dataset.takes if take.clip.n_frames < 64}
    assert len(short) >= 2
    for take, twin in zip(dataset.takes, again.takes, strict=True):
        assert take.take_id == twin.take_id
        np.testing.assert_allclose(take.clip.rotations_wxyz, twin.clip.rotations_wxyz, atol=1e-12)
