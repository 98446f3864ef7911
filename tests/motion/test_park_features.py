from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput
from bench.motion import quat
from bench.motion.edit import crop
from bench.motion.kinematics import world_positions, yaw_aligned
from bench.motion.park_features import POSITION, ROTATION, clip_from_park_frame, park_frame_features
from tests.motion.factory import person, random_clip


@pytest.mark.parametrize("by_positions", [False, True])
@pytest.mark.parametrize("n_frames", [1, 40])
def test_round_trip(n_frames: int, by_positions: bool) -> None:
    clip = crop(random_clip(amount_rad=0.8), 0, n_frames)
    features, track = park_frame_features(clip)
    assert features.shape == (n_frames, 21, 7)
    back = clip_from_park_frame(features, track, clip, by_positions=by_positions)
    assert quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz).max() < 1e-6
    np.testing.assert_allclose(back.root_xyz_m, clip.root_xyz_m, atol=1e-9)


def test_place_heading_and_size_do_not_matter() -> None:
    clip = random_clip()
    rotations, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, 1.3)
    moved = type(clip)(person(1.4), rotations, 1.4 * root + np.array([3.0, 0.4, -2.0]), clip.fps)
    np.testing.assert_allclose(
        park_frame_features(moved)[0][..., POSITION], park_frame_features(clip)[0][..., POSITION], atol=1e-9
    )


def test_signs_of_rotations_do_not_jump() -> None:
    clip = random_clip(amount_rad=3.0, n_frames=80)
    rotations = park_frame_features(clip)[0][..., ROTATION]
    assert (np.sum(rotations[1:] * rotations[:-1], axis=-1) > 0.0).all()


def test_positions_win_where_they_disagree_with_rotations() -> None:
    clip, other = random_clip(seed=1), random_clip(seed=2, amount_rad=0.5)
    features, track = park_frame_features(clip)
    features[..., POSITION] = park_frame_features(other)[0][..., POSITION]
    by_rotation = clip_from_park_frame(features, track, clip, by_positions=False)
    by_position = clip_from_park_frame(features, track, clip, by_positions=True)
    np.testing.assert_allclose(
        park_frame_features(by_position)[0][:, 14, :3] - park_frame_features(by_position)[0][:, 13, :3],
        features[:, 14, :3] - features[:, 13, :3],
        atol=0.02,
    )
    assert np.abs(world_positions(by_rotation) - world_positions(by_position)).max() > 0.05


def test_features_of_another_length_are_refused() -> None:
    clip = random_clip()
    features, track = park_frame_features(clip)
    with pytest.raises(BadInput, match="features must have shape"):
        clip_from_park_frame(features[:-1], track, clip, by_positions=False)
