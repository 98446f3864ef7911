"""Joint range: worked out by hand on hinges, invariances, monotone in the fault, refusals."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics.joint_range import JointRange


def hinge(angles_deg: FloatArray, axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> FloatArray:
    """Quaternions ``[F, 4]`` of a joint that turns about one axis."""
    return np.asarray(Rotation.from_rotvec(np.outer(angles_deg, axis), degrees=True).as_quat(scalar_first=True))


def real_hinge(n: int = 20001) -> JointRange:
    """A hinge that turns evenly between 0 and 100 degrees: the outermost thousandths are at 0.1 and 99.9."""
    return JointRange.seen_in(hinge(np.linspace(0.0, 100.0, n))[:, None])


def outside(real: JointRange, angles_deg: list[float], axis: tuple[float, float, float] = (1.0, 0.0, 0.0)) -> float:
    return float(real.outside(hinge(np.array(angles_deg), axis)[None, :, None])[0])


def test_range_of_a_hinge_by_hand() -> None:
    real = real_hinge()
    np.testing.assert_allclose(real.mean_wxyz[0] * np.sign(real.mean_wxyz[0, 0]), hinge(np.array([50.0]))[0], atol=1e-9)
    np.testing.assert_allclose(np.abs(real.axes[0, 0]), [1.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_allclose([real.low_deg[0, 0], real.high_deg[0, 0]], [-49.9, 49.9], atol=1e-3)
    np.testing.assert_allclose([real.low_deg[0, 1:], real.high_deg[0, 1:]], 0.0, atol=1e-9)


def test_share_outside_by_hand() -> None:
    real = real_hinge()
    assert outside(real, [0.0, 30.0, 100.0, 100.5, -0.5]) == 0.0
    # One of three angles of one of two frames, a hinge bent backwards.
    assert outside(real, [50.0, -10.0]) == pytest.approx(100.0 / 6)
    assert outside(real, [101.5, -1.5]) == pytest.approx(100.0 / 3)
    # From the mean, turned about the second axis: one angle of three, though within the range of the first.
    sideways = Rotation.from_quat(real.mean_wxyz[0], scalar_first=True) * Rotation.from_rotvec(
        20.0 * real.axes[0, 1], degrees=True
    )
    assert real.outside(sideways.as_quat(scalar_first=True)[None, None, None]).tolist() == pytest.approx([100.0 / 3])


def test_real_motion_is_within_and_faults_add_up() -> None:
    rng = np.random.default_rng(0)
    motion = Rotation.from_rotvec(rng.normal(size=(4000, 3)) * [0.5, 0.2, 0.1])
    frames = np.stack([motion.as_quat(scalar_first=True)] * 2, axis=1)
    real = JointRange.seen_in(frames)
    shares = []
    for scale in (0.5, 1.0, 1.5, 3.0):
        stretched = Rotation.from_rotvec(scale * motion.as_rotvec()).as_quat(scalar_first=True)
        shares.append(float(real.outside(np.stack([stretched] * 2, axis=1)[None])[0]))
    assert shares[0] == 0.0 and shares[1] < 0.2
    assert (np.diff(shares) > 0.0).all()


def test_range_ignores_frames_order_signs_and_where_a_joint_is_mounted() -> None:
    rng = np.random.default_rng(1)
    real, output = (Rotation.from_rotvec(rng.normal(size=(600, 3)) * size) for size in (0.3, 0.4))
    mount, turn = Rotation.random(2, rng=rng)

    def share(left: Rotation, right: Rotation, sign: float = 1.0) -> float:
        of_real, of_output = ((left * side * right).as_quat(scalar_first=True) for side in (real, output))
        return float(JointRange.seen_in(of_real[::-1, None]).outside(sign * of_output[None, :, None])[0])

    plain = share(Rotation.identity(), Rotation.identity())
    assert plain > 1.0
    assert share(mount, Rotation.identity(), -1.0) == pytest.approx(plain)
    assert share(mount, turn) == pytest.approx(plain)


def test_only_the_joints_that_count_and_each_sample_alone() -> None:
    frames = hinge(np.linspace(-10.0, 10.0, 101))
    real = JointRange.seen_in(np.stack([frames, frames], axis=1))
    output = np.stack([np.stack([frames, hinge(np.full(101, 40.0))], axis=1), np.stack([frames, frames], axis=1)])
    np.testing.assert_allclose(real.outside(output), [100.0 / 6, 0.0])
    np.testing.assert_allclose(real.outside(output, joints=[1]), [100.0 / 3, 0.0])
    np.testing.assert_allclose(real.outside(output, joints=[0]), [0.0, 0.0])


def test_refusals() -> None:
    real = real_hinge(11)
    with pytest.raises(BadInput, match=r"rotations_wxyz must have shape \[any, any, 4\], got \[2, 4\]"):
        JointRange.seen_in(np.ones((2, 4)))
    with pytest.raises(BadInput, match="rotations_wxyz must be unit quaternions, got a zero one"):
        JointRange.seen_in(np.zeros((2, 1, 4)))
    with pytest.raises(BadInput, match="rotations_wxyz must be finite"):
        real.outside(np.full((1, 2, 1, 4), np.nan))
    with pytest.raises(BadInput, match=r"rotations_wxyz must have shape \[any, any, 1, 4\], got \[1, 2, 2, 4\]"):
        real.outside(np.ones((1, 2, 2, 4)))
    with pytest.raises(BadInput, match=r"joints must be different indices in 0\.\.0, got \[1\]"):
        real.outside(np.ones((1, 2, 1, 4)), joints=[1])
