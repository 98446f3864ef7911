from __future__ import annotations

import numpy as np
import pytest

from bench.errors import BadInput
from bench.motion import quat
from bench.motion.fit_rotations import fit_rotations
from bench.motion.kinematics import world_positions
from tests.motion.factory import person, random_clip


def test_own_positions_give_the_same_clip() -> None:
    clip = random_clip(amount_rad=0.8)
    fitted = fit_rotations(world_positions(clip), clip)
    assert quat.angle_between(fitted.rotations_wxyz, clip.rotations_wxyz).max() < 1e-6
    np.testing.assert_allclose(fitted.root_xyz_m, clip.root_xyz_m)


def test_positions_of_another_motion_of_the_same_body_are_met() -> None:
    clip, other = random_clip(amount_rad=0.5), random_clip(amount_rad=0.9, seed=4)
    fitted = fit_rotations(world_positions(other), clip)
    np.testing.assert_allclose(world_positions(fitted), world_positions(other), atol=1e-9)


def test_bones_keep_the_lengths_and_take_the_directions() -> None:
    clip, other = random_clip(), random_clip(seed=4, skeleton=person(1.3))
    fitted = fit_rotations(world_positions(other), clip)
    assert fitted.skeleton is clip.skeleton
    thigh, target = (np.diff(world_positions(c)[:, [1, 2]], axis=1)[:, 0] for c in (fitted, other))
    np.testing.assert_allclose(target / thigh, 1.3, atol=1e-9)


def test_a_bone_of_no_length_stays_as_it_was() -> None:
    clip = random_clip()
    positions = world_positions(clip).copy()
    positions[:, 14:17] = positions[:, 13:14]
    fitted = fit_rotations(positions, clip)
    assert quat.angle_between(fitted.rotations_wxyz, clip.rotations_wxyz).max() < 1e-6


def test_positions_of_another_length_are_refused() -> None:
    clip = random_clip()
    with pytest.raises(BadInput, match="positions_m must have shape"):
        fit_rotations(world_positions(clip)[:-1], clip)
