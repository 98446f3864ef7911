from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.arrays import BoolArray, FloatArray
from bench.datasets import bandai_namco
from bench.datasets import procedural as generated
from bench.errors import BadInput, BadMotion
from bench.metrics.contacts import foot_skate
from bench.metrics.physics import jerk_per_sample
from bench.motion.cleanup import ABERMAN_IK, IK_SETTINGS, PUZZLE_IK, IkSettings, planted_feet, remove_foot_skate
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.kinematics import FOOT_JOINTS, world_positions
from bench.motion.skeleton import Skeleton
from tests.motion.factory import random_clip

SLIDE_M_S = 0.1
SETTINGS = pytest.mark.parametrize("settings", IK_SETTINGS.values(), ids=IK_SETTINGS)


@pytest.fixture(scope="module")
def procedural() -> list[Clip]:
    takes = generated.load(None).takes
    return [window(take.clip, 0, 64) for take in takes[:: len(takes) // 30]]


@pytest.fixture(scope="module")
def captured(bandai_namco_zip: Path) -> list[Clip]:
    takes = bandai_namco.load(bandai_namco_zip).takes
    return [window(take.clip, 0, 64) for take in takes[:: len(takes) // 60]]


def slid(clip: Clip, speed_m_s: float = SLIDE_M_S) -> Clip:
    root = clip.root_xyz_m.copy()
    root[:, 2] += speed_m_s * np.arange(clip.n_frames) / clip.fps
    return clip.with_motion(clip.rotations_wxyz, root)


def skate(clip: Clip) -> float:
    return float(foot_skate(world_positions(clip)[None], clip.fps, FOOT_JOINTS)[0])


def jerk(clip: Clip) -> float:
    return float(jerk_per_sample(world_positions(clip)[None], clip.fps)[0])


def moved_m(before: Clip, after: Clip) -> FloatArray:
    """``[T, 4]`` how far each foot joint was moved."""
    feet = [world_positions(clip)[:, FOOT_JOINTS] for clip in (before, after)]
    return np.asarray(np.linalg.norm(feet[1] - feet[0], axis=-1))


def unplanted(planted: BoolArray, settings: IkSettings, fps: float) -> BoolArray:
    """``[T, 4]`` joints of feet that stand nowhere within the blending frames."""
    feet = np.asarray(planted.reshape(-1, 2, 2).any(axis=2))
    reach = 2 * round(settings.blend_s * fps) + 1
    near = np.stack([np.convolve(foot, np.ones(reach), "same") > 0 for foot in feet.T], axis=1)
    return np.repeat(~near, 2, axis=1)


@SETTINGS
@pytest.mark.parametrize("data", ["procedural", "captured"])
def test_sliding_is_removed_and_nothing_else_pays(
    data: str, settings: IkSettings, request: pytest.FixtureRequest
) -> None:
    removed, rougher = [], []
    for source in request.getfixturevalue(data):
        planted = planted_feet(source, settings)
        before = slid(source)
        after = remove_foot_skate(before, settings, planted)
        if np.isfinite(skate(before)) and skate(before) > skate(source) + 5.0:
            removed.append(1.0 - skate(after) / skate(before))
        rougher.append(jerk(after) / jerk(before))
        assert after.skeleton is before.skeleton
        np.testing.assert_array_equal(after.root_xyz_m, before.root_xyz_m)
        np.testing.assert_allclose(after.rotations_wxyz[:, 9:], before.rotations_wxyz[:, 9:], atol=1e-12)
        assert moved_m(before, after)[unplanted(planted, settings, source.fps)].max(initial=0.0) < 1e-9
    assert len(removed) >= 15 and np.mean(removed) >= 0.8 and np.median(removed) >= 0.95
    assert np.mean(rougher) <= 1.2


@SETTINGS
def test_a_standing_figure_that_slides_stops_by_its_own_contacts(settings: IkSettings) -> None:
    clip = random_clip(64, amount_rad=0.0)
    root = np.tile([0.0, 0.94, 0.0], (64, 1))
    crouched = clip.rotations_wxyz.copy()
    for leg, knee, ankle in ((1, 2, 3), (5, 6, 7)):
        for joint, half in ((leg, -0.2), (knee, 0.4), (ankle, -0.2)):
            crouched[:, joint] = [np.cos(half / 2), np.sin(half / 2), 0.0, 0.0]
    before = slid(clip.with_motion(crouched, root))
    after = remove_foot_skate(before, settings)
    assert skate(before) == pytest.approx(10.0)
    assert skate(after) < 0.5
    assert jerk(after) < 5.0


def test_bones_keep_their_lengths(procedural: list[Clip]) -> None:
    source = procedural[0]
    after = world_positions(remove_foot_skate(slid(source), ABERMAN_IK, planted_feet(source, ABERMAN_IK)))
    lengths = np.linalg.norm(after[:, 1:] - after[:, list(source.skeleton.parents[1:])], axis=-1)
    np.testing.assert_allclose(lengths, np.tile(source.skeleton.bone_lengths_m[1:], (64, 1)), atol=1e-9)


@SETTINGS
def test_feet_that_never_stand_are_left_alone(settings: IkSettings) -> None:
    clip = random_clip(50, seed=3)
    after = remove_foot_skate(clip, settings, np.zeros((50, 4), dtype=bool))
    np.testing.assert_allclose(after.rotations_wxyz, clip.rotations_wxyz, atol=1e-12)


def test_planted_toes_go_to_the_floor_where_asked() -> None:
    clip = random_clip(64, amount_rad=0.0)
    still = clip.with_motion(clip.rotations_wxyz, np.tile([0.0, 1.2, 0.0], (64, 1)))
    lifted = still.rotations_wxyz.copy()
    lifted[:, 1] = [np.cos(-0.1), np.sin(-0.1), 0.0, 0.0]
    before = still.with_motion(lifted, still.root_xyz_m)
    height = {
        settings.name: world_positions(remove_foot_skate(before, settings))[:, 4, 1].mean()
        for settings in (ABERMAN_IK, PUZZLE_IK)
    }
    was, other = world_positions(before)[0, 4, 1], world_positions(before)[0, 8, 1]
    assert height["puzzle-ik"] == pytest.approx(was, abs=1e-6)
    assert abs(height["aberman-ik"] - other) < abs(was - other)


def test_thresholds_are_the_papers_in_metres_and_seconds() -> None:
    speeds = {name: settings.max_speed_m_s for name, settings in IK_SETTINGS.items()}
    assert speeds == pytest.approx({"aberman-ik": 0.3786, "park-ik": 0.3786, "puzzle-ik": 0.7573}, abs=1e-4)
    assert PUZZLE_IK.max_height_m == pytest.approx((0.1693, 0.1129), abs=1e-4)
    assert [settings.damping_m for settings in IK_SETTINGS.values()] == pytest.approx(
        [0.2258, 0.1129, 0.2822], abs=1e-4
    )


def test_what_does_not_fit_is_refused() -> None:
    clip = random_clip(20)
    with pytest.raises(BadInput, match=r"planted must have shape \[20, 4\], got \[19, 4\]"):
        remove_foot_skate(clip, ABERMAN_IK, np.zeros((19, 4), dtype=bool))
    two = Skeleton(("a", "b"), (-1, 0), np.array([[0.0, 0.0, 0.0], [0.0, 1.0, 0.0]]))
    other = Clip(two, np.tile([1.0, 0.0, 0.0, 0.0], (20, 2, 1)), np.zeros((20, 3)), 30.0)
    with pytest.raises(BadMotion, match="canonical 21 joints"):
        planted_feet(other, ABERMAN_IK)
