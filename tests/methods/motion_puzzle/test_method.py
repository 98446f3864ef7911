"""Motion Puzzle's features, training and transfer through the adapter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.adapters.motion_puzzle import MOTION_PUZZLE, Puzzle, PuzzleReleased, PuzzleWholeBody
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.errors import BadConfig
from bench.methods.motion_puzzle.attention_maps import attention_maps
from bench.methods.motion_puzzle.features import clip_from_puzzle, puzzle_features
from bench.methods.motion_puzzle.motion_puzzle import PuzzleConfig, random_crop, train_puzzle
from bench.methods.training import FitRequest
from bench.motion.edit import crop, resample
from bench.motion.kinematics import world_positions


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old")]
    return [take for take in chosen if take.content in ("walk", "run", "kick")]


@pytest.fixture(scope="module")
def fitted(takes: list[Take]) -> Puzzle:
    adapter = Puzzle()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    return adapter


@pytest.mark.parametrize("channels", [12, 15])
def test_features_round_trip(takes: list[Take], channels: int) -> None:
    clip = takes[0].clip
    features, _ = puzzle_features(clip)
    assert features.shape == (clip.n_frames, 21, 15)
    back = clip_from_puzzle(features[..., :channels], clip)
    np.testing.assert_allclose(world_positions(back), world_positions(clip), atol=1e-6)


def test_features_by_hand(takes: list[Take]) -> None:
    clip = takes[0].clip
    features, track = puzzle_features(clip)
    np.testing.assert_allclose(features[:, 0, [0, 2]], 0.0, atol=1e-12)
    np.testing.assert_allclose(features[:, 0, 1], clip.root_xyz_m[:, 1])
    speed = np.linalg.norm(np.diff(clip.root_xyz_m[:, [0, 2]], axis=0), axis=1) * clip.fps
    np.testing.assert_allclose(np.linalg.norm(features[1:, 7, 12:14], axis=-1), speed)
    np.testing.assert_allclose(features[1:, 3, 14], np.diff(track.yaw_rad) * clip.fps)


def test_random_crop_keeps_the_window_and_slows_or_speeds_it() -> None:
    generator = torch.Generator().manual_seed(0)
    line = torch.arange(64.0)[:, None, None].repeat(1, 21, 15)
    line[..., 9:] = 1.0
    rates = []
    for _ in range(50):
        found = random_crop(line.clone(), generator)
        assert found.shape == line.shape
        rate = float(found[1, 0, 0] - found[0, 0, 0])
        assert found[0, 0, 9] == pytest.approx(rate, rel=1e-3)
        rates.append(rate)
    assert min(rates) < 0.6 and max(rates) > 1.5


def test_answers_fit_the_content(fitted: Puzzle, takes: list[Take]) -> None:
    for n_frames, fps in ((1, 30.0), (10, 30.0), (90, 60.0)):
        clip = resample(takes[0].clip, fps)
        content = takes[0].with_clip(crop(clip, 0, n_frames))
        answer = fitted.transfer(content, takes[-1], rng=rng())
        assert (answer.n_frames, answer.fps) == (n_frames, fps)
        assert answer.skeleton == content.clip.skeleton


def test_parts_and_mixtures(fitted: Puzzle, takes: list[Take]) -> None:
    content, one, other = takes[0], takes[1], takes[-1]
    whole = fitted.transfer(content, one, rng=rng())
    same = fitted.interpolate(content, [(one, 0.25), (one, 0.75)], rng=rng())
    np.testing.assert_allclose(world_positions(same), world_positions(whole), atol=1e-4)
    arms = fitted.transfer_parts(content, {"arms": other}, rng=rng())
    again = fitted.transfer_parts(content, {"left_arm": other, "right_arm": other}, rng=rng())
    np.testing.assert_array_equal(arms.rotations_wxyz, again.rotations_wxyz)
    assert np.abs(arms.rotations_wxyz - fitted.transfer(content, content, rng=rng()).rotations_wxyz).max() > 1e-6


def test_the_whole_body_ablation_cannot_touch_one_part_alone(takes: list[Take]) -> None:
    adapter = PuzzleWholeBody()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    arms = adapter.transfer_parts(takes[0], {"arms": takes[-1]}, rng=rng())
    whole = adapter.transfer(takes[0], takes[-1], rng=rng())
    np.testing.assert_array_equal(arms.rotations_wxyz, whole.rotations_wxyz)


def test_saved_and_loaded_it_answers_the_same(fitted: Puzzle, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    loaded = Puzzle()
    loaded.load(tmp_path)
    assert loaded.config == fitted.config
    one, other = (method.transfer(takes[0], takes[-1], rng=rng()) for method in (fitted, loaded))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)


def test_training_is_decided_by_its_seed(fitted: Puzzle, takes: list[Take]) -> None:
    again = Puzzle()
    again.fit(takes, seed=0, budget="smoke", progress=silent)
    for one, other in zip(fitted.network.parameters(), again.network.parameters(), strict=True):
        np.testing.assert_array_equal(one.detach().numpy(), other.detach().numpy())


def test_the_released_form_has_twelve_channels_and_keeps_the_contents_path(takes: list[Take]) -> None:
    adapter = PuzzleReleased()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    assert adapter.config.shape.in_channels == 12
    answer = adapter.transfer(takes[0], takes[-1], rng=rng())
    np.testing.assert_allclose(answer.root_xyz_m[:, [0, 2]], takes[0].clip.root_xyz_m[:, [0, 2]], atol=1e-9)


@pytest.mark.parametrize("by_joint", [False, True])
def test_one_deviation_a_triple_of_coordinates_and_at_will_a_mean_a_joint(takes: list[Take], by_joint: bool) -> None:
    config = replace(PuzzleConfig(by_joint=by_joint).at("smoke"), steps=1)
    _, model, _ = train_puzzle(config, FitRequest(takes, 0, "smoke", "cpu", None, silent))
    standardise = model.standardise
    assert standardise.mean.shape == standardise.deviation.shape == ((21, 15) if by_joint else (15,))
    deviation = standardise.deviation.reshape(-1, 15)
    np.testing.assert_array_equal(deviation[:, [0, 3, 6, 9, 12]], deviation[:, [2, 5, 8, 11, 13]])
    np.testing.assert_array_equal(deviation, deviation[:1].expand_as(deviation))
    head = 12
    standing = np.mean([puzzle_features(take.clip)[0][:, head, 1].mean() for take in takes])
    mean_height = float(standardise.mean.reshape(-1, 15)[head if by_joint else 0, 1])
    assert (abs(mean_height - standing) < 0.05) == by_joint


def test_attention_maps_have_a_row_a_content_frame_that_sums_to_one(fitted: Puzzle, takes: list[Take]) -> None:
    content, style = crop(takes[0].clip, 0, 32), crop(takes[-1].clip, 0, 48)
    maps = attention_maps(fitted.network, content, style)
    assert list(maps) == ["left_leg", "right_leg", "spine", "left_arm", "right_arm"]
    for shares in maps.values():
        assert shares.shape == (32, 48)
        np.testing.assert_allclose(shares.sum(axis=1), 1.0, atol=1e-5)
    assert not any(layer._forward_pre_hooks for layer in fitted.network.network.modules())


def test_attention_that_is_cut_off_with_the_padding_is_missing(fitted: Puzzle, takes: list[Take]) -> None:
    maps = attention_maps(fitted.network, crop(takes[0].clip, 0, 30), crop(takes[-1].clip, 0, 46))
    assert maps["spine"].shape == (30, 46)
    assert (maps["spine"].sum(axis=1) < 1.0).all()


def test_variants_without_attention_have_no_maps(takes: list[Take]) -> None:
    adapter = PuzzleWholeBody()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    with pytest.raises(BadConfig, match="no attention on the graph of joints"):
        attention_maps(adapter.network, takes[0].clip, takes[-1].clip)


def test_rows_have_names_of_their_own() -> None:
    assert len({adapter.name for adapter in MOTION_PUZZLE}) == len(MOTION_PUZZLE) == 5
