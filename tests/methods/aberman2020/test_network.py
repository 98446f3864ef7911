"""Aberman 2020's networks: sizes as released, and every kind of layer against a derivation of its own."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from bench.arrays import FloatArray
from bench.methods.aberman2020.aberman2020 import AbermanConfig, AbermanNetwork
from bench.methods.aberman2020.network import (
    LEAST_FRAMES,
    CellDiscriminator,
    Conv,
    Decoder,
    Discriminator,
    Generator,
    NetworkSize,
    StyleEncoder,
)
from bench.methods.layers import adain, double_time, gradient_penalty, halve_time, hinge_discriminator, n_parameters

RELEASED = NetworkSize(content=128, style=64, video=42, output=124)
TINY = NetworkSize(content=5, style=4, video=3, output=6, hidden=8, style_hidden=6, mlp=(7, 9))


def drawn(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)


def test_parameters_of_the_released_network() -> None:
    """31 joints as quaternions and the root in, 31 out; 21 joints seen by the style encoder."""
    generator = Generator(RELEASED)
    assert n_parameters(generator) == 1_409_900
    assert generator.video_encoder is not None
    without = n_parameters(generator) - n_parameters(generator.video_encoder)
    assert without == n_parameters(Generator(NetworkSize(128, 64, 0, 124))) == 1_266_812
    assert n_parameters(Discriminator(64, n_styles=8)) == 1_009_752


def test_parameters_on_the_canonical_joints() -> None:
    """Ten joints fewer: 40 channels fewer in (kernel 8 to 144) and out (kernel 8 from 144, and a bias)."""
    fewer = 40 * 8 * 144 + 40 * (8 * 144 + 1)
    assert n_parameters(AbermanNetwork(AbermanConfig())) == 1_409_900 - fewer
    assert Discriminator(AbermanConfig().size.style, 7).heads.conv.out_channels == 7


def adain_by_hand(x: FloatArray, scale: FloatArray, shift: FloatArray) -> FloatArray:
    result = np.empty_like(x)
    for sample in range(x.shape[0]):
        for channel in range(x.shape[1]):
            row = x[sample, channel]
            mean = sum(row) / len(row)
            variance = sum((value - mean) ** 2 for value in row) / len(row)
            result[sample, channel] = scale[sample, channel] * (row - mean) / (variance + 1e-5) ** 0.5
            result[sample, channel] += shift[sample, channel]
    return result


def test_adain_by_hand() -> None:
    x, scale, shift = drawn(2, 3, 7), drawn(2, 3, seed=1), drawn(2, 3, seed=2)
    expected = adain_by_hand(x.numpy(), scale.numpy(), shift.numpy())
    np.testing.assert_allclose(adain(x, scale, shift).numpy(), expected, atol=1e-12)


def test_adain_gives_each_channel_the_mean_and_deviation_it_is_told() -> None:
    x, scale, shift = drawn(2, 3, 50), drawn(2, 3, seed=1).abs(), drawn(2, 3, seed=2)
    styled = adain(x, scale, shift)
    torch.testing.assert_close(styled.mean(dim=2), shift)
    torch.testing.assert_close(styled.std(dim=2, correction=0), scale, rtol=1e-4, atol=1e-4)


def test_pooling_over_time_by_hand() -> None:
    x = drawn(1, 2, 5)
    by_hand = torch.stack([(x[..., 0] + x[..., 1]) / 2, (x[..., 2] + x[..., 3]) / 2], dim=-1)
    torch.testing.assert_close(halve_time(x), by_hand)
    torch.testing.assert_close(double_time(x)[..., [0, 1, 8, 9]], x[..., [0, 0, 4, 4]])
    torch.testing.assert_close(halve_time(double_time(x)), x)


@pytest.mark.parametrize(("kernel", "stride"), [(8, 1), (8, 2), (6, 1)])
def test_convolution_by_hand(kernel: int, stride: int) -> None:
    """Reflected ends, one more of them after than before, so that T frames become T / stride."""
    conv = Conv(2, 3, kernel, stride).double()
    x = drawn(1, 2, 16)
    padded = np.pad(x[0].numpy(), ((0, 0), conv.ends), mode="reflect")
    weight, bias = conv.conv.weight.detach().numpy(), torch.as_tensor(conv.conv.bias).detach().numpy()
    starts = range(0, 16, stride)
    expected = np.stack([(padded[None, :, t : t + kernel] * weight).sum(axis=(1, 2)) + bias for t in starts], axis=-1)
    np.testing.assert_allclose(conv(x)[0].detach().numpy(), expected, atol=1e-12)


def test_style_codes_are_the_maximum_over_time_whatever_the_length() -> None:
    encoder = StyleEncoder(TINY.style, TINY).double()
    motion = drawn(2, 4, 32)
    assert encoder(motion).shape == (2, TINY.hidden) == encoder(motion[..., :20]).shape
    still = motion[..., :1].expand(-1, -1, 32)
    torch.testing.assert_close(encoder(still), encoder(still[..., :16]))


def test_the_decoder_knows_nothing_of_the_content_s_mean_and_deviation() -> None:
    """What AdaIN is for: a content code that is scaled and shifted channel by channel decodes to the same motion."""
    decoder = Decoder(TINY).double()
    content, numbers = drawn(2, TINY.hidden, 8), drawn(2, 2 * TINY.hidden, seed=1)
    moved = 300.0 * content + drawn(2, TINY.hidden, 1, seed=2)
    torch.testing.assert_close(decoder(moved, numbers), decoder(300.0 * content, numbers), rtol=1e-6, atol=1e-6)
    assert not torch.allclose(decoder(content, 2.0 * numbers), decoder(content, numbers))


@pytest.mark.parametrize("every_layer", [False, True])
def test_shapes(every_layer: bool) -> None:
    size = NetworkSize(5, 4, 3, 6, hidden=8, style_hidden=6, mlp=(7, 9), every_layer=every_layer)
    generator = Generator(size)
    motion = generator(torch.randn(2, 5, LEAST_FRAMES), torch.randn(2, 4, 30))
    assert motion.shape == (2, 6, LEAST_FRAMES)
    assert generator.video_encoder is not None
    assert generator.video_encoder(torch.randn(2, 3, LEAST_FRAMES)).shape == (2, 8)


def test_narrowing_leaves_the_channels_of_motion() -> None:
    narrow = RELEASED.narrowed(0.5)
    assert (narrow.content, narrow.style, narrow.video, narrow.output) == (128, 64, 42, 124)
    assert (narrow.hidden, narrow.style_hidden, narrow.mlp) == (72, 48, (96, 128))


def test_each_style_has_a_head_of_its_own() -> None:
    discriminator = Discriminator(4, n_styles=3, widths=(5, 6))
    motion = torch.randn(1, 4, 32).expand(3, -1, -1)
    scores, features = discriminator(motion, torch.arange(3))
    assert scores.shape == (3, 8) and features.shape == (3, 6, 8)
    assert not torch.allclose(scores[0], scores[1])
    torch.testing.assert_close(features[0], features[1])
    again, _ = discriminator(motion[:1], torch.tensor([2]))
    torch.testing.assert_close(again[0], scores[2])


def test_cells_shift_the_score_of_the_same_features() -> None:
    discriminator = CellDiscriminator(4, n_cells=6, width=8).eval()
    motion = torch.randn(1, 4, 32).expand(2, -1, -1)
    scores, features = discriminator(motion, torch.tensor([0, 5]))
    assert scores.shape == (2,) and features.shape == (2, 16)
    difference = ((discriminator.cells.weight[0] - discriminator.cells.weight[5]) * features[0]).sum()
    torch.testing.assert_close(scores[0] - scores[1], difference)


def test_hinge_by_hand() -> None:
    real, fake = torch.tensor([2.0, 0.5, -1.0]), torch.tensor([-3.0, 0.0])
    assert hinge_discriminator(real, fake) == pytest.approx((0.0 + 0.5 + 2.0) / 3 + (0.0 + 1.0) / 2)
    assert hinge_discriminator(torch.ones(3), -torch.ones(3)) == 0.0


def test_gradient_penalty_by_differences() -> None:
    """Against central differences of a small discriminator's mean score."""
    discriminator = Discriminator(2, n_styles=2, widths=(3, 3)).double()
    motion, styles = drawn(2, 2, 16), torch.tensor([0, 1])

    def score(x: Tensor) -> Tensor:
        scores: Tensor = discriminator(x, styles)[0]
        return scores.mean(dim=1)

    inputs = motion.clone().requires_grad_()
    penalty = gradient_penalty(score(inputs), inputs)
    step, squares = 1e-5, 0.0
    for place in range(motion[0].numel()):
        bump = torch.zeros_like(motion)
        bump.view(2, -1)[:, place] = step
        with torch.no_grad():
            slope = (score(motion + bump) - score(motion - bump)) / (2.0 * step)
        squares += float(slope.square().sum()) / len(motion)
    assert float(penalty.detach()) == pytest.approx(squares, rel=1e-4)
    assert squares > 0.0


def test_gradient_penalty_of_a_plane_and_of_a_constant() -> None:
    inputs = drawn(3, 2, 4).requires_grad_()
    assert gradient_penalty((2.0 * inputs).sum(dim=(1, 2)), inputs) == pytest.approx(4.0 * 8)
    assert gradient_penalty((0.0 * inputs).sum(dim=(1, 2)), inputs) == 0.0
