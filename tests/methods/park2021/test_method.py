"""Park 2021's training and transfer through the adapter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.adapters.park2021 import PARK_2021, Park, ParkContent, ParkWithoutDiversity, ParkWithoutStyleAndDiversity
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.errors import BadInput
from bench.methods.park2021.park2021 import Park2021, ParkConfig
from bench.motion.clip import Clip
from bench.motion.edit import crop, join, resample
from bench.motion.kinematics import world_positions
from bench.motion.park_features import ROTATION


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old")]
    return [take for take in chosen if take.content in ("walk", "run", "kick")]


@pytest.fixture(scope="module")
def fitted(takes: list[Take]) -> Park:
    return trained(Park, takes)


def trained(adapter: type[Park], takes: list[Take]) -> Park:
    method = adapter()
    method.fit(takes, seed=0, budget="smoke", progress=silent)
    return method


def moved(one: Clip, other: Clip) -> float:
    return float(np.abs(one.rotations_wxyz - other.rotations_wxyz).max())


ALWAYS = {"adversarial", "cycle", "identity", "discriminator", "penalty"}


@pytest.mark.parametrize(
    ("adapter", "losses"),
    [
        (Park, {"style", "diversity"}),
        (ParkWithoutDiversity, {"style"}),
        (ParkWithoutStyleAndDiversity, set()),
        (ParkContent, {"style", "diversity", "perceptual", "content_class", "style_class"}),
    ],
)
def test_losses_of_the_rows(adapter: type[Park], losses: set[str], takes: list[Take]) -> None:
    curves = trained(adapter, takes[::2]).curves
    assert curves is not None
    assert set(curves.names) == ALWAYS | losses
    assert np.isfinite(curves.values).all()


def test_rows_are_the_three_loss_sets_of_table_1_and_the_one_with_content_labels() -> None:
    assert [row.name for row in PARK_2021] == ["park2021", "park2021-adv-cyc-id", "park2021-sty", "park2021-content"]


def test_capabilities(fitted: Park) -> None:
    assert set(fitted.capabilities()) == {"transfers", "samples", "interpolates", "describes"}
    assert fitted.describe().parameters > 1000
    assert fitted.network.config.style_labels == ("neutral", "old")


def test_answers_fit_the_content(fitted: Park, takes: list[Take]) -> None:
    for n_frames, fps in ((1, 30.0), (10, 30.0), (90, 60.0)):
        content = takes[0].with_clip(crop(resample(takes[0].clip, fps), 0, n_frames))
        answer = fitted.transfer(content, takes[-1], rng=rng())
        assert (answer.n_frames, answer.fps) == (n_frames, fps)
        assert answer.skeleton == content.clip.skeleton
        np.testing.assert_allclose(answer.root_xyz_m[:, [0, 2]], content.clip.root_xyz_m[:, [0, 2]], atol=1e-2)


def test_long_heterogeneous_clips_are_answered_at_once(fitted: Park, takes: list[Take]) -> None:
    clip = join([take.clip for take in takes[:3]] * 3, blend_s=0.2)
    assert clip.n_frames > 300
    answer = fitted.sample(takes[0].with_clip(clip), "old", rng=rng())
    assert answer.n_frames == clip.n_frames


def test_references_of_any_length_have_a_code(fitted: Park, takes: list[Take]) -> None:
    clip = takes[0].clip
    codes = [fitted.network.code_of_reference(crop(clip, 0, n), "old") for n in (1, 30, clip.n_frames)]
    assert {tuple(code.shape) for code in codes} == {(1, 8)}


def test_latent_codes_come_from_the_generator_given(fitted: Park, takes: list[Take]) -> None:
    one, again, other = (fitted.sample(takes[0], "old", rng=rng(seed)) for seed in (0, 0, 1))
    np.testing.assert_array_equal(one.rotations_wxyz, again.rotations_wxyz)
    assert moved(one, other) > 1e-6


def test_mixtures_within_and_between_domains(fitted: Park, takes: list[Take]) -> None:
    content, one = takes[0], takes[1]
    other = next(take for take in takes if take.style != one.style)
    same = fitted.interpolate(content, [(one, 0.25), (one, 0.75)], rng=rng())
    whole = fitted.transfer(content, one, rng=rng())
    np.testing.assert_allclose(world_positions(same), world_positions(whole), atol=2e-3)
    half = fitted.interpolate(content, [(one, 0.5), (other, 0.5)], rng=rng())
    assert moved(half, whole) > 1e-6


def test_unknown_styles_are_refused(fitted: Park, takes: list[Take]) -> None:
    with pytest.raises(BadInput, match="style must be one of neutral, old; got 'proud'"):
        fitted.sample(takes[0], "proud", rng=rng())
    with pytest.raises(BadInput, match="got None"):
        fitted.transfer(takes[0], takes[1].hidden(content=False, style=False), rng=rng())


def test_saved_and_loaded_it_answers_the_same(fitted: Park, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    loaded = Park()
    loaded.load(tmp_path)
    assert loaded.config == fitted.config
    one, other = (method.transfer(takes[0], takes[-1], rng=rng()) for method in (fitted, loaded))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)


def test_training_is_decided_by_its_seed(fitted: Park, takes: list[Take]) -> None:
    again = trained(Park, takes)
    for one, other in zip(fitted.network.parameters(), again.network.parameters(), strict=True):
        np.testing.assert_array_equal(one.detach().numpy(), other.detach().numpy())


def test_networks_see_the_same_motion_whatever_the_signs_of_its_quaternions(fitted: Park) -> None:
    features = torch.randn(2, 16, 21, 7, generator=torch.Generator().manual_seed(0))
    flipped = features.clone()
    flipped[1, :, 3, ROTATION] *= -1.0
    network = fitted.network
    torch.testing.assert_close(network.motions(features), network.motions(flipped))
    torch.testing.assert_close(network.features(network.motions(features)), network.signed(features))


def test_budgets_change_the_training_and_not_the_variant() -> None:
    config = ParkConfig(diversity=0.0)
    assert config.at("paper") is config
    assert config.at("small").diversity == config.at("smoke").diversity == 0.0
    assert config.at("smoke").n_steps < config.at("small").n_steps < config.n_steps == 100_000
    network = Park2021(replace(config.at("smoke"), style_labels=("a", "b", "c")))
    assert len(network.style_encoder.heads) == 3
