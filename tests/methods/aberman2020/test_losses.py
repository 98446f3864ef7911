"""Each loss of Aberman 2020: zero where it should be, growing where it should, against derivations of their own."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from bench.datasets.take import Take
from bench.methods import rotations
from bench.methods.aberman2020.aberman2020 import (
    CONFIGS,
    POSITIONS,
    ROOT,
    ROTATIONS,
    AbermanTraining,
    encode,
    project,
    style_input,
)
from bench.methods.aberman2020.content import excess_jerk
from bench.methods.aberman2020.losses import feature_distance, quaternion_norm, twist, with_differences
from bench.methods.training import seeded
from bench.methods.windows import cut_windows
from tests.motion.factory import random_clip

LIMIT_RAD = math.radians(100.0)


def takes() -> list[Take]:
    return [
        Take(random_clip(70, seed=seed), content=f"c{seed % 2}", style=f"s{seed // 2}", take_id=str(seed))
        for seed in range(6)
    ]


def training(**changes: object) -> AbermanTraining:
    config = replace(CONFIGS["smoke"], **changes)  # type: ignore[arg-type]
    windows = cut_windows(takes(), encode, n_frames=config.n_frames, stride=config.stride)
    with seeded(0) as generator:
        return AbermanTraining(config, windows, generator)


def test_quaternion_norm() -> None:
    unit = rotations.normalise(torch.randn(3, 5, 4, generator=torch.Generator().manual_seed(0)))
    assert quaternion_norm(unit) == pytest.approx(0.0, abs=1e-12)
    assert quaternion_norm(1.5 * unit) == pytest.approx(0.25, rel=1e-5)
    assert quaternion_norm(3.0 * unit) == pytest.approx(4.0, rel=1e-5)


def about_y(degrees: float) -> Tensor:
    """One joint turned about y beside a root that is too, ``[2, 4]``."""
    half = math.radians(degrees) / 2.0
    return torch.tensor([[math.cos(half), 0.0, math.sin(half), 0.0]] * 2, dtype=torch.float64)


@pytest.mark.parametrize("degrees", [0.0, 60.0, -99.0])
def test_a_turn_within_the_limit_costs_nothing(degrees: float) -> None:
    assert twist(about_y(degrees), LIMIT_RAD) == 0.0


@pytest.mark.parametrize("degrees", [110.0, -110.0, 150.0])
def test_twist_is_the_squared_excess(degrees: float) -> None:
    assert twist(about_y(degrees), LIMIT_RAD) == pytest.approx(math.radians(abs(degrees) - 100.0) ** 2)


def test_twist_of_any_rotation_is_scipys_euler_angle() -> None:
    found = Rotation.random(40, rng=np.random.default_rng(0))
    wxyz = torch.from_numpy(np.roll(found.as_quat(), 1, axis=1))
    angles = found.as_euler("YZX")[:, 0]
    for row, angle in zip(wxyz, angles, strict=True):
        with_root = torch.stack([torch.tensor([1.0, 0.0, 0.0, 0.0], dtype=torch.float64), row])
        assert twist(with_root, 0.3) == pytest.approx(max(abs(angle) - 0.3, 0.0) ** 2, abs=1e-9)


def test_the_root_may_turn() -> None:
    turned = about_y(150.0)
    turned[1] = torch.tensor([1.0, 0.0, 0.0, 0.0])
    assert twist(turned, LIMIT_RAD) == 0.0


def test_features_are_compared_over_time_averages() -> None:
    features = torch.randn(2, 3, 8, generator=torch.Generator().manual_seed(0))
    assert feature_distance(features, features.flip(2)) == pytest.approx(0.0, abs=1e-6)
    assert feature_distance(features + 0.5, features) == pytest.approx(0.5, rel=1e-5)


def test_differences_and_their_sum_are_the_motion() -> None:
    motion = torch.randn(2, 3, 8, generator=torch.Generator().manual_seed(0))
    seen = with_differences(motion)
    torch.testing.assert_close(seen.cumsum(dim=2), motion)
    still = with_differences(motion[..., :1].expand(-1, -1, 8))
    assert still[..., 1:].abs().max() == 0.0


def test_rebuilding_costs_nothing_where_it_is_the_source() -> None:
    """The transferred third does not count; each of the two rebuilt thirds counts half."""
    state = training()
    wanted = state.poses[:4, ..., POSITIONS]
    made = torch.cat([wanted + 7.0, wanted, wanted])
    assert state._rebuilt(made, wanted) == 0.0
    assert state._rebuilt(made + torch.tensor([0.0] * 4 + [0.4] * 4 + [0.0] * 4)[:, None, None], wanted) == (
        pytest.approx(0.2, rel=1e-5)
    )


def test_positions_of_true_rotations_are_the_true_positions() -> None:
    """Forward kinematics inside the loss, on the bones of each window and in the paper's unit."""
    state = training()
    rows = torch.tensor([0, 3, 5])
    unit = state.poses[rows][..., :84].reshape(3, -1, 21, 4)
    torch.testing.assert_close(state._positions(unit, rows), state.poses[rows][..., POSITIONS], atol=1e-4, rtol=1e-4)


def test_shares_of_transferred_and_rebuilt() -> None:
    parts = [torch.tensor(8.0), torch.tensor(2.0), torch.tensor(4.0)]
    assert training(transfer_share=0.5)._shared(parts) == 0.5 * 8.0 + 0.5 * 3.0
    assert training(transfer_share=1.0)._shared(parts) == 8.0


def test_a_step_reports_all_losses_and_moves_both_networks() -> None:
    state = training()
    before = {name: weight.clone() for name, weight in state.discriminator.state_dict().items()}
    own = {name: weight.clone() for name, weight in state.network.state_dict().items()}
    losses = {**state.step(0), **state.step(1)}
    assert set(losses) == {
        "discriminator", "penalty", "adversarial", "reconstruction", "rotation", "feature", "quaternion", "twist",
        "triplet", "joint",
    }  # fmt: skip
    assert all(math.isfinite(float(torch.as_tensor(value).detach())) for value in losses.values())
    after = state.discriminator.state_dict()
    assert any(not torch.equal(before[name], after[name]) for name in before)
    moved = {name for name, weight in state.network.state_dict().items() if not torch.equal(own[name], weight)}
    assert any("video_encoder" in name for name in moved) and any("decoder" in name for name in moved)
    assert all(weight.requires_grad for weight in state.discriminator.parameters())


def test_the_released_penalty_is_smaller_by_the_square_of_the_batch() -> None:
    paper, code = (torch.as_tensor(training(penalty_of_mean=switch).step(0)["penalty"]) for switch in (False, True))
    torch.testing.assert_close(paper, 16.0 * code, rtol=1e-4, atol=0.0)


def test_without_video_there_is_no_joint_loss() -> None:
    assert "joint" not in training(video=False).step(1)


def test_a_camera_from_the_side_sees_x_and_y() -> None:
    poses = torch.from_numpy(encode(random_clip(20))).float()[None]
    poses[..., -1] = 0.0
    seen = project(poses, torch.zeros(1), torch.ones(1)).reshape(1, 20, 21, 2)
    joints = poses[..., POSITIONS].reshape(1, 20, 20, 3)
    torch.testing.assert_close(seen[:, :, :20], joints[..., :2])
    torch.testing.assert_close(seen[:, :, 20], poses[..., ROOT][..., :2])
    far = project(poses, torch.zeros(1), torch.tensor([0.5])).reshape(1, 20, 21, 2)
    torch.testing.assert_close(far, 0.5 * seen)
    quarter = project(poses, torch.tensor([math.pi / 2.0]), torch.ones(1)).reshape(1, 20, 21, 2)
    torch.testing.assert_close(quarter[:, :, :20, 0], -joints[..., 2], atol=1e-4, rtol=1e-4)
    torch.testing.assert_close(quarter[:, :, :20, 1], joints[..., 1])


def test_what_a_camera_sees_does_not_depend_on_where_the_window_heads() -> None:
    poses = torch.from_numpy(encode(random_clip(20))).float()[None]
    views = [project(moved, torch.full((1,), 0.3), torch.ones(1))[..., :40] for moved in (poses, _turned(poses, 1.0))]
    torch.testing.assert_close(*views, atol=1e-4, rtol=1e-4)


def _turned(poses: Tensor, angle: float) -> Tensor:
    moved = poses.clone()
    moved[..., -1] += angle
    return moved


def test_the_style_encoder_reads_sixty_four_numbers() -> None:
    poses = torch.from_numpy(encode(random_clip(20)))[None]
    assert style_input(poses).shape == (1, 20, 64)


def test_jerk_of_real_motion_costs_nothing_and_more_of_it_costs_its_logarithm() -> None:
    motion = torch.randn(2, 16, 21, 7, generator=torch.Generator().manual_seed(0))
    assert excess_jerk(motion, motion) == 0.0
    assert excess_jerk(motion, 2.0 * motion) == 0.0
    assert excess_jerk(3.0 * motion, motion) == pytest.approx(math.log(3.0), rel=1e-5)


def test_scaled_output_is_told_in_deviations_from_the_mean_rotations() -> None:
    network = training(scaled_output=True).network
    windows = cut_windows(takes(), encode, n_frames=32, stride=16)
    poses = windows.features[:3]
    codes = network.content_code(poses), network.style_code(poses)
    assert network.output_scale is not None
    mean = windows.features[..., ROTATIONS].flatten(0, 1).mean(dim=0)
    wanted = network.generator.decode(*codes).transpose(1, 2) * network.output_scale.deviation + mean
    torch.testing.assert_close(network.decode(*codes).flatten(2), wanted, atol=1e-5, rtol=1e-5)
