"""Physics: worked out by hand on simple curves, invariances, monotone in the fault, refusals."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics.physics import (
    bone_drift,
    jerk_per_sample,
    path_drift,
    ratio_per_content,
    ratio_to_reference,
    root_path_error,
    speed_per_sample,
    time_correlation,
)

FPS = 30.0


def some_motion(seed: int = 0, n: int = 3, n_frames: int = 40, n_joints: int = 5) -> FloatArray:
    rng = np.random.default_rng(seed)
    time_s = np.arange(n_frames)[None, :, None, None] / FPS
    phase, speed = rng.uniform(0, 6, (2, n, 1, n_joints, 3))
    return np.asarray(rng.normal(size=(n, 1, n_joints, 3)) + 0.2 * np.sin(2.0 * speed * time_s + phase))


def turned(positions: FloatArray, yaw_rad: float) -> FloatArray:
    cosine, sine = np.cos(yaw_rad), np.sin(yaw_rad)
    return np.asarray(positions @ np.array([[cosine, 0, -sine], [0, 1, 0], [sine, 0, cosine]]))


def test_jerk_and_speed_by_hand() -> None:
    # x = t^3 has jerk 6 m/s^3; z = 2 t has speed 2 m/s and no jerk.
    time_s = np.arange(10) / FPS
    positions = np.zeros((1, 10, 2, 3))
    positions[0, :, 0, 0], positions[0, :, 1, 2] = time_s**3, 2.0 * time_s
    np.testing.assert_allclose(jerk_per_sample(positions, FPS, joints=[0]), 6.0, rtol=1e-9)
    np.testing.assert_allclose(jerk_per_sample(positions, FPS), 3.0, rtol=1e-9)
    np.testing.assert_allclose(speed_per_sample(positions, FPS, joints=[1]), 2.0, rtol=1e-12)


def test_jerk_scales_with_time_and_ignores_place_and_turn() -> None:
    motion = some_motion()
    plain = jerk_per_sample(motion, FPS)
    np.testing.assert_allclose(jerk_per_sample(motion, 2 * FPS), 8.0 * plain)
    np.testing.assert_allclose(jerk_per_sample(turned(motion, 0.7) + 5.0, FPS), plain, rtol=1e-9)
    assert (jerk_per_sample(np.repeat(motion[:, :1], 9, axis=1), FPS) == 0.0).all()


def test_jerk_ratio_is_one_on_itself_and_grows_with_noise() -> None:
    motion, rng = some_motion(), np.random.default_rng(1)
    noise = rng.normal(size=motion.shape)
    real = jerk_per_sample(motion, FPS)
    ratios = [ratio_to_reference(real, jerk_per_sample(motion + s * noise, FPS)) for s in (0.0, 1e-3, 1e-2)]
    assert ratios[0] == 1.0
    assert ratios[0] < ratios[1] < ratios[2]


def test_ratio_by_hand_and_per_content() -> None:
    assert ratio_to_reference([1.0, 3.0], [4.0]) == 2.0
    assert ratio_to_reference([4.0], [1.0, 3.0]) == 0.5
    assert ratio_to_reference([0.25, 0.25], [0.5]) == 2.0
    table = ratio_per_content([1.0, 3.0, 5.0], [0, 0, 1], [4.0, 10.0, 7.0], [0, 1, 2])
    assert table == {0: 2.0, 1: 2.0}


def test_time_correlation_of_itself_its_opposite_and_a_right_angle() -> None:
    motion = some_motion()
    np.testing.assert_allclose(time_correlation(motion, motion), 1.0)
    np.testing.assert_allclose(time_correlation(motion, -motion), -1.0)
    phase = np.linspace(0.0, 2.0 * np.pi, 64, endpoint=False)
    source, output = np.zeros((2, 1, 64, 2, 3))
    source[0, :, 1, 1], output[0, :, 1, 1] = np.sin(phase), np.sin(phase + np.pi / 3)
    np.testing.assert_allclose(time_correlation(source, output), 0.5, rtol=1e-12)


def test_time_correlation_ignores_posture_amplitude_and_root_path() -> None:
    source, output = some_motion(0), some_motion(1)
    plain = time_correlation(source, output)
    posture, path = (
        np.random.default_rng(2).normal(size=(3, 1, 5, 3)),
        np.random.default_rng(3).normal(size=(3, 40, 1, 3)),
    )
    np.testing.assert_allclose(time_correlation(source, 3.0 * output + posture + path), plain, rtol=1e-9)
    np.testing.assert_allclose(time_correlation(output, source), plain, rtol=1e-12)


def test_time_correlation_falls_with_noise_and_is_nan_on_a_frozen_clip() -> None:
    motion = some_motion()
    noise = np.random.default_rng(4).normal(size=motion.shape)
    falling = [time_correlation(motion, motion + s * noise).mean() for s in (0.0, 0.1, 1.0)]
    assert falling[0] > falling[1] > falling[2]
    frozen = np.repeat(motion[:, :1], 40, axis=1) + np.linspace(0, 1, 40)[None, :, None, None]
    assert np.isnan(time_correlation(motion, frozen)).all()


def test_time_correlation_needs_two_frames_and_a_micrometre_of_movement() -> None:
    motion = some_motion()
    np.testing.assert_allclose(time_correlation(motion[:, :2], motion[:, :2]), 1.0)
    wave = np.zeros((1, 64, 2, 3))
    wave[0, :, 1, 1] = np.sin(np.linspace(0.0, 6.0, 64))
    np.testing.assert_allclose(time_correlation(wave, 1e-5 * wave), 1.0)
    assert np.isnan(time_correlation(wave, 1e-7 * wave)).all() and np.isnan(time_correlation(1e-7 * wave, wave)).all()


def chain(lengths: FloatArray) -> FloatArray:
    """A straight chain along y: bone ``lengths`` ``[T, J - 1]`` give positions ``[1, T, J, 3]``."""
    positions = np.zeros((1, len(lengths), lengths.shape[1] + 1, 3))
    positions[0, :, 1:, 1] = np.cumsum(lengths, axis=1)
    return positions


def test_bone_drift_by_hand() -> None:
    # Bone 1 swings between 0.9 and 1.1 around 1: 10 %. Bone 2 is 2.2 instead of 2: 10 %. Bone 3 is right.
    lengths = np.array([[0.9, 2.2, 1.0], [1.1, 2.2, 1.0]])
    reference = np.array([0.0, 1.0, 2.0, 1.0])
    drift = bone_drift(chain(lengths), (-1, 0, 1, 2), reference)
    np.testing.assert_allclose(drift, 20.0 / 3.0)
    np.testing.assert_allclose(bone_drift(chain(lengths), (-1, 0, 1, 2), reference, joints=[0, 1, 2]), 10.0)
    np.testing.assert_allclose(bone_drift(chain(lengths), (-1, 0, 1, 2), reference, joints=[3]), 0.0, atol=1e-12)


def test_bone_drift_ignores_motion_scale_and_tiny_bones_and_grows_with_stretch() -> None:
    rng = np.random.default_rng(5)
    reference = np.array([0.0, 1.0, 0.5, 1e-5])
    rigid = chain(np.repeat(reference[None, 1:], 6, axis=0))
    moved = turned(rigid, 0.4) + rng.normal(size=(1, 6, 1, 3))
    np.testing.assert_allclose(bone_drift(moved, (-1, 0, 1, 2), reference), 0.0, atol=1e-9)
    stretched = [
        bone_drift(chain(np.array([[1.0, 0.5, 0.0], [1.0 + s, 0.5, 9.0]])), (-1, 0, 1, 2), reference)[0]
        for s in (0.0, 0.1, 0.3)
    ]
    assert 0.0 == stretched[0] < stretched[1] < stretched[2]
    scaled = bone_drift(2.0 * chain(np.array([[1.1, 0.5, 0.0]])), (-1, 0, 1, 2), 2.0 * reference)
    np.testing.assert_allclose(scaled, 5.0)


def test_a_bone_of_one_millimetre_counts() -> None:
    reference = np.array([0.0, 1.0, 0.001])
    np.testing.assert_allclose(bone_drift(chain(np.array([[1.0, 0.002]])), (-1, 0, 1), reference), 50.0)
    np.testing.assert_allclose(bone_drift(chain(np.array([[1.0, 0.002]])), (-1, 0, 1), 0.999 * reference), 100 / 999)


def test_speed_ignores_place_and_turn_and_grows_with_the_motion() -> None:
    motion = some_motion()
    plain = speed_per_sample(motion, FPS)
    np.testing.assert_allclose(speed_per_sample(turned(motion, 0.7) + 5.0, FPS), plain, rtol=1e-9)
    np.testing.assert_allclose(speed_per_sample(motion[:, ::-1], FPS), plain)
    np.testing.assert_allclose(speed_per_sample(3.0 * motion, 2.0 * FPS), 6.0 * plain)
    assert (speed_per_sample(np.repeat(motion[:, :1], 5, axis=1), FPS) == 0.0).all()


def test_ratios_ignore_the_order_of_samples_and_common_units() -> None:
    rng = np.random.default_rng(6)
    real, output, contents = rng.uniform(1.0, 2.0, 30), rng.uniform(1.0, 2.0, 20), rng.integers(0, 3, 30)
    plain = ratio_to_reference(real, output)
    assert ratio_to_reference(7.0 * real[::-1], 7.0 * output[::-1]) == pytest.approx(plain)
    assert ratio_to_reference(real, 2.0 * output) == pytest.approx(2.0 * plain)
    assert ratio_per_content(real, contents, real, contents) == {0: 1.0, 1: 1.0, 2: 1.0}


def bad_fps(fps: float) -> list[Callable[[], object]]:
    motion = some_motion()
    return [
        lambda: jerk_per_sample(motion, fps),
        lambda: speed_per_sample(motion, fps),
    ]


@pytest.mark.parametrize("fps", [0.0, -30.0, float("nan"), float("inf")])
def test_refuses_a_frame_rate_that_is_none(fps: float) -> None:
    for call in bad_fps(fps):
        with pytest.raises(BadInput, match=r"^fps: fps must be positive"):
            call()


POSITION_FUNCTIONS: list[tuple[Callable[[FloatArray], object], int]] = [
    (lambda p: jerk_per_sample(p, FPS), 4),
    (lambda p: speed_per_sample(p, FPS), 2),
    (lambda p: bone_drift(p, (-1, 0, 1, 2, 3), np.ones(5)), 1),
]


@pytest.mark.parametrize(("function", "min_frames"), POSITION_FUNCTIONS)
def test_refuses_what_is_no_motion(function: Callable[[FloatArray], object], min_frames: int) -> None:
    motion = some_motion()
    function(motion[:, :min_frames])
    broken = motion.copy()
    broken[1, 2, 3, 0] = np.inf
    with pytest.raises(BadInput, match=r"^positions_m: positions_m must be finite, got 1 NaN or Inf"):
        function(broken)
    for shape in ((3, 40, 5), (3, 40, 5, 2), (0, 40, 5, 3), (3, 0, 5, 3)):
        with pytest.raises(BadInput, match=r"^positions_m: positions_m must have shape \[any, any, any, 3\]"):
            function(np.zeros(shape))
    if min_frames > 1:
        with pytest.raises(BadInput, match=f"positions_m must have at least {min_frames} frames, got {min_frames - 1}"):
            function(motion[:, : min_frames - 1])


JOINT_FUNCTIONS: list[Callable[[FloatArray, list[int]], object]] = [
    lambda p, joints: jerk_per_sample(p, FPS, joints=joints),
    lambda p, joints: speed_per_sample(p, FPS, joints=joints),
    lambda p, joints: time_correlation(p, p, joints=joints),
    lambda p, joints: bone_drift(p, (-1, 0, 1, 2, 3), np.ones(5), joints=joints),
]


@pytest.mark.parametrize("function", JOINT_FUNCTIONS)
@pytest.mark.parametrize("joints", [[5], [-1], [1, 1], []])
def test_refuses_joints_that_do_not_exist(
    function: Callable[[FloatArray, list[int]], object], joints: list[int]
) -> None:
    with pytest.raises(BadInput, match=r"^joints: joints must be different indices in 0\.\.4"):
        function(some_motion(), joints)


def test_refuses_pairs_that_do_not_fit() -> None:
    motion = some_motion()
    broken = np.full_like(motion, np.nan)
    with pytest.raises(BadInput, match=r"^source_positions_m: .* must be finite"):
        time_correlation(broken, motion)
    with pytest.raises(BadInput, match=r"^output_positions_m: .* must be finite"):
        time_correlation(motion, broken)
    with pytest.raises(BadInput, match=r"^source_positions_m: .* at least 2 frames, got 1"):
        time_correlation(motion[:, :1], motion[:, :1])
    with pytest.raises(
        BadInput, match=r"^output_positions_m: .* match the source's \[3, 40, 5, 3\], got \[2, 40, 5, 3\]"
    ):
        time_correlation(motion, motion[:2])
    with pytest.raises(BadInput, match=r"^reference_lengths_m: .* must be finite"):
        bone_drift(motion, (-1, 0, 1, 2, 3), np.full(5, np.nan))
    for good, bad in ((1.0, np.nan), (1.0, -1.0)):
        with pytest.raises(BadInput, match=r"^reference: "):
            ratio_to_reference([bad], [good])
        with pytest.raises(BadInput, match=r"^output: "):
            ratio_to_reference([good], [bad])
    with pytest.raises(BadInput, match=r"^reference_contents: .* must have shape \[2\], got \[1\]"):
        ratio_per_content([1.0, 1.0], [0], [1.0], [0])
    with pytest.raises(BadInput, match=r"^output_contents: .* must be integer labels"):
        ratio_per_content([1.0], [0], [1.0], [0.5])
    with pytest.raises(BadInput, match=r"^reference: .* must not be negative"):
        ratio_per_content([-1.0], [0], [1.0], [0])
    with pytest.raises(BadInput, match=r"^output: .* must not be negative"):
        ratio_per_content([1.0], [0], [-1.0], [0])


def test_refusals() -> None:
    motion = some_motion()
    broken = motion.copy()
    broken[0, 0, 0, 0] = np.nan
    with pytest.raises(BadInput, match="positions_m must be finite, got 1 NaN"):
        jerk_per_sample(broken, FPS)
    with pytest.raises(BadInput, match="positions_m must have at least 4 frames, got 3"):
        jerk_per_sample(motion[:, :3], FPS)
    with pytest.raises(BadInput, match=r"positions_m must have shape \[any, any, any, 3\]"):
        speed_per_sample(motion[0], FPS)
    with pytest.raises(BadInput, match="fps must be positive, got 0"):
        jerk_per_sample(motion, 0.0)
    with pytest.raises(BadInput, match=r"joints must be different indices in 0\.\.4, got \[5\]"):
        jerk_per_sample(motion, FPS, joints=[5])
    with pytest.raises(BadInput, match="the mean of reference must be positive"):
        ratio_to_reference([0.0], [1.0])
    with pytest.raises(BadInput, match="output must not be negative"):
        ratio_to_reference([1.0], [-1.0])
    with pytest.raises(BadInput, match="output_positions_m must match the source's"):
        time_correlation(motion, motion[:, :-1])
    with pytest.raises(BadInput, match="parents must name 5 joints, got 2"):
        bone_drift(motion, (-1, 0), np.ones(5))
    with pytest.raises(BadInput, match="no bone of at least 1 mm is left"):
        bone_drift(motion, (-1, 0, 1, 2, 3), np.zeros(5))
    with pytest.raises(BadInput, match=r"reference_lengths_m must have shape \[3, 5\]"):
        bone_drift(motion, (-1, 0, 1, 2, 3), np.ones(4))


def path(*points_zx: tuple[float, float]) -> FloatArray:
    """A root path ``[1, T, 3]`` over the floor from z, x in metres."""
    z, x = np.array(points_zx).T
    return np.stack([x, np.ones_like(x), z], axis=-1)[None]


def test_root_path_error_by_hand() -> None:
    # Twice as far along a line: centred, the ends are 0.5 m off and the middle is right.
    source, output = path((0, 0), (0.5, 0), (1, 0)), path((0, 0), (1, 0), (2, 0))
    np.testing.assert_allclose(root_path_error(source, output), 100.0 * (0.5 + 0.0 + 0.5) / 3)
    np.testing.assert_allclose(root_path_error(output, source), root_path_error(source, output))


def test_root_path_error_ignores_where_and_which_way_and_height_but_not_scale_or_mirror() -> None:
    rng = np.random.default_rng(7)
    source = rng.normal(size=(4, 30, 3)).cumsum(axis=1) * 0.01
    np.testing.assert_allclose(
        root_path_error(source, turned(source, 2.1) + np.array([5.0, 0.3, -2.0])), 0.0, atol=1e-9
    )
    faults = [root_path_error(source, source * scale).mean() for scale in (1.0, 1.2, 1.5, 2.0)]
    assert faults[0] == pytest.approx(0.0, abs=1e-9) and (np.diff(faults) > 0).all()
    assert (root_path_error(source, source * [-1.0, 1.0, 1.0]) > 0.1).all()


def test_root_path_error_is_the_least_over_all_turns() -> None:
    rng = np.random.default_rng(8)
    source, output = rng.normal(size=(2, 1, 20, 3))
    centred = [p - p.mean(axis=1, keepdims=True) for p in (source, output)]
    squares = [((centred[0] - turned(centred[1], yaw))[..., (0, 2)] ** 2).sum() for yaw in np.linspace(0, 6.283, 3600)]
    best = turned(centred[1], np.linspace(0, 6.283, 3600)[np.argmin(squares)])
    expected = 100.0 * np.linalg.norm((centred[0] - best)[..., (0, 2)], axis=-1).mean()
    np.testing.assert_allclose(root_path_error(source, output), expected, rtol=1e-4)


def test_root_path_error_refuses_what_does_not_fit() -> None:
    good = path((0, 0), (1, 0))
    with pytest.raises(BadInput, match=r"source_root_xyz_m must have shape \[any, any, 3\], got \[2, 3\]"):
        root_path_error(good[0], good)
    with pytest.raises(BadInput, match=r"output_root_xyz_m must have shape \[1, 2, 3\], got \[1, 1, 3\]"):
        root_path_error(good, good[:, 1:])
    with pytest.raises(BadInput, match="output_root_xyz_m must be finite"):
        root_path_error(good, good * np.nan)


class TestPathDrift:
    def test_by_hand_and_perfect(self) -> None:
        source = np.zeros((2, 3, 3))
        output = source.copy()
        output[1, -1] = [0.03, 5.0, -0.04]
        assert path_drift(source, source).tolist() == [0.0, 0.0]
        assert path_drift(source, output) == pytest.approx([0.0, 5.0])

    def test_only_the_end_counts_and_nothing_is_aligned(self) -> None:
        rng = np.random.default_rng(0)
        source = rng.normal(size=(1, 5, 3))
        output = source.copy()
        output[:, :-1] += 1.0
        assert path_drift(source, output) == pytest.approx([0.0])
        assert path_drift(source, source + np.array([0.0, 2.0, 1.0])) == pytest.approx([100.0])
        assert path_drift(source, output) == pytest.approx(path_drift(output, source))

    def test_grows_with_the_fault_and_not_with_where_it_happens(self) -> None:
        source = np.zeros((1, 4, 3))
        drifts = [float(path_drift(source + 7.0, source + 7.0 + d * np.array([1.0, 0.0, 1.0]))[0]) for d in range(4)]
        assert drifts == sorted(drifts) and drifts[-1] == pytest.approx(300.0 * np.sqrt(2.0))

    def test_refuses_other_shapes_and_nan(self) -> None:
        with pytest.raises(BadInput, match="output_root_xyz_m must have shape"):
            path_drift(np.zeros((1, 4, 3)), np.zeros((1, 3, 3)))
        with pytest.raises(BadInput, match="source_root_xyz_m must be finite"):
            path_drift(np.full((1, 4, 3), np.nan), np.zeros((1, 4, 3)))
