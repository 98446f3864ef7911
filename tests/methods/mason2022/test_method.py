"""Mason 2022 as a method: losses, a training that learns, rollouts that go where they are sent, new styles."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.adapters.mason2022 import MASON_2022, LpnFilm, PfnnOneHot
from bench.datasets.procedural.dataset import load as load_procedural
from bench.datasets.take import Take
from bench.errors import BadData, BadInput
from bench.methods.mason2022.examples import examples_of, layout_of, locomotion, style_clip
from bench.methods.mason2022.features import FPS, pose_of
from bench.methods.mason2022.mason2022 import (
    MODELS,
    MasonConfig,
    MasonNetwork,
    config_of,
    fine_tune,
    l_bll,
    l_mse,
    standardise,
    train_mason,
)
from bench.methods.mason2022.network import Backbone
from bench.methods.mason2022.rollout import Rollout, along, style_code
from bench.methods.mason2022.streaming import predict
from bench.methods.training import FitRequest
from bench.motion.edit import crop, resample
from bench.motion.kinematics import facing_yaw, world_positions
from bench.motion.skeleton import CANONICAL_PARENTS


@cache
def walks() -> tuple[Take, ...]:
    """Two walks and two runs of two styles."""
    takes = [take for take in load_procedural(None).takes if take.clip.n_frames > 70]
    styles = sorted({str(take.style) for take in takes})[:2]
    found: list[Take] = []
    for content in ("walk", "run"):
        for style in styles:
            found += [take for take in takes if (take.content, take.style) == (content, style)][:1]
    return tuple(found)


def request_for(takes: Sequence[Take], checkpoints: Path | None = None) -> FitRequest:
    return FitRequest(takes, 0, "smoke", "cpu", checkpoints, lambda what, done, total: None)


@cache
def trained(model: str, n_steps: int = 60) -> tuple[MasonConfig, MasonNetwork]:
    config = replace(config_of(model, "smoke"), n_steps=n_steps, hidden=48, rate=2e-3, dropout=0.0, batch=16)
    config, network, _ = train_mason(config, request_for(walks()))
    return config, network.eval()


def test_every_row_of_table_2_has_an_adapter() -> None:
    assert [adapter.model for adapter in MASON_2022] == list(MODELS)
    assert all({"predicts", "streams", "describes"} <= set(adapter.capabilities()) for adapter in MASON_2022)


@pytest.mark.parametrize("backbone", ["pfnn", "mann", "lpn"])
def test_examples_have_the_widths_of_the_networks(backbone: Backbone) -> None:
    takes = locomotion(walks())
    examples, shift = examples_of(takes, backbone)
    layout = layout_of(backbone)
    assert sorted(examples) == sorted({str(take.style) for take in takes})
    for style, found in examples.items():
        n = sum(take.clip.n_frames - 1 for take in takes if take.style == style)
        assert found.inputs.shape == (n, layout.n_input)
        assert found.outputs.shape == (n, layout.n_output)
        assert found.gates.shape == (n, {"pfnn": 1, "mann": 12, "lpn": 8}[backbone])
    assert (shift != 0.0) == (backbone == "pfnn")


def test_takes_that_stand_are_no_locomotion() -> None:
    still = [take for take in load_procedural(None).takes if take.content == "punch"][:2]
    with pytest.raises(BadData, match="takes of locomotion"):
        locomotion(still)


def test_short_style_clips_are_said_again() -> None:
    assert np.array_equal(style_clip(np.arange(3.0)[:, None], 7)[:, 0], [0, 1, 2, 0, 1, 2, 0])


def test_losses_are_zero_on_the_truth_and_grow_with_the_fault() -> None:
    pose = torch.randn(4, 252)
    assert float(l_mse(pose, pose)) == 0.0
    assert float(l_mse(pose, pose + 2.0)) == pytest.approx(4.0)
    assert float(l_bll(pose, pose)) == 0.0
    moved = pose.view(4, 21, 12).clone()
    moved[..., :3] += torch.tensor([1.0, -2.0, 0.5])
    assert float(l_bll(pose, moved.view(4, -1))) == pytest.approx(0.0, abs=1e-5)
    longer = pose.view(4, 21, 12).clone()
    longer[..., :3] *= 1.5
    positions = pose.view(4, 21, 12)[..., :3]
    bones = [joint for joint in range(1, 21) if joint not in (16, 20)]
    lengths = [(positions[:, j] - positions[:, CANONICAL_PARENTS[j]]).norm(dim=-1) for j in bones]
    assert float(l_bll(pose, longer.view(4, -1))) == pytest.approx(0.5 * float(torch.stack(lengths).mean()), rel=1e-5)


@pytest.mark.parametrize("model", ["pfnn-onehot", "lpn-resad", "mann-film", "lpn-film"])
def test_training_lowers_the_error_and_is_repeatable(model: str) -> None:
    config = replace(config_of(model, "smoke"), n_steps=60, hidden=32, rate=2e-3, dropout=0.0)
    config, network, curves = train_mason(config, request_for(walks()))
    mse = curves.values[:, curves.names.index("mse")]
    assert mse[-10:].mean() < 0.7 * mse[:5].mean()
    _, again, _ = train_mason(config, request_for(walks()))
    for one, other in zip(network.state_dict().values(), again.state_dict().values(), strict=True):
        assert torch.equal(one, other)


@pytest.mark.parametrize("model", sorted(MODELS))
def test_next_frame_is_near_the_present_one(model: str) -> None:
    _, network = trained(model)
    take = walks()[0]
    past, following = crop(take.clip, 0, 40), crop(take.clip, 40, 1)
    code = style_code(network, take.clip, {str(take.style): 1.0})
    path = take.clip.root_xyz_m[40:70, [0, 2]]
    found = predict(network, code, past, path)
    assert (found.n_frames, found.fps) == (1, past.fps)
    off = np.linalg.norm(world_positions(found) - world_positions(following), axis=-1)
    assert off.mean() < 0.25
    assert np.allclose(found.root_xyz_m[0, [0, 2]], following.root_xyz_m[0, [0, 2]], atol=0.1)


def test_a_stream_starts_with_the_source_and_leaves_other_streams_alone() -> None:
    config, network = trained("lpn-film")
    adapter = LpnFilm()
    adapter.config, adapter.network = config, network
    source, other = walks()[0].clip, walks()[3].clip
    style = Take(other)

    def answers(streams: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
        rng = np.random.default_rng(0)
        opened = [adapter.open_stream(style, content_label=None, rng=rng) for _ in range(streams)]
        found = []
        for frame in range(12):
            outputs = [
                stream.step(clip.rotations_wxyz[frame], clip.root_xyz_m[frame])
                for stream, clip in zip(opened, (source, other), strict=False)
            ]
            found.append(outputs[0][0])
        return found

    alone, beside = answers(1), answers(2)
    assert np.array_equal(alone[0], source.rotations_wxyz[0])
    assert all(np.array_equal(one, two) for one, two in zip(alone, beside, strict=True))


def test_a_rollout_can_be_copied_and_goes_on_by_itself() -> None:
    _, network = trained("pfnn-film")
    clip = resample(walks()[0].clip, FPS)
    rollout = Rollout(network, style_code(network, clip), crop(clip, 0, 60))
    ahead, yaw = np.repeat(clip.root_xyz_m[60:61, [0, 2]], 6, axis=0), np.zeros(6)
    rollout.step(ahead, yaw)
    twin = copy.copy(rollout)
    first, second = rollout.step(ahead, yaw), twin.step(ahead, yaw)
    assert np.array_equal(first.positions_m, second.positions_m)
    assert np.array_equal(first.positions_m, second.positions_m)


def test_a_rollout_follows_its_path_and_keeps_bones() -> None:
    _, network = trained("lpn-film", 400)
    take = walks()[0]
    clip = resample(take.clip, FPS)
    code = style_code(network, clip)
    n = clip.n_frames - 61
    yaw = np.unwrap(facing_yaw(world_positions(clip)))
    path = clip.root_xyz_m[:, [0, 2]]
    found = along(Rollout(network, code, crop(clip, 0, 61)), path[61:], yaw[61:], clip)
    assert found.n_frames == n
    assert np.isfinite(found.rotations_wxyz).all()
    assert np.linalg.norm(found.root_xyz_m[-1, [0, 2]] - path[-1]) < 0.5
    assert found.skeleton.same_bones(clip.skeleton)


def test_predicted_bones_fit_predicted_positions() -> None:
    _, network = trained("mann-film")
    take = walks()[1]
    past = crop(take.clip, 0, 40)
    code = style_code(network, take.clip)
    found = predict(network, code, past, take.clip.root_xyz_m[40:70, [0, 2]])
    positions = world_positions(found)[0]
    assert np.isfinite(positions).all()
    stature = np.linalg.norm(positions[12] - positions[4])
    assert 0.5 < stature / past.skeleton.stature_m < 1.5


def test_new_styles_are_learned_by_the_film_generator_alone() -> None:
    takes = walks()
    old, new = sorted({str(take.style) for take in takes})
    of_old = [take for take in takes if take.style == old]
    config = replace(config_of("lpn-film", "smoke"), n_steps=40, hidden=32, rate=2e-3, dropout=0.0)
    config, network, _ = train_mason(config, request_for(of_old))
    kept = style_code(network.eval(), of_old[0].clip)
    inputs, gates = torch.randn(3, config.layout.n_input), torch.randn(3, 8)
    with torch.no_grad():
        before = network(inputs, gates, kept.expand(3, -1))
    fresh, _ = examples_of(locomotion([take for take in takes if take.style == new]), "lpn")
    curves = fine_tune(network, fresh, 300, request_for(takes))
    network.eval()
    with torch.no_grad():
        assert torch.equal(network(inputs, gates, kept.expand(3, -1)), before)
    mse = curves.values[:, curves.names.index("mse")]
    assert mse[-50:].mean() < mse[:50].mean()
    with pytest.raises(ValueError, match="only FiLM learns new styles"):
        fine_tune(trained("lpn-onehot")[1], fresh, 1, request_for(takes))


def test_unknown_styles_are_refused_by_models_that_know_labels() -> None:
    adapter = PfnnOneHot()
    adapter.config, adapter.network = trained("pfnn-onehot")
    with pytest.raises(BadInput, match="knows the styles"):
        adapter.predict(crop(walks()[0].clip, 0, 30), Take(walks()[0].clip, style="nobody"), np.zeros((30, 2)))


def test_a_style_code_can_be_a_mixture() -> None:
    config, network = trained("lpn-resad")
    one, two = config.styles
    mixed = style_code(network, None, {one: 0.25, two: 0.75})
    assert torch.equal(mixed, torch.tensor([[0.25, 0.75]]))
    with pytest.raises(KeyError):
        style_code(network, None, {"nobody": 1.0})


def test_statistics_are_taken_over_all_styles() -> None:
    config = replace(config_of("lpn-film", "smoke"), styles=("a", "b"))
    network = MasonNetwork(config)
    examples, _ = examples_of(locomotion(walks()), "lpn")
    standardise(network, list(examples.values()))
    everything = np.concatenate([found.outputs for found in examples.values()])
    assert np.allclose(network.output_scale.mean.numpy(), everything.mean(axis=0), atol=1e-4)


def test_poses_are_rotations_whatever_the_network_says() -> None:
    _, rotations = pose_of(np.random.default_rng(0).normal(size=(5, 252)))
    assert np.allclose(np.linalg.norm(rotations, axis=-1), 1.0)


def test_what_is_fed_back_does_not_grow_without_end() -> None:
    config, network = trained("pfnn-onehot")
    far = torch.full((1, config.layout.n_input), 1e6)
    farther = torch.full((1, config.layout.n_input), 1e9)
    code = torch.tensor([[1.0, 0.0]])
    with torch.no_grad():
        assert torch.equal(network(far, torch.zeros(1, 1), code), network(farther, torch.zeros(1, 1), code))
