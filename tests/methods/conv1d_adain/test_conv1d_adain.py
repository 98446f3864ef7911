"""Conv1D+AdaIN: declared sizes, features, losses, training and transfer through the adapter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from bench.adapters.conv1d_adain import Conv1dAdain
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.methods.aberman2020.network import Generator
from bench.methods.conv1d_adain import conv1d_adain as conv
from bench.methods.layers import n_parameters
from bench.methods.motion_puzzle.features import clip_from_puzzle, puzzle_features
from bench.methods.training import FitRequest
from bench.methods.windows import to_tensor
from bench.motion.edit import crop, resample
from bench.motion.kinematics import world_positions
from tests.motion.factory import random_clip


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def ready() -> tuple[conv.ConvAdainNetwork, Tensor]:
    """A small network with the normalisation of one clip, and that clip's features."""
    features = to_tensor(puzzle_features(random_clip(32, amount_rad=0.5))[0])
    network = conv.ConvAdainNetwork(conv.CONFIGS["smoke"])
    network.fit_standardise(features)
    return network, features


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old")]
    return [take for take in chosen if take.content in ("walk", "kick")]


@pytest.fixture(scope="module")
def fitted(takes: list[Take]) -> Conv1dAdain:
    adapter = Conv1dAdain()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    return adapter


def test_parameters_at_full_width() -> None:
    """Aberman's generator without the video branch (1,266,812), 255 channels for 128, 64 and 124."""
    more = 8 * (144 * (255 - 128) + 96 * (255 - 64) + 144 * (255 - 124)) + (255 - 124)
    assert n_parameters(conv.ConvAdainNetwork(conv.ConvAdainConfig())) == 1_266_812 + more == 1_710_847


def test_features_round_trip() -> None:
    network, features = ready()
    back = network.features(network.motion(features))
    torch.testing.assert_close(back, features, atol=1e-5, rtol=1e-5)
    clip = random_clip(32, amount_rad=0.5)
    same = clip_from_puzzle(back[0].numpy().astype(np.float64), clip)
    np.testing.assert_allclose(world_positions(same), world_positions(clip), atol=1e-3)


def test_numbers_of_a_kind_share_their_deviation() -> None:
    network, features = ready()
    deviation, plain = network.standardise.deviation, conv.flat(features)
    kinds = deviation[:252].reshape(21, 4, 3)
    assert torch.equal(kinds, kinds[:1, :, :1].expand(21, 4, 3))
    assert deviation[252] == deviation[253]
    velocity = plain[..., :252].reshape(-1, 21, 4, 3)[:, :, 3]
    expected = velocity.var(dim=0, correction=0).mean().sqrt()
    torch.testing.assert_close(deviation[9], expected, rtol=1e-4, atol=0.0)


class Rebuilds(Generator):
    """A stand-in that decodes the content code and adds the style code: codes are the motion and a number."""

    def __init__(self, added: float) -> None:
        torch.nn.Module.__init__(self)
        self.added = added

    def content_encoder(self, motion: Tensor) -> Tensor:  # type: ignore[override]
        return motion

    def style_encoder(self, motion: Tensor) -> Tensor:  # type: ignore[override]
        return torch.full((len(motion), 1), self.added)

    def decode(self, content_code: Tensor, style_code: Tensor) -> Tensor:
        return content_code + style_code[:, :, None]


def test_losses_are_zero_for_a_network_that_rebuilds() -> None:
    source, target = (torch.randn(2, 255, 16, generator=torch.Generator().manual_seed(seed)) for seed in (0, 1))
    losses = conv.losses_of(Rebuilds(0.0), source, target)
    assert {name: float(loss) for name, loss in losses.items()} == dict.fromkeys(losses, 0.0)
    assert set(losses) == {"reconstruction", "cycle", "root", "smooth"}


def test_losses_grow_with_what_is_wrong() -> None:
    """A constant of 0.25 added by each decoding: once where rebuilt, twice and once in the two cycles."""
    source, target = (torch.randn(2, 255, 16, generator=torch.Generator().manual_seed(seed)) for seed in (0, 1))
    losses = conv.losses_of(Rebuilds(0.25), source, target)
    assert losses["reconstruction"] == pytest.approx(0.5, rel=1e-5)
    assert losses["cycle"] == pytest.approx(0.5 + 0.25, rel=1e-5)
    assert losses["root"] == pytest.approx(0.25, rel=1e-5)
    assert losses["smooth"] == pytest.approx(0.0, abs=1e-5)


def test_shaking_is_not_smooth() -> None:
    class Shakes(Rebuilds):
        def decode(self, content_code: Tensor, style_code: Tensor) -> Tensor:
            sign = torch.tensor([1.0, -1.0]).repeat(content_code.shape[2] // 2)
            return content_code + self.added * sign

    still = torch.zeros(1, 255, 16)
    losses = conv.losses_of(Shakes(0.1), still, still)
    assert losses["smooth"] == pytest.approx(0.2 + 0.2 + 0.4 + 0.2, rel=1e-5)


def test_training_lowers_the_losses(takes: list[Take]) -> None:
    config = replace(conv.CONFIGS["smoke"], n_steps=40, rate=3e-3)
    request = FitRequest(takes, 0, "smoke", "cpu", None, silent)
    _, _, curves = conv.train_conv_adain(config, request)
    reconstruction = curves.values[:, curves.names.index("reconstruction")]
    assert reconstruction[-5:].mean() < 0.8 * reconstruction[:5].mean()


def test_answers_fit_the_content(fitted: Conv1dAdain, takes: list[Take]) -> None:
    for n_frames, fps in ((1, 30.0), (10, 30.0), (45, 30.0), (90, 60.0)):
        source = takes[0].with_clip(crop(resample(takes[0].clip, fps), 0, n_frames))
        answer = fitted.transfer(source, takes[-1], rng=rng())
        assert (answer.n_frames, answer.fps) == (n_frames, fps)
        assert answer.skeleton == source.clip.skeleton


def test_mixtures(fitted: Conv1dAdain, takes: list[Take]) -> None:
    source, one, other = takes[0], takes[1], takes[-1]
    whole = fitted.transfer(source, one, rng=rng())
    same = fitted.interpolate(source, [(one, 0.25), (one, 0.75)], rng=rng())
    np.testing.assert_allclose(world_positions(same), world_positions(whole), atol=1e-4)
    half = fitted.interpolate(source, [(one, 0.5), (other, 0.5)], rng=rng())
    assert np.abs(half.rotations_wxyz - whole.rotations_wxyz).max() > 1e-7


def test_saved_and_loaded_it_answers_the_same(fitted: Conv1dAdain, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    loaded = Conv1dAdain()
    loaded.load(tmp_path)
    one, other = (row.transfer(takes[0], takes[-1], rng=rng()) for row in (fitted, loaded))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)


def test_training_is_decided_by_its_seed(fitted: Conv1dAdain, takes: list[Take]) -> None:
    again = Conv1dAdain()
    again.fit(takes, seed=0, budget="smoke", progress=silent)
    for one, other in zip(fitted.network.parameters(), again.network.parameters(), strict=True):
        np.testing.assert_array_equal(one.detach().numpy(), other.detach().numpy())
