"""The networks of Style-ERD: sizes as published and as released, states, branches, discriminator, frames."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from torch import Tensor

from bench.methods.layers import n_parameters
from bench.methods.style_erd.frames import N_POSITIONS, N_ROTATIONS, UNIT_M, FrameReader
from bench.methods.style_erd.network import ContentClassifier, Discriminator, Shape, StyleErd
from bench.motion.kinematics import FOOT_JOINTS, facing_yaw, world_positions, yaw_aligned
from tests.motion.factory import person, random_clip

PAPER = Shape(4 * 31, 3 * 20, 7, 5)
RELEASED = Shape(4 * 31, 3 * 20, 7, 5, neutral_layers=4, style_layers=6, decoder_labels=False)
TINY = Shape(N_ROTATIONS, N_POSITIONS, 2, 3, hidden=8, neutral_layers=2, style_layers=2)


def noise(*shape: int, seed: int = 0) -> Tensor:
    return torch.randn(*shape, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(("shape", "total", "per_style"), [(PAPER, 377_604, 34_048), (RELEASED, 479_236, 51_072)])
def test_sizes_at_the_papers_joints_and_labels(shape: Shape, total: int, per_style: int) -> None:
    generator = StyleErd(shape)
    assert n_parameters(generator) == total
    assert {n_parameters(branch) for branch in generator.styles} == {per_style}


def test_inner_widths_are_the_papers() -> None:
    generator = StyleErd(PAPER)
    linear = [layer.out_features for layer in generator.encoder if isinstance(layer, torch.nn.Linear)]
    assert linear == [130, 64, 32]
    decoder = [layer.out_features for layer in generator.decoder if isinstance(layer, torch.nn.Linear)]
    assert [*decoder, generator.rotation_layer.out_features + generator.velocity_layer.out_features] == [
        58, 86, 128, 184,
    ]  # fmt: skip
    convolutions = [layer for layer in Discriminator(PAPER, 24).features if isinstance(layer, torch.nn.Conv1d)]
    assert [layer.out_channels for layer in convolutions] == [80, 52, 34, 22, 16]
    classifier = ContentClassifier(PAPER)
    assert [block[0].out_channels for block in classifier.layers] == [122, 60, 30, 14]  # type: ignore[index]


def test_without_learned_states_a_branch_is_its_lstm() -> None:
    shape = Shape(4 * 31, 3 * 20, 7, 5, learned_states=False)
    generator = StyleErd(shape)
    assert n_parameters(generator) == 377_604 - 2 * 6 * 5 * 32 - 7 * 2 * 4 * 32
    assert all(not hidden.any() and not cell.any() for hidden, cell in generator.initial(torch.eye(5)))


def test_a_carrying_start_brings_a_frame_through_six_layers() -> None:
    """With PyTorch's start next to nothing arrives behind the sixth, and hardly a gradient comes back."""
    passed, gradient = {}, {}
    for carries in (False, True):
        torch.manual_seed(0)
        branch = StyleErd(Shape(4 * 31, 3 * 20, 7, 5, carrying_start=carries)).neutral
        frames = (0.3 * noise(64, 24, 32)).requires_grad_()
        out, _ = branch(frames, branch.initial(torch.eye(5)[[0] * 64]))
        passed[carries] = float(out.detach()[:, 12:].std(dim=(0, 1)).mean() / 0.3)
        [back] = torch.autograd.grad(out[:, -1].sum(), frames)
        gradient[carries] = float(back[:, -1].std())
    assert passed[False] < 1e-3 and passed[True] > 0.1
    assert gradient[False] < 1e-4 and gradient[True] > 0.01


def test_initial_states_are_those_of_the_content() -> None:
    generator = StyleErd(TINY)
    with torch.no_grad():
        generator.neutral.states.copy_(noise(2, 2, 3, 8))
    hidden, cell = generator.initial(torch.eye(3)[[2, 0]])[0]
    torch.testing.assert_close(hidden, generator.neutral.states[0][:, [2, 0]])
    torch.testing.assert_close(cell, generator.neutral.states[1][:, [2, 0]])


def test_neutral_is_the_neutral_branch_alone_and_intensity_scales_the_residual() -> None:
    generator, code = StyleErd(TINY), noise(1, 6, 8)
    states = generator.initial(torch.eye(3)[:1])

    def code_of(*weights: float) -> Tensor:
        return generator.recur(code, torch.tensor([weights]), states)[0].detach()

    neutral = generator.neutral(code, states[0])[0].detach()
    torch.testing.assert_close(code_of(0.0, 0.0), neutral)
    first, second = code_of(1.0, 0.0) - neutral, code_of(0.0, 1.0) - neutral
    assert first.abs().max() > 0.0
    torch.testing.assert_close(code_of(0.5, 0.0), neutral + 0.5 * first)
    torch.testing.assert_close(code_of(0.3, 0.7), neutral + 0.3 * first + 0.7 * second)


def test_a_batch_of_styles_is_each_of_them_alone() -> None:
    generator, code = StyleErd(TINY), noise(3, 6, 8)
    contents, target = torch.eye(3), torch.tensor([[1.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    together, after = generator.recur(code, target, generator.initial(contents))
    for row in range(3):
        one = slice(row, row + 1)
        alone, states = generator.recur(code[one], target[one], generator.initial(contents[one]))
        torch.testing.assert_close(together[one], alone)
        for (hidden, cell), (own_hidden, own_cell) in zip(after, states, strict=True):
            torch.testing.assert_close(hidden[:, one], own_hidden)
            torch.testing.assert_close(cell[:, one], own_cell)


def test_frame_by_frame_is_the_sequence() -> None:
    generator, code, target = StyleErd(TINY), noise(1, 9, 8), torch.tensor([[1.0, 0.0]])
    states = generator.initial(torch.eye(3)[:1])
    whole, _ = generator.recur(code, target, states)
    for t in range(9):
        one, states = generator.recur(code[:, t : t + 1], target, states)
        torch.testing.assert_close(one, whole[:, t : t + 1])


def test_the_released_decoder_does_not_see_the_style() -> None:
    code = noise(1, 4, 32)
    one, other = torch.eye(7)[:1], torch.eye(7)[1:2]
    for shape, same in ((PAPER, False), (RELEASED, True)):
        generator = StyleErd(shape)
        assert torch.equal(generator.decode(code, one)[0], generator.decode(code, other)[0]) is same


def test_attention_is_an_outer_product_over_the_features() -> None:
    """Equation 1 written out."""
    network, motion = Discriminator(TINY, 24), noise(2, 24, 2 * N_POSITIONS)
    style, content = torch.eye(2), torch.eye(3)[:2]
    labels = network.labels(torch.cat([style, content], dim=1))
    features = network.features(motion.transpose(1, 2))
    by_hand = torch.einsum("bct,bc,bt->b", features, network.over_features(labels), network.over_time(labels))
    torch.testing.assert_close(network(motion, style, content), by_hand)


def test_without_attention_each_style_has_a_score_and_the_content_none() -> None:
    network, motion = Discriminator(TINY, 24, attention=False), noise(1, 24, 2 * N_POSITIONS)
    styles = torch.tensor([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    classes = network.scores(network.features(motion.transpose(1, 2)).mean(dim=2))[0]
    for row, style in enumerate(styles):
        for content in torch.eye(3):
            torch.testing.assert_close(network(motion, style[None], content[None])[0], classes[row])


def test_the_classifier_does_not_see_the_mean_of_a_channel_after_its_first_norm() -> None:
    classifier, motion = ContentClassifier(TINY), noise(1, 24, TINY.n_motion)
    scores, maps = classifier(motion)
    shifted, _ = classifier(motion + 3.0)
    assert scores.shape == (1, 3) and len(maps) == 4
    torch.testing.assert_close(scores, shifted, atol=1e-3, rtol=1e-3)


def reader() -> FrameReader:
    found = FrameReader()
    found.offsets.copy_(torch.tensor(np.array(person().offsets_m)) / UNIT_M)
    return found


def as_batch(array: object) -> Tensor:
    return torch.from_numpy(np.array(array, dtype=np.float32)[None])


def test_frames_by_hand() -> None:
    clip = random_clip(30, amount_rad=0.5)
    read = reader()(as_batch(clip.rotations_wxyz), as_batch(clip.root_xyz_m))
    world = world_positions(clip)
    yaw = facing_yaw(world)
    angle = 2.0 * torch.atan2(read.heading[0, :, 2], read.heading[0, :, 0]).double().numpy()
    np.testing.assert_allclose(np.cos(angle - yaw), 1.0, atol=1e-6)
    places = read.motion[0, :, N_ROTATIONS : N_ROTATIONS + N_POSITIONS].reshape(30, 20, 3).double().numpy() * UNIT_M
    np.testing.assert_allclose(
        np.linalg.norm(places, axis=-1), np.linalg.norm(world[:, 1:] - world[:, :1], axis=-1), atol=1e-5
    )
    velocities = read.motion[0, :, N_ROTATIONS + N_POSITIONS :].reshape(30, 20, 3).double().numpy() * UNIT_M
    np.testing.assert_allclose(velocities[1:], np.diff(places, axis=0), atol=1e-5)
    np.testing.assert_array_equal(velocities[0], 0.0)
    moved = np.linalg.norm(np.diff(world[:, FOOT_JOINTS], axis=0), axis=-1) / UNIT_M
    np.testing.assert_array_equal(read.contacts[0, 1:].numpy() > 0.5, moved**2 < 0.05)


def test_frames_do_not_depend_on_where_and_in_which_direction_one_moves() -> None:
    clip = random_clip(20)
    read = reader()(as_batch(clip.rotations_wxyz), as_batch(clip.root_xyz_m))
    turned = random_clip(20)
    unit, root = yaw_aligned(turned.rotations_wxyz, turned.root_xyz_m, np.full(20, 1.1))
    again = reader()(as_batch(unit), as_batch(root + np.array([3.0, 0.0, -2.0])))
    torch.testing.assert_close(read.motion, again.motion, atol=1e-3, rtol=1e-3)


def test_frames_in_pieces_are_the_frames_at_once() -> None:
    clip = random_clip(20)
    unit, root = as_batch(clip.rotations_wxyz), as_batch(clip.root_xyz_m)
    whole, before = reader()(unit, root), None
    for t in range(20):
        piece = reader()(unit[:, t : t + 1], root[:, t : t + 1], before)
        before = piece.last
        torch.testing.assert_close(piece.motion, whole.motion[:, t : t + 1])
        torch.testing.assert_close(piece.contacts, whole.contacts[:, t : t + 1])
