from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput
from bench.motion import quat
from bench.motion.edit import crop
from bench.motion.holden_features import HOLDEN_SLICES, N_FEATURES, clip_from_holden, holden_features
from bench.motion.kinematics import yaw_aligned
from tests.motion.factory import person, random_clip


@pytest.mark.parametrize("n_frames", [1, 2, 40])
def test_round_trip(n_frames: int) -> None:
    clip = crop(random_clip(amount_rad=0.8), 0, n_frames)
    features, start = holden_features(clip)
    assert features.shape == (n_frames, N_FEATURES) == (n_frames, 73)
    back = clip_from_holden(features, start, clip)
    assert quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz).max() < 1e-6
    np.testing.assert_allclose(back.root_xyz_m, clip.root_xyz_m, atol=1e-9)


def test_place_and_heading_do_not_matter() -> None:
    clip = random_clip()
    rotations, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, 1.3)
    moved = clip.with_motion(rotations, root + np.array([3.0, 0.4, -2.0]))
    np.testing.assert_allclose(holden_features(moved)[0], holden_features(clip)[0], atol=1e-9)


def test_size_of_the_body_does_not_matter() -> None:
    clip = random_clip(amount_rad=0.5)
    big = type(clip)(person(1.5), clip.rotations_wxyz, clip.root_xyz_m * 1.5, clip.fps)
    np.testing.assert_allclose(holden_features(big)[0], holden_features(clip)[0], atol=1e-9)


def test_velocities_are_those_of_the_path() -> None:
    """Walking straight ahead at 1.2 m/s while turning by 0.3 rad/s."""
    clip = random_clip(n_frames=60, amount_rad=0.0)
    turn = np.linspace(0.0, 0.59, 60)
    turning, _ = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, -turn)
    features, start = holden_features(clip.with_motion(turning, clip.root_xyz_m))
    speed = np.linalg.norm(features[20:40, HOLDEN_SLICES["velocity_xz"]], axis=-1) * start.unit_m * 30.0
    np.testing.assert_allclose(speed, 1.2, atol=0.02)
    np.testing.assert_allclose(features[20:40, HOLDEN_SLICES["yaw_velocity"]], 0.01, atol=3e-4)


def test_feet_that_stand_are_in_contact_and_feet_in_the_air_are_not() -> None:
    clip = random_clip(amount_rad=0.0)
    still = clip.with_motion(clip.rotations_wxyz, np.repeat(clip.root_xyz_m[:1], 40, axis=0))
    assert holden_features(still)[0][:, HOLDEN_SLICES["contacts"]].all()
    fast = still.with_motion(still.rotations_wxyz, still.root_xyz_m + np.outer(np.arange(40), [0.0, 0.0, 0.1]))
    assert not holden_features(fast)[0][:, HOLDEN_SLICES["contacts"]].any()


def test_features_of_the_wrong_width_are_refused() -> None:
    clip = random_clip()
    features, start = holden_features(clip)
    with pytest.raises(BadInput, match="features must have shape"):
        clip_from_holden(features[:, :70], start, clip)
