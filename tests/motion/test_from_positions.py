from __future__ import annotations

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadMotion
from bench.motion.bvh import world_motion
from bench.motion.from_positions import SMPL_NAMES, clip_from_smpl
from bench.motion.kinematics import world_positions
from bench.motion.known_skeletons import SMPL
from bench.motion.skeleton import CANONICAL_NAMES
from tests.motion.factory import random_clip
from tests.motion.source_skeletons import SOURCES, on_source


def smpl_positions(n_joints: int = 22) -> FloatArray:
    """Positions of a moving SMPL skeleton, metres."""
    motion = on_source(random_clip(20), SOURCES["smpl"])
    order = [motion.names.index(name) for name in SMPL_NAMES[:n_joints]]
    return world_motion(motion)[0][:, order] * 0.01


@pytest.mark.parametrize("n_joints", [22, 24])
def test_positions_are_kept(n_joints: int) -> None:
    positions = smpl_positions(n_joints)
    clip = clip_from_smpl(positions, 20.0)
    ours = [CANONICAL_NAMES.index(name) for name in SMPL.joints]
    theirs = [SMPL_NAMES.index(name) for name in SMPL.joints.values()]
    np.testing.assert_allclose(world_positions(clip)[:, ours], positions[:, theirs], atol=0.02)
    assert clip.fps == 20.0
    assert clip.skeleton.virtual == {"LeftHandIndex1", "RightHandIndex1"}
    assert 1.2 < clip.skeleton.stature_m < 1.7


def test_unit_and_up() -> None:
    positions = smpl_positions()
    expected = clip_from_smpl(positions, 30.0)
    z_up = positions[..., [0, 2, 1]] * [1.0, -1.0, 1.0]
    clip = clip_from_smpl(z_up * 100.0, 30.0, unit_m=0.01, up="z")
    np.testing.assert_allclose(world_positions(clip), world_positions(expected), atol=1e-9)


def test_bad_positions_are_refused() -> None:
    with pytest.raises(BadMotion, match=r"must be \[F, 22, 3\]"):
        clip_from_smpl(np.zeros((5, 21, 3)), 30.0)
    with pytest.raises(BadMotion, match="positions"):
        clip_from_smpl(np.full((5, 22, 3), np.nan), 30.0)
    with pytest.raises(BadConfig, match="up must be"):
        clip_from_smpl(np.zeros((5, 22, 3)), 30.0, up="x")
