from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.motion import quat


def random_rotations(seed: int, *shape: int) -> FloatArray:
    return quat.normalise(np.random.default_rng(seed).normal(size=(*shape, 4)))


seeds = st.integers(0, 2**31)


@given(seeds)
def test_multiply_agrees_with_scipy(seed: int) -> None:
    a, b = random_rotations(seed, 5), random_rotations(seed + 1, 5)
    expected = Rotation.from_quat(a, scalar_first=True) * Rotation.from_quat(b, scalar_first=True)
    assert quat.angle_between(quat.multiply(a, b), expected.as_quat(scalar_first=True)).max() < 1e-12


@given(seeds)
def test_rotate_agrees_with_scipy(seed: int) -> None:
    a = random_rotations(seed, 5)
    vectors = np.random.default_rng(seed).normal(size=(5, 3))
    expected = Rotation.from_quat(a, scalar_first=True).apply(vectors)
    np.testing.assert_allclose(quat.rotate(a, vectors), expected, atol=1e-12)


@given(seeds)
def test_conjugate_undoes(seed: int) -> None:
    a = random_rotations(seed, 3)
    assert quat.angle_between(quat.multiply(a, quat.conjugate(a)), quat.IDENTITY).max() < 1e-12


@given(seeds)
def test_logarithm_round_trip(seed: int) -> None:
    a = random_rotations(seed, 3, 2)
    assert quat.angle_between(quat.from_rotation_vector(quat.to_rotation_vector(a)), a).max() < 1e-7


def test_quarter_turn_about_up_takes_forward_to_left() -> None:
    turned = quat.rotate(quat.about_y(np.pi / 2), np.array([0.0, 0.0, 1.0]))
    np.testing.assert_allclose(turned, [1.0, 0.0, 0.0], atol=1e-12)


@pytest.mark.parametrize("start", [[1.0, 0, 0], [0, 1.0, 0], [0, 0, 1.0], [0.0, 0.0, -1.0], [0.6, 0.0, 0.8]])
@pytest.mark.parametrize("end", [[1.0, 0, 0], [0, -2.0, 0], [0, 0, -1.0], [-0.6, 0.0, -0.8]])
def test_between_takes_start_to_end(start: list[float], end: list[float]) -> None:
    first, second = np.array(start), np.array(end)
    turned = quat.rotate(quat.between(first, second), first)
    np.testing.assert_allclose(turned, second / np.linalg.norm(second), atol=1e-9)


def test_angle_ignores_the_double_cover_and_is_exact_near_zero() -> None:
    small = quat.from_axis_angle(np.array([1.0, 0.0, 0.0]), 1e-9)
    assert quat.angle_between(quat.IDENTITY, small) == pytest.approx(1e-9, rel=1e-6)
    assert quat.angle_between(quat.IDENTITY, -quat.IDENTITY) == 0.0
    assert quat.angle_between(quat.IDENTITY, quat.about_y(np.pi)) == pytest.approx(np.pi)


def test_slerp_ends_and_middle() -> None:
    end = quat.about_y(1.0)
    assert quat.angle_between(quat.slerp(quat.IDENTITY, -end, 1.0), end) < 1e-12
    assert quat.angle_between(quat.slerp(quat.IDENTITY, end, 0.25), quat.about_y(0.25)) < 1e-12


def test_mean_ignores_signs() -> None:
    spread = quat.about_y(np.array([-0.2, 0.0, 0.2])) * np.array([[1.0], [-1.0], [1.0]])
    assert quat.angle_between(quat.mean(spread), quat.IDENTITY) < 1e-9


def test_continuous_never_jumps_hemisphere() -> None:
    turning = quat.about_y(np.linspace(0, 6 * np.pi, 90))[:, None]
    flipped = turning * np.where(np.arange(90) % 2, 1.0, -1.0)[:, None, None]
    smooth = quat.continuous(flipped)
    assert (np.sum(smooth[1:] * smooth[:-1], axis=-1) > 0).all()
    assert quat.angle_between(smooth, turning).max() < 1e-12
