from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from bench.datasets.take import Take
from bench.methods.holden2016 import holden2016 as holden
from bench.methods.holden2016.constraints import bone_lengths, constraints, foot_slide, path_velocities, trajectory
from bench.methods.holden2016.network import MotionAutoencoder, reconstruction_loss, sparsity_loss
from bench.methods.layers import gram, n_parameters
from bench.methods.training import FitRequest
from bench.methods.windows import FPS
from bench.motion.clip import Clip
from bench.motion.edit import crop, resample
from bench.motion.holden_features import UNITS_PER_STATURE, holden_features
from tests.motion.factory import random_clip

TINY = replace(holden.CONFIGS["smoke"], width=6, kernel=5, n_steps=6, transfer_steps=10, constraint_steps=3)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def takes() -> list[Take]:
    return [
        Take(random_clip(70, seed=seed), content=f"c{seed % 2}", style=f"s{seed // 2}", take_id=str(seed))
        for seed in range(4)
    ]


def request(seed: int = 0) -> FitRequest:
    return FitRequest(takes(), seed, "smoke", "cpu", None, lambda what, done, total: None)


def fitted() -> MotionAutoencoder:
    return holden.train_holden(TINY, request())[1]


def test_parameters_at_full_width() -> None:
    """The 21 canonical joints and the reference joint are the paper's 73 channels, so the counts are the paper's."""
    network = holden.build(holden.Holden2016Config())
    assert n_parameters(network.encoder) == 467_456
    assert n_parameters(network.decoder) == 467_273


def test_encoder_against_loops() -> None:
    network = MotionAutoencoder(width=3, kernel=5, dropout=0.0)
    motion = torch.randn(1, 73, 8, generator=generator())
    weight, bias = network.encoder.weight.detach().numpy(), network.encoder.bias.detach().numpy()  # type: ignore[union-attr]
    padded = np.pad(motion[0].numpy(), ((0, 0), (2, 2)))
    filtered = np.array([[(padded[:, t : t + 5] * weight[k]).sum() + bias[k] for t in range(8)] for k in range(3)])
    expected = np.maximum(filtered, 0.0).reshape(3, 4, 2).max(axis=-1)
    np.testing.assert_allclose(network.encode(motion)[0].detach().numpy(), expected, atol=1e-5)


def test_random_unpooling_is_plain_unpooling_on_average() -> None:
    network = MotionAutoencoder(width=3, kernel=5, dropout=0.0).eval()
    hidden = torch.rand(1, 3, 4, generator=generator()).expand(1000, -1, -1)
    with torch.no_grad():
        mean = network.decode_randomly(hidden, generator(1)).mean(dim=0)
        torch.testing.assert_close(mean, network.decode(hidden[:1])[0], atol=0.05, rtol=0.0)


def test_losses_of_training() -> None:
    network = MotionAutoencoder(width=3, kernel=5, dropout=0.0)
    motion = torch.randn(2, 73, 8, generator=generator())
    assert reconstruction_loss(motion, motion) == 0.0
    assert reconstruction_loss(motion + 2.0, motion) == pytest.approx(4.0)
    before = sparsity_loss(network)
    with torch.no_grad():
        network.encoder.weight.mul_(3.0)
        network.decoder.weight.mul_(3.0)
    torch.testing.assert_close(sparsity_loss(network), 3.0 * before)
    with torch.no_grad():
        network.encoder.weight.zero_()
        network.decoder.weight.zero_()
    assert sparsity_loss(network) == 0.0


def test_standardisation_keeps_resting_velocities_at_zero() -> None:
    network = MotionAutoencoder(width=3, kernel=5, dropout=0.0)
    features = torch.randn(5, 20, 73, generator=generator()) * 3.0 + 1.0
    network.fit_standardise(features)
    standard = network.standardise(torch.zeros(73))
    assert standard[66:69].abs().max() == 0.0
    np.testing.assert_allclose(standard[69:].numpy(), -1.0)
    assert network.standardise.deviation[12] == pytest.approx(0.9 * float(features.std()), rel=1e-5)
    assert network.standardise.deviation[0] == pytest.approx(float(features.std()), rel=1e-5)


def test_style_loss_is_zero_at_its_aim_and_its_gradient_is_right() -> None:
    content = torch.rand(1, 5, 7, generator=generator(), dtype=torch.float64)
    own_gram = content @ content.transpose(1, 2)
    assert holden.style_loss(content, content, own_gram, 0.1, 0.9) == 0.0
    hidden = torch.rand(1, 5, 7, generator=generator(1), dtype=torch.float64).requires_grad_()
    loss = holden.style_loss(hidden, content, own_gram, 0.1, 0.9)
    assert loss > 0.0
    [by_autograd] = torch.autograd.grad(loss, hidden)
    torch.testing.assert_close(holden.style_gradient(hidden.detach(), content, own_gram, 0.1, 0.9), by_autograd)


def test_gram_against_loops() -> None:
    hidden = torch.rand(1, 3, 4, generator=generator()).numpy()[0]
    expected = [[sum(hidden[i, t] * hidden[j, t] for t in range(4)) for j in range(3)] for i in range(3)]
    np.testing.assert_allclose(gram(torch.from_numpy(hidden[None]))[0].numpy(), expected, rtol=1e-5)


def test_descent_is_adam() -> None:
    target = torch.randn(4, generator=generator())
    x = torch.zeros(4, requires_grad=True)
    adam = torch.optim.Adam([x], lr=0.01, eps=holden.ADAM_EPSILON)
    for _ in range(30):
        adam.zero_grad()
        ((x - target) ** 2).sum().backward()  # type: ignore[no-untyped-call]
        adam.step()
    mine = holden.descend(torch.zeros(4), lambda y: 2.0 * (y - target), 30, 0.01)
    torch.testing.assert_close(mine, x.detach(), atol=1e-6, rtol=1e-5)


def motion_of(clip: Clip) -> torch.Tensor:
    return torch.from_numpy(holden_features(clip)[0].T)


def test_a_real_walk_has_its_bones_and_its_path() -> None:
    clip = random_clip(amount_rad=0.6)
    motion = motion_of(clip)
    lengths = torch.tensor(clip.skeleton.bone_lengths_m[1:] * UNITS_PER_STATURE / clip.skeleton.stature_m)
    parents = clip.skeleton.parents
    assert bone_lengths(motion, lengths, parents) < 1e-9
    assert bone_lengths(motion, 1.1 * lengths, parents) == pytest.approx(float(((0.1 * lengths) ** 2).mean()), rel=1e-4)
    assert trajectory(motion, path_velocities(motion)) == 0.0
    assert trajectory(motion, path_velocities(motion) + 0.5) == pytest.approx(2.5)
    total = constraints(motion, torch.zeros(4, 40), lengths, parents, path_velocities(motion))
    assert total == pytest.approx(float(foot_slide(motion, torch.zeros(4, 40))) / 3.0, rel=1e-4)


def test_feet_that_slide_cost_and_feet_that_stand_do_not() -> None:
    clip = random_clip(amount_rad=0.0)
    still = clip.with_motion(clip.rotations_wxyz, np.repeat(clip.root_xyz_m[:1], 40, axis=0))
    motion, standing = motion_of(still), torch.ones(4, 40)
    assert foot_slide(motion, standing) < 1e-9
    sliding = motion.clone()
    sliding[66] = 0.3
    # all four feet glide by 0.3 units a frame: weight 10, one axis of x, y, z and floor
    assert foot_slide(sliding, standing) == pytest.approx(10.0 * 0.09 / 4.0, rel=1e-6)
    assert foot_slide(sliding, 0.0 * standing) < 1e-9
    sunk = motion.clone()
    sunk[1:66:3] -= 1.0
    below = np.minimum(sunk[1:66:3].numpy()[[4, 5, 8, 9]], 0.0)
    assert foot_slide(sunk, 0.0 * standing) == pytest.approx(10.0 * (below**2).mean() / 4.0, rel=1e-6)


def test_a_standing_foot_of_a_turning_body_does_not_slide() -> None:
    """The body turns about the foot: the path and the turn cancel what the foot does in the body's frame."""
    angle, foot = 0.02, np.array([3.0, 0.0, 1.0])
    motion = torch.zeros(73, 2, dtype=torch.float64)
    motion[3:66].view(21, 3, 2)[:, 1] = 1.0
    motion[68] = angle
    cos, sin = np.cos(angle), np.sin(angle)
    turned_back = np.array([cos * foot[0] - sin * foot[2], 0.0, sin * foot[0] + cos * foot[2]])
    positions = motion[3:66].view(21, 3, 2)
    for joint in (3, 4, 7, 8):
        positions[joint, :, 0], positions[joint, :, 1] = torch.from_numpy(foot), torch.from_numpy(turned_back)
    assert foot_slide(motion, torch.ones(4, 2)) < 1e-6
    motion[68] = 0.0
    assert foot_slide(motion, torch.ones(4, 2)) > 1e-3


def test_the_path_takes_the_speed_and_keeps_the_turn() -> None:
    content, styled = torch.zeros(73, 10), torch.zeros(73, 10)
    content[66], content[68], styled[67] = 0.5, 0.1, 2.0
    path = holden.scaled_path(styled, content)
    np.testing.assert_allclose(path[0].numpy(), 2.0)
    np.testing.assert_allclose(path[1].numpy(), 0.0)
    np.testing.assert_allclose(path[2].numpy(), 0.1, rtol=1e-6)
    assert torch.isfinite(holden.scaled_path(styled, torch.zeros(73, 10))).all()


def test_matching_style_lowers_the_loss_from_noise() -> None:
    content, style = (torch.rand(1, 6, 16, generator=generator(seed)) for seed in (0, 1))
    start = torch.rand(1, 6, 16, generator=generator(2))
    config = replace(TINY, transfer_steps=100)
    end = holden.match_style(start, content, gram(style), config)
    weights = (0.1 / 1.1, 1.0 / 1.1)
    before, after = (holden.style_loss(hidden, content, gram(style), *weights) for hidden in (start, end))
    assert after < 0.2 * before


def test_training_is_deterministic_and_lowers_the_loss() -> None:
    config = replace(TINY, n_steps=60)
    _, network, curves = holden.train_holden(config, request(3))
    _, again, _ = holden.train_holden(config, request(3))
    _, other, _ = holden.train_holden(config, request(4))
    torch.testing.assert_close(network.encoder.weight, again.encoder.weight, rtol=0.0, atol=0.0)
    assert not torch.equal(network.encoder.weight, other.encoder.weight)
    losses = curves.values[:, curves.names.index("reconstruction")]
    assert losses[-5:].mean() < losses[:5].mean()


def test_motion_of_another_frame_rate_is_answered_at_the_trainings() -> None:
    """The network was trained at 30 fps: what it says of a motion does not depend on how finely that was sampled."""
    slow, style = crop(random_clip(70, seed=1), 0, 41), random_clip(19, seed=2)
    assert slow.fps == FPS
    fast, fast_style = resample(slow, 60.0), resample(style, 60.0)
    network = fitted()
    answer = holden.transfer(network, TINY, fast, fast_style, np.random.default_rng(0))
    expected = holden.transfer(network, TINY, slow, style, np.random.default_rng(0))
    assert answer.fps == 60.0 and answer.n_frames == fast.n_frames
    np.testing.assert_allclose(answer.root_xyz_m[::2], expected.root_xyz_m, atol=1e-3)


@pytest.mark.parametrize("n_frames", [1, 2, 7, 64])
def test_transfer_keeps_bones_and_length(n_frames: int) -> None:
    content, style = crop(random_clip(70, seed=1), 3, n_frames), random_clip(19, seed=2)
    network = fitted()
    styled = holden.transfer(network, TINY, content, style, np.random.default_rng(0))
    assert styled.n_frames == n_frames and styled.skeleton is content.skeleton and styled.fps == content.fps
    again = holden.transfer(network, TINY, content, style, np.random.default_rng(0))
    np.testing.assert_array_equal(styled.rotations_wxyz, again.rotations_wxyz)
    other = holden.transfer(network, TINY, content, style, np.random.default_rng(1))
    assert not np.array_equal(styled.rotations_wxyz, other.rotations_wxyz)
