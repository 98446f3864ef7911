"""Kuriyama's networks and losses against the paper's counts and small re-derivations."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation
from torch import Tensor, nn

from bench.methods.kuriyama2022.autoencoder import GestureAutoencoder, restoration_loss, squared_angles
from bench.methods.kuriyama2022.losses import (
    LOSSES,
    appearance_loss,
    identity_loss,
    losses_of,
    self_similarity,
    structure_loss,
    token_distance,
)
from bench.methods.kuriyama2022.tokens import latents_of, tokens_of
from bench.methods.kuriyama2022.transformer import (
    StyleTransformer,
    TransformerEncoder,
    avatar_net_swap,
    latent_adain,
    near,
    positions,
    restyled,
    whitened,
)


def generator(seed: int = 0) -> torch.Generator:
    return torch.Generator().manual_seed(seed)


def normal(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=generator(seed))


@pytest.fixture(scope="module")
def transformer() -> StyleTransformer:
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(0)
        return StyleTransformer().requires_grad_(False).eval()


def count(module: nn.Module) -> int:
    return sum(parameter.numel() for parameter in module.parameters())


def test_parameter_counts_are_the_papers() -> None:
    autoencoder = GestureAutoencoder()
    parts = (autoencoder.encoder, autoencoder.upper_decoder, autoencoder.lower_decoder)
    assert [count(part) for part in parts] == [10_288, 10_311, 3_144]
    assert count(autoencoder) == 23_743
    # The paper prints 50.2 thousand: queries, keys and values without bias, one norm before each use.
    assert count(StyleTransformer()) == 50_240
    kilobytes = 4 * (count(autoencoder) + count(StyleTransformer())) / 1000
    assert round(kilobytes) == 296


def test_autoencoder_keeps_a_quarter_of_the_frames() -> None:
    autoencoder = GestureAutoencoder()
    upper, lower = autoencoder(normal(2, 39, 64))
    assert autoencoder.encoder(normal(2, 39, 64)).shape == (2, 16, 16)
    assert upper.shape == (2, 39, 64)
    assert lower.shape == (2, 24, 64)


def test_squared_angles_are_scipys() -> None:
    first, second = Rotation.random(50, rng=1), Rotation.random(50, rng=2)
    found = squared_angles(torch.from_numpy(first.as_rotvec()), torch.from_numpy(second.as_rotvec()))
    np.testing.assert_allclose(found, (first.inv() * second).magnitude() ** 2, rtol=1e-6)


def test_restoration_loss_is_zero_for_itself_with_a_finite_gradient_and_grows_with_the_fault() -> None:
    upper, lower = 0.3 * normal(1, 39, 8), 0.3 * normal(1, 24, 8, seed=1)
    upper.requires_grad_()
    loss = restoration_loss(upper, lower, upper.detach(), lower)
    assert float(loss.detach()) < 1e-6
    loss.backward()  # type: ignore[no-untyped-call]
    assert upper.grad is not None and torch.isfinite(upper.grad).all()
    faults = [
        float(restoration_loss(upper.detach() + scale, lower, upper.detach(), lower)) for scale in (0.1, 0.2, 0.4)
    ]
    assert faults == sorted(faults) and faults[0] > 1e-3


def test_tokens_are_overlapping_runs_of_four_latents() -> None:
    latents = torch.arange(12.0).reshape(1, 2, 6)  # two channels, six latents
    tokens = tokens_of(latents)
    assert tokens.shape == (1, 3, 8)
    assert tokens[0, 0].tolist() == [0, 6, 1, 7, 2, 8, 3, 9]
    assert tokens[0, 1].tolist() == [2, 8, 3, 9, 4, 10, 5, 11]
    assert tokens[0, 2].tolist() == [4, 10, 5, 11, 5, 11, 5, 11]


@settings(max_examples=30, deadline=None)
@given(half=st.integers(1, 20), seed=st.integers(0, 1000))
def test_tokens_split_and_merge_round_trip(half: int, seed: int) -> None:
    latents = normal(2, 16, 2 * half, seed=seed)
    torch.testing.assert_close(latents_of(tokens_of(latents)), latents)


def test_merging_cross_fades_linearly() -> None:
    tokens = torch.zeros(1, 2, 4)  # one channel
    tokens[0, 1] = 1.0
    assert latents_of(tokens)[0, 0].tolist() == [0.0, 0.0, 0.25, 0.75]


def test_attention_mask_lets_tokens_see_twenty_to_each_side_and_the_class_token_all() -> None:
    allowed = near(50)
    assert allowed[0].all() and allowed[:, 0].all()
    for one in range(50):
        for other in range(50):
            assert allowed[1 + one, 1 + other] == (abs(one - other) <= 20)


def test_distant_tokens_do_not_matter_to_each_other(transformer: StyleTransformer) -> None:
    tokens = normal(1, 60, 64)
    changed = tokens.clone()
    changed[0, 50] = normal(64, seed=9)
    # The class token is masked out of nothing, yet within one layer it carries nothing from token to token.
    (_, before), (_, after) = transformer.encoder(tokens), transformer.encoder(changed)
    torch.testing.assert_close(before[0, :30], after[0, :30])
    assert (before[0, 30] - after[0, 30]).abs().max() > 1e-4


def test_encoder_is_a_pre_normalised_transformer_layer(transformer: StyleTransformer) -> None:
    tokens = normal(1, 5, 64)
    encoder = transformer.encoder
    sequence = torch.cat([encoder.class_token[None], tokens[0]]) + positions(6)
    normed = encoder.before_attention(sequence)
    attention = encoder.attention
    rows = []
    for asking in normed:
        scores = torch.stack([attention.queries(asking) @ attention.keys(other) / 8.0 for other in normed])
        weights = torch.exp(scores) / torch.exp(scores).sum()
        rows.append(sum(weight * attention.values(other) for weight, other in zip(weights, normed, strict=True)))
    sequence = sequence + attention.output(torch.stack(rows))
    sequence = sequence + encoder.mlp(encoder.before_mlp(sequence))
    class_token, encoded = encoder(tokens)
    torch.testing.assert_close(encoded[0], sequence[1:])
    torch.testing.assert_close(class_token[0], sequence[0])


def test_positions_are_sines_and_cosines() -> None:
    found = positions(3)
    assert found[2, 0] == pytest.approx(math.sin(2.0))
    assert found[2, 1] == pytest.approx(math.cos(2.0))
    assert found[2, 62] == pytest.approx(math.sin(2.0 / 10000 ** (62 / 64)))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000))
def test_soft_swap_lies_in_the_convex_hull_of_the_style_tokens(seed: int) -> None:
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(seed)
        transformer = StyleTransformer()
    content, style = normal(1, 7, 64, seed=seed), normal(1, 5, 64, seed=seed + 1)
    swapped = transformer.soft_swap(content, style)[0]
    weights = torch.linalg.lstsq(style[0].double().T, swapped.double().T.detach()).solution
    torch.testing.assert_close(style[0].double().T @ weights, swapped.double().T, atol=1e-6, rtol=1e-5)
    assert weights.min() > -1e-4
    torch.testing.assert_close(weights.sum(dim=0), torch.ones(7, dtype=torch.float64), atol=1e-4, rtol=0)


def test_hard_swap_is_the_soft_swap_at_zero_temperature(transformer: StyleTransformer) -> None:
    content, style = normal(2, 9, 64), normal(2, 6, 64, seed=1)
    torch.testing.assert_close(transformer.hard_swap(content, style), transformer.soft_swap(content, style, 1e-6))
    hard = transformer.hard_swap(content, style)
    assert all((hard[0, n] == style[0]).all(dim=1).any() for n in range(9))


def test_avatar_net_takes_the_nearest_direction() -> None:
    style = torch.zeros(1, 3, 64)
    style[0, 0, 0], style[0, 1, 1], style[0, 2, 0] = 2.0, 1.0, -5.0
    content = torch.zeros(1, 2, 64)
    content[0, 0, 0], content[0, 1, 1] = 0.1, 7.0
    swapped = avatar_net_swap(content, style)
    assert torch.equal(swapped[0, 0], style[0, 0])
    assert torch.equal(swapped[0, 1], style[0, 1])


def test_latent_adain_takes_mean_and_deviation_of_the_style() -> None:
    content, style = normal(1, 3, 50), 2.0 * normal(1, 3, 40, seed=1) + 1.0
    found = latent_adain(content, style).numpy()[0]
    for channel in range(3):
        source, target = content[0, channel].numpy(), style[0, channel].numpy()
        expected = target.std() * (source - source.mean()) / source.std() + target.mean()
        np.testing.assert_allclose(found[channel], expected, rtol=1e-4, atol=1e-5)
    torch.testing.assert_close(latent_adain(content, content), content)
    torch.testing.assert_close(restyled(whitened(content), content), content)
    still = torch.ones(1, 3, 10)
    assert torch.isfinite(latent_adain(still, style)).all()


class Copying(StyleTransformer):
    """Attention that is the identity where content is style."""

    def similarity(self, content: Tensor, style: Tensor) -> Tensor:
        return 1e4 * (1.0 - torch.cdist(content, style))


def test_identity_and_cyclic_loss_are_zero_where_attention_is_the_identity_and_positive_otherwise(
    transformer: StyleTransformer,
) -> None:
    content, style = normal(1, 6, 64), normal(1, 8, 64, seed=1)
    assert float(identity_loss(Copying().requires_grad_(False), content, style)) < 1e-5
    # Large tokens are already nearest to themselves in an untrained network, small ones drown in their positions.
    assert float(identity_loss(transformer, 0.01 * content, 0.01 * style)) > 0.01
    found = losses_of(Copying().requires_grad_(False), content, content, LOSSES)
    assert all(float(loss) < 1e-4 for loss in found.values())


def test_losses_grow_with_the_fault(transformer: StyleTransformer) -> None:
    content, fault = normal(1, 12, 64), normal(1, 12, 64, seed=5)
    for loss in (structure_loss, appearance_loss):
        values = [float(loss(transformer, content, content + scale * fault)) for scale in (0.0, 0.1, 0.3, 1.0)]
        assert values[0] < 1e-5
        assert values == sorted(values)


def test_losses_by_hand() -> None:
    first = torch.tensor([[[3.0, 0.0], [0.0, 2.0]]])
    second = torch.tensor([[[0.0, 4.0], [0.0, 2.0]]])
    assert float(token_distance(first, second)) == pytest.approx(2.5)
    assert self_similarity(first)[0].tolist() == [[1.0, 0.0], [0.0, 1.0]]
    # cosine matrices [[1, 0], [0, 1]] and all ones differ in two entries by one
    difference = self_similarity(first) - self_similarity(second)
    assert float(torch.linalg.matrix_norm(difference)[0]) == pytest.approx(math.sqrt(2.0))


def test_only_wanted_losses_are_there(transformer: StyleTransformer) -> None:
    content, style = normal(1, 6, 64), normal(1, 8, 64, seed=1)
    assert set(losses_of(transformer, content, style, ("cyclic", "structure"))) == {"cyclic", "structure"}


def test_without_position_codes_a_token_is_found_wherever_it_stands() -> None:
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(0)
        encoder = TransformerEncoder(with_positions=False)
    tokens = normal(1, 6, 64, seed=1)
    _, encoded = encoder(tokens)
    _, reversed_ = encoder(tokens.flip(1))
    torch.testing.assert_close(reversed_, encoded.flip(1), atol=1e-5, rtol=1e-5)
    _, with_codes = TransformerEncoder()(tokens.flip(1))
    assert not torch.allclose(with_codes, TransformerEncoder()(tokens)[1].flip(1), atol=1e-3)
