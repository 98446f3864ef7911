"""The rows ``aberman2020`` and ``aberman2020-content``: representations, training and transfer through the adapters."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

from bench.adapters.aberman2020 import Aberman2020, Aberman2020Content
from bench.adapters.learned import LearnedAdapter
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.methods.aberman2020 import aberman2020, content
from bench.methods.aberman2020.aberman2020 import POSITIONS, ROOT, ROTATIONS, UNIT_M, AbermanNetwork
from bench.methods.aberman2020.content import ContentNetwork
from bench.methods.windows import to_tensor
from bench.motion.clip import Clip
from bench.motion.edit import crop, resample
from bench.motion.kinematics import world_positions
from tests.motion.factory import random_clip

Row = Aberman2020 | Aberman2020Content


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old")]
    return [take for take in chosen if take.content in ("walk", "run", "kick")]


@pytest.fixture(scope="module", params=[Aberman2020, Aberman2020Content], ids=lambda row: row.name)
def fitted(request: pytest.FixtureRequest, takes: list[Take]) -> Row:
    row: Row = request.param()
    row.fit(takes, seed=0, budget="smoke", progress=silent)
    return row


def test_poses_by_hand() -> None:
    clip = random_clip(30, amount_rad=0.5)
    poses = aberman2020.encode(clip)
    assert poses.shape == (30, 148)
    np.testing.assert_allclose(np.linalg.norm(poses[:, ROTATIONS].reshape(30, 21, 4), axis=-1), 1.0)
    np.testing.assert_allclose(poses[0, ROOT][[0, 2, 3]], 0.0, atol=1e-12)
    np.testing.assert_allclose(poses[:, ROOT][:, 1] * UNIT_M, clip.root_xyz_m[:, 1])
    joints = poses[:, POSITIONS].reshape(30, 20, 3) * UNIT_M
    world = world_positions(clip)
    np.testing.assert_allclose(
        np.linalg.norm(joints, axis=-1), np.linalg.norm(world[:, 1:] - world[:, :1], axis=-1), atol=1e-9
    )
    path = np.linalg.norm(np.diff(poses[:, ROOT][:, [0, 2]], axis=0), axis=1) * UNIT_M
    np.testing.assert_allclose(path, np.linalg.norm(np.diff(clip.root_xyz_m[:, [0, 2]], axis=0), axis=1), atol=1e-9)


@pytest.mark.parametrize(("n_frames", "fps"), [(40, 30.0), (7, 30.0), (41, 30.0)])
def test_decoding_the_contents_own_rotations_gives_the_content(
    monkeypatch: pytest.MonkeyPatch, n_frames: int, fps: float
) -> None:
    clip = random_clip(n_frames, fps, amount_rad=0.6)
    network = AbermanNetwork(aberman2020.CONFIGS["smoke"])

    def poses_as_code(self: AbermanNetwork, poses: Tensor) -> Tensor:
        return poses[..., ROTATIONS]

    def unchanged(self: AbermanNetwork, code: Tensor, style: Tensor) -> Tensor:
        return 3.0 * code.reshape(*code.shape[:2], 21, 4)

    monkeypatch.setattr(AbermanNetwork, "content_code", poses_as_code)
    monkeypatch.setattr(AbermanNetwork, "decode", unchanged)
    back = aberman2020.transfer(network, clip, [(random_clip(), 1.0)])
    np.testing.assert_allclose(world_positions(back), world_positions(clip), atol=2e-5)


def ready(clip: Clip) -> tuple[ContentNetwork, Tensor, Tensor]:
    """A network with the normalisation of one clip, the clip's poses and bones."""
    network = ContentNetwork(content.CONFIGS["smoke"])
    poses, bones = to_tensor(content.encode(clip)), content.in_statures(to_tensor(clip.skeleton.offsets_m))
    wxyz = content.split(poses)[0]
    network.reference_wxyz.copy_(wxyz[0, 0])
    network.standardise.fit(network.plain_channels(poses, bones), floor=1e-2)
    return network, poses, bones


def test_channels_round_trip() -> None:
    network, poses, bones = ready(random_clip(32, amount_rad=0.6))
    channels = network.channels(poses, bones)
    assert channels.shape == (1, 127, 32)
    wxyz, height = network.poses(channels[:, : content.N_OUTPUT])
    wanted, wanted_height, heading = content.split(poses)
    assert float(((wxyz * wanted).sum(dim=-1).abs() - 1.0).abs().max()) < 1e-5
    torch.testing.assert_close(height, wanted_height, atol=1e-5, rtol=1e-5)
    rebuilt, _ = network.motion(channels[:, : content.N_OUTPUT], heading, bones)
    torch.testing.assert_close(rebuilt, channels, atol=2e-3, rtol=1e-3)


def test_what_is_seen_is_the_body_without_its_path() -> None:
    clip = random_clip(32, amount_rad=0.6)
    _, poses, bones = ready(clip)
    view = content.seen(*content.split(poses), bones)[0, ..., :3].numpy() * clip.skeleton.stature_m
    world = world_positions(clip)
    np.testing.assert_allclose(view[..., 1], world[..., 1], atol=1e-5)
    np.testing.assert_allclose(
        np.linalg.norm(view[:, 1:] - view[:, :1], axis=-1), np.linalg.norm(world[:, 1:] - world[:, :1], axis=-1),
        atol=1e-5,
    )  # fmt: skip
    np.testing.assert_allclose(view[:, 0, [0, 2]], 0.0, atol=1e-6)


def test_statures() -> None:
    skeleton = random_clip().skeleton
    scaled = content.in_statures(to_tensor(skeleton.offsets_m))[0].numpy()
    np.testing.assert_allclose(scaled * skeleton.stature_m, skeleton.offsets_m, atol=1e-6)


def test_answers_fit_the_content(fitted: Row, takes: list[Take]) -> None:
    for n_frames, fps in ((1, 30.0), (10, 30.0), (45, 30.0), (90, 60.0)):
        clip = resample(takes[0].clip, fps)
        source = takes[0].with_clip(crop(clip, 0, n_frames))
        answer = fitted.transfer(source, takes[-1], rng=rng())
        assert (answer.n_frames, answer.fps) == (n_frames, fps)
        assert answer.skeleton == source.clip.skeleton
        np.testing.assert_allclose(
            answer.root_xyz_m[:, [0, 2]], source.clip.root_xyz_m[:, [0, 2]], atol=1e-9 if fps == 30.0 else 1e-2
        )


def test_labels_are_not_looked_at_and_short_references_do(fitted: Row, takes: list[Take]) -> None:
    nameless = [Take(take.clip, content=None, style=None, take_id="") for take in (takes[0], takes[-1])]
    named = fitted.transfer(takes[0], takes[-1], rng=rng())
    np.testing.assert_array_equal(fitted.transfer(*nameless, rng=rng()).rotations_wxyz, named.rotations_wxyz)
    short = takes[-1].with_clip(crop(takes[-1].clip, 0, 3))
    assert np.isfinite(fitted.transfer(takes[0], short, rng=rng()).rotations_wxyz).all()


def test_mixtures(fitted: Row, takes: list[Take]) -> None:
    source, one, other = takes[0], takes[1], takes[-1]
    whole = fitted.transfer(source, one, rng=rng())
    same = fitted.interpolate(source, [(one, 0.25), (one, 0.75)], rng=rng())
    np.testing.assert_allclose(world_positions(same), world_positions(whole), atol=1e-4)
    half = fitted.interpolate(source, [(one, 0.5), (other, 0.5)], rng=rng())
    assert np.abs(half.rotations_wxyz - whole.rotations_wxyz).max() > 1e-7


def test_saved_and_loaded_it_answers_the_same(fitted: Row, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    loaded = type(fitted)()
    loaded.load(tmp_path)
    assert loaded.config == fitted.config
    one, other = (row.transfer(takes[0], takes[-1], rng=rng()) for row in (fitted, loaded))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)
    assert fitted.describe().parameters > 0


def test_training_is_decided_by_its_seed(fitted: Row, takes: list[Take]) -> None:
    again: LearnedAdapter = type(fitted)()  # type: ignore[type-arg]
    again.fit(takes, seed=0, budget="smoke", progress=silent)
    for one, other in zip(fitted.network.parameters(), again.network.parameters(), strict=True):
        np.testing.assert_array_equal(one.detach().numpy(), other.detach().numpy())
