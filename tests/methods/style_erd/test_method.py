"""The rows ``style_erd*``: losses, training, transfer, mixtures and streams through the adapters."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from bench.adapters.style_erd import STYLE_ERD, StyleErd, StyleErdContent
from bench.arrays import FloatArray
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.errors import BadInput
from bench.methods.style_erd import losses
from bench.methods.style_erd.frames import N_POSITIONS, N_ROTATIONS
from bench.methods.style_erd.streaming import StyleErdStream, transfer
from bench.methods.style_erd.style_erd import StyleErdConfig, StyleErdTraining, encode, train_style_erd
from bench.methods.training import FitRequest, seeded
from bench.methods.windows import cut_windows
from bench.motion.clip import Clip
from bench.motion.edit import resample
from tests.motion.factory import random_clip


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old", "proud")]
    return [take for take in chosen if take.content in ("walk", "kick")]


@pytest.fixture(scope="module")
def fitted(takes: list[Take]) -> StyleErd:
    row = StyleErd()
    row.fit(takes, seed=0, budget="smoke", progress=silent)
    with torch.no_grad():
        for name, weight in row.network.generator.named_parameters():
            if name.endswith("states"):
                weight.normal_(generator=torch.Generator().manual_seed(1))
    return row


def training(takes: Sequence[Take], **changes: object) -> StyleErdTraining:
    config = replace(StyleErdConfig().at("smoke"), **changes)  # type: ignore[arg-type]
    windows = cut_windows(takes, encode, n_frames=config.n_frames, stride=config.stride)
    config = config.with_labels(windows.style_labels, windows.content_labels)
    with seeded(0) as generator:
        return StyleErdTraining(config, windows, generator, FitRequest(takes, 0, "smoke", "cpu", None, silent))


def test_quaternions_are_compared_by_half_their_angle() -> None:
    one = torch.tensor([[[1.0, 0.0, 0.0, 0.0]]])
    half = math.radians(35.0)
    other = torch.tensor([[[math.cos(half), math.sin(half), 0.0, 0.0]]])
    assert losses.quaternion_angle(one, other) == pytest.approx(half**2, rel=1e-4)
    assert losses.quaternion_angle(one, -other) == pytest.approx(half**2, rel=1e-4)
    same = one.clone().requires_grad_()
    losses.quaternion_angle(same, one).backward()  # type: ignore[no-untyped-call]
    assert same.grad is not None and bool(torch.isfinite(same.grad).all())


def test_adversarial_losses_have_their_targets() -> None:
    real, fake = torch.tensor([1.0, 1.0]), torch.tensor([-1.0, -1.0])
    assert losses.critic(real, fake) == 0.0 and losses.critic(-real, -fake) == 8.0
    assert losses.adversarial(fake) == 1.0 and losses.adversarial(0.0 * fake) == 0.0


def test_velocities_that_are_those_of_the_positions_agree() -> None:
    positions = torch.randn(2, 6, 5, generator=torch.Generator().manual_seed(0))
    velocities = torch.cat([torch.full((2, 1, 5), 9.0), positions[:, 1:] - positions[:, :-1]], dim=1)
    assert losses.disagreement(torch.cat([positions, velocities], dim=2)) == 0.0
    assert losses.disagreement(torch.cat([positions, velocities + 0.5], dim=2)) == pytest.approx(0.25)


def test_pairs_go_from_neutral_to_styles_and_back(takes: list[Take]) -> None:
    state = training(takes, batch=16)
    rows, target = state._pairs()
    source = state.windows.styles[rows]
    neutral = state.windows.style_labels.index("neutral")
    assert (source[:8] == neutral).all() and (target[:8] != neutral).all()
    assert (source[8:] != neutral).all() and (target[8:] == neutral).all()
    rows, target = training(takes, batch=16, any_pairs=True)._pairs()
    assert (state.windows.styles[rows] != target).all()


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({}, {"critic", "penalty", "rotation", "position", "velocity", "adversarial", "perceptual"}),
        ({"adversarial": 0.0, "perceptual": 0.0}, {"rotation", "position", "velocity"}),
        ({"perceptual": 0.0}, {"critic", "penalty", "rotation", "position", "velocity", "adversarial"}),
        ({"adversarial": 0.0}, {"rotation", "position", "velocity", "perceptual"}),
    ],
)
def test_each_ablation_has_its_losses(takes: list[Take], changes: dict[str, object], expected: set[str]) -> None:
    state = training(takes, **changes)
    before = {name: weight.clone() for name, weight in state.network.state_dict().items()}
    found = state.step(0)
    assert set(found) == expected
    assert all(math.isfinite(float(torch.as_tensor(value).detach())) for value in found.values())
    moved = {name for name, weight in state.network.state_dict().items() if not torch.equal(before[name], weight)}
    assert any(name.startswith("generator.encoder") for name in moved)
    assert any(name == "generator.neutral.states" for name in moved)


def test_true_rotations_have_the_positions_of_the_frames(takes: list[Take]) -> None:
    state = training(takes)
    motion = state.frames.motion[:3]
    unit = motion[..., :N_ROTATIONS].reshape(3, -1, 21, 4)
    made = state.network.reader.positions(unit)[..., 1:, :].flatten(2)
    torch.testing.assert_close(made, motion[..., N_ROTATIONS : N_ROTATIONS + N_POSITIONS], atol=1e-3, rtol=1e-3)


def stream_of(stream: StyleErdStream, clip: Clip, start: int = 0, stop: int | None = None) -> FloatArray:
    stop = clip.n_frames if stop is None else stop
    return np.stack([stream.step(clip.rotations_wxyz[t], clip.root_xyz_m[t])[0] for t in range(start, stop)])


def test_the_stream_is_the_offline_answer(fitted: StyleErd, takes: list[Take]) -> None:
    for content in takes[:3]:
        for style in takes[3:5]:
            offline = fitted.transfer(content, style, rng=rng())
            stream = fitted.open_stream(style, content_label=content.content, rng=rng())
            assert isinstance(stream, StyleErdStream)
            clip = content.clip
            np.testing.assert_allclose(stream_of(stream, clip), offline.rotations_wxyz, atol=1e-5)
            np.testing.assert_array_equal(offline.root_xyz_m, clip.root_xyz_m)


def test_the_first_frame_is_answered_and_nothing_of_the_future_is_read(fitted: StyleErd) -> None:
    clip = random_clip(30)
    cut = clip.with_motion(clip.rotations_wxyz[:11], clip.root_xyz_m[:11])
    whole = transfer(fitted.network, clip, "walk", [("old", 1.0)])
    short = transfer(fitted.network, cut, "walk", [("old", 1.0)])
    np.testing.assert_allclose(short.rotations_wxyz, whole.rotations_wxyz[:11], atol=1e-5)
    assert fitted.traits.look_ahead_frames == 0 and fitted.traits.designed_input_frames == 1


def test_streams_do_not_know_of_each_other(fitted: StyleErd) -> None:
    clip, other = random_clip(12, seed=1), random_clip(12, seed=2)
    alone = stream_of(StyleErdStream(fitted.network, "walk", [("old", 1.0)]), clip)
    one = StyleErdStream(fitted.network, "walk", [("old", 1.0)])
    two = StyleErdStream(fitted.network, "kick", [("proud", 1.0)])
    frames = []
    for t in range(12):
        two.step(other.rotations_wxyz[t], other.root_xyz_m[t])
        frames.append(one.step(clip.rotations_wxyz[t], clip.root_xyz_m[t])[0])
    np.testing.assert_array_equal(np.stack(frames), alone)


def test_a_stream_can_be_paused_copied_and_resumed(fitted: StyleErd) -> None:
    clip, other = random_clip(20, seed=1), random_clip(20, seed=2)
    alone = stream_of(StyleErdStream(fitted.network, "walk", [("old", 1.0)]), clip)
    stream = StyleErdStream(fitted.network, "walk", [("old", 1.0)])
    stream_of(stream, clip, 0, 8)
    kept = stream.copy()
    stream_of(stream, other, 0, 20)
    np.testing.assert_array_equal(stream_of(kept.copy(), clip, 8), alone[8:])
    np.testing.assert_array_equal(stream_of(kept, clip, 8), alone[8:])


def test_intensity_and_mixtures(fitted: StyleErd, takes: list[Take]) -> None:
    """No weight is neutral, a mixture lies between, and the order of its styles does not matter."""
    clip = random_clip(20)

    def answer(*styles: tuple[str, float]) -> FloatArray:
        return transfer(fitted.network, clip, "walk", styles).rotations_wxyz

    neutral, old, proud = answer(("neutral", 1.0)), answer(("old", 1.0)), answer(("proud", 1.0))
    np.testing.assert_array_equal(answer(), neutral)
    np.testing.assert_allclose(answer(("old", 0.5), ("neutral", 0.5)), answer(("old", 0.5)), atol=1e-12)
    np.testing.assert_allclose(answer(("old", 0.3), ("proud", 0.7)), answer(("proud", 0.7), ("old", 0.3)), atol=1e-6)
    distances = [float(np.linalg.norm(answer(("old", weight)) - neutral)) for weight in (0.25, 0.5, 1.0)]
    assert 0.0 < distances[0] < distances[1] < distances[2]
    assert np.linalg.norm(old - proud) > 0.0
    by_takes = fitted.interpolate(Take(clip, content="walk"), [(takes[0], 0.5), (takes[1], 0.5)], rng=rng())
    assert by_takes.n_frames == 20


def test_weights_are_intensities_and_neutral_is_the_rest(fitted: StyleErd) -> None:
    network = fitted.network
    assert network.style_weights([("old", 0.25), ("neutral", 0.75)]).tolist() == [[0.25, 0.0]]
    assert network.style_weights([("old", 0.5), ("proud", 0.5)]).tolist() == [[0.5, 0.5]]
    assert network.content_weights("walk").tolist() == [[0.0, 1.0]]


def test_a_style_that_was_not_trained_is_refused_and_a_content_is_not(fitted: StyleErd) -> None:
    clip = random_clip(10)
    with pytest.raises(BadInput, match="knows the styles neutral, old, proud, got 'angry'"):
        transfer(fitted.network, clip, "walk", [("angry", 1.0)])
    for label in ("swim", None):
        assert transfer(fitted.network, clip, label, [("old", 1.0)]).n_frames == 10
    torch.testing.assert_close(fitted.network.content_weights("swim"), torch.full((1, 2), 0.5))


def test_other_frame_rates_come_back_at_their_own(fitted: StyleErd) -> None:
    clip = random_clip(41, 60.0)
    made = transfer(fitted.network, clip, "walk", [("old", 1.0)])
    assert (made.n_frames, made.fps) == (41, 60.0)
    half = transfer(fitted.network, resample(clip, 30.0), "walk", [("old", 1.0)])
    np.testing.assert_allclose(made.rotations_wxyz[0], half.rotations_wxyz[0], atol=1e-6)


def test_what_was_saved_answers_as_what_was_trained(fitted: StyleErd, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    restored = StyleErd()
    restored.load(tmp_path)
    one, other = (row.transfer(takes[0], takes[3], rng=rng()) for row in (fitted, restored))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)
    assert restored.describe() == fitted.describe()
    assert restored.describe().bytes_per_style == 4 * 34_048


def test_a_stopped_training_ends_as_one_that_was_not(takes: list[Take], tmp_path: Path) -> None:
    def run(checkpoints: Path | None, *, stop: bool = False) -> dict[str, torch.Tensor]:
        def progress(what: str, done: int, total: int) -> None:
            if stop and what.startswith("training") and done == total:
                raise KeyboardInterrupt

        config = StyleErdConfig().at("smoke")
        request = FitRequest(takes, 0, "smoke", "cpu", checkpoints, progress)
        return train_style_erd(config, request)[1].state_dict()

    straight = run(None)
    with pytest.raises(KeyboardInterrupt):
        run(tmp_path, stop=True)
    assert (tmp_path / "content classifier.pt").is_file()
    again = run(tmp_path)
    assert all(torch.equal(straight[name], again[name]) for name in straight)


@pytest.mark.slow
@pytest.mark.parametrize("row", STYLE_ERD, ids=lambda row: row.name)
def test_every_row_trains_and_answers(row: type[StyleErd], takes: list[Take]) -> None:
    method = row()
    method.fit(takes, seed=0, budget="smoke", progress=silent)
    made = method.transfer(takes[0], takes[3], rng=rng())
    assert made.n_frames == takes[0].clip.n_frames
    assert method.config.at("paper") == method.config


def test_the_variant_has_both_cross_entropies(takes: list[Take]) -> None:
    state = training(takes, **StyleErdContent.variant)
    found = state.step(0)
    assert {"content_class", "style_class"} <= set(found)
    assert not any(weight.requires_grad for weight in state.supervision.of_content.parameters())  # type: ignore[union-attr]
