"""Park 2021's graphs and networks against the published counts and small re-derivations."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from bench.methods.layers import n_parameters
from bench.methods.park2021.network import (
    PARENTS,
    POOLED,
    Adain,
    Discriminator,
    MappingNetwork,
    NetworkSize,
    Resample,
    SpatialConv,
    SpatialTemporalConv,
    StyleEncoder,
    Stylizer,
    initialise,
)
from bench.motion.skeleton import PARTS
from classifiers.graph import hop_distances, spatial_partition

TINY = NetworkSize(n_styles=3, width=4, style_dim=6, latent_dim=5, hidden_dim=8, n_frames=16)
PART_OF_NODE = ("left_leg", "left_leg", "right_leg", "right_leg", "spine", "spine",
                "left_arm", "left_arm", "right_arm", "right_arm")  # fmt: skip


@pytest.fixture(autouse=True)
def seeded() -> Iterator[None]:
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(0)
        yield


def motion(n: int = 2, n_frames: int = 16) -> Tensor:
    return torch.randn(n, 7, n_frames, 21)


@pytest.mark.parametrize(
    ("network", "count"),
    [(Stylizer, 961_095), (StyleEncoder, 5_910_016), (MappingNetwork, 860_224), (Discriminator, 5_780_488)],
)
def test_parameter_counts_at_full_width_and_eight_styles(network: type[nn.Module], count: int) -> None:
    assert n_parameters(network(NetworkSize(n_styles=8))) == count


@pytest.mark.parametrize("parents", PARENTS)
def test_subsets_are_self_nearer_and_farther_each_with_weights_that_sum_to_one(parents: tuple[int, ...]) -> None:
    partition = spatial_partition(parents)
    root = parents.index(-1)
    to_root = hop_distances(parents)[root]
    for target in range(len(parents)):
        near = {other for other in range(len(parents)) if parents[other] == target or parents[target] == other} | {
            target
        }
        for subset, members in enumerate(
            (
                {target},
                {joint for joint in near if to_root[joint] < to_root[target]},
                {joint for joint in near if to_root[joint] > to_root[target]},
            )
        ):
            found = partition[subset, :, target]
            assert set(np.flatnonzero(found)) == members
            np.testing.assert_allclose(found[list(members)], 1.0 / max(len(members), 1))


def test_the_released_partition_loses_most_edges_to_the_joint_itself() -> None:
    lost = [int(np.count_nonzero(spatial_partition(p, faithful=True)[0]) - len(p)) for p in PARENTS]
    assert lost == [28, 4, 0]
    assert len(PARENTS[0]) - 1 == 20


def test_pools_stay_within_body_parts() -> None:
    for node, joints in enumerate(POOLED[0]):
        assert set(joints) <= set(PARTS[PART_OF_NODE[node]])
    for nodes in POOLED[1]:
        assert len({PART_OF_NODE[node] for node in nodes}) == 1
    assert sorted(joint for joints in POOLED[0] for joint in joints) == list(range(21))


def test_edges_of_coarse_graphs_are_those_between_their_members() -> None:
    """Nodes are joined where joints of theirs are; the hips' node 4 takes the legs, the chest's node 5 the arms."""
    for level, groups in enumerate(POOLED):
        owner = {joint: node for node, joints in enumerate(groups) for joint in joints}
        fine = {
            frozenset((owner[joint], owner[parent]))
            for joint, parent in enumerate(PARENTS[level])
            if parent >= 0 and owner[joint] != owner[parent]
        }
        coarse = {frozenset((node, parent)) for node, parent in enumerate(PARENTS[level + 1]) if parent >= 0}
        assert fine == coarse


def test_pooling_is_the_mean_of_joints_and_of_frame_pairs() -> None:
    x = torch.randn(1, 2, 4, 21)
    pooled = Resample(0, coarser=True)(x)
    assert pooled.shape == (1, 2, 2, 10)
    for node, joints in enumerate(POOLED[0]):
        expected = torch.stack([x[..., joint] for joint in joints]).mean(dim=0)
        torch.testing.assert_close(pooled[..., node], (expected[:, :, 0::2] + expected[:, :, 1::2]) / 2.0)


def test_unpooling_copies_nodes_and_interpolates_frames() -> None:
    x = torch.randn(1, 1, 2, 5)
    unpooled = Resample(1, coarser=False)(x)
    assert unpooled.shape == (1, 1, 4, 10)
    for node, members in enumerate(POOLED[1]):
        for member in members:
            for frame in range(4):
                share = frame / 3.0
                expected = (1.0 - share) * x[0, 0, 0, node] + share * x[0, 0, 1, node]
                assert float(unpooled[0, 0, frame, member]) == pytest.approx(float(expected), abs=1e-5)


@pytest.mark.parametrize("faithful", [False, True])
def test_spatial_convolution_is_the_sum_over_neighbours(faithful: bool) -> None:
    layer = SpatialConv(2, 3, 1, replace(TINY, faithful_partition=faithful)).requires_grad_(False)
    layer.weight.normal_()
    layer.bias.normal_()
    x = torch.randn(1, 2, 2, 10)
    partition = spatial_partition(PARENTS[1], faithful=faithful)
    expected = torch.zeros(1, 3, 2, 10)
    for target in range(10):
        for source in range(10):
            for subset in range(3):
                mapped = torch.einsum("oi,bit->bot", layer.weight[:, subset], x[..., source])
                mapped = mapped + layer.bias[subset][None, :, None]
                expected[..., target] += float(partition[subset, source, target]) * mapped
    torch.testing.assert_close(layer(x), expected)


def test_spatial_temporal_convolution_sees_neighbours_of_joint_and_frame() -> None:
    layer = SpatialTemporalConv(2, 2, 2, TINY).requires_grad_(False)
    initialise(layer)
    layer.spatial.bias.fill_(20.0)  # no rectifier is at rest
    x = torch.randn(1, 2, 6, 5)
    changed = x.clone()
    changed[0, :, 3, 0] += 5.0
    moved = (layer(changed) - layer(x)).abs().amax(dim=(0, 1))
    # node 0 hangs from node 2; frames 2 to 4 see frame 3
    assert set(zip(*np.nonzero(moved.numpy() > 1e-4), strict=True)) == {(t, v) for t in (2, 3, 4) for v in (0, 2)}


def test_adain_normalises_then_gives_the_deviation_and_mean_of_the_style() -> None:
    layer = Adain(3, 4).requires_grad_(False)
    x, style = 2.0 + 3.0 * torch.randn(2, 3, 5, 6), torch.randn(2, 4)
    found = layer(x, style)
    for sample in range(2):
        numbers = layer.affine.weight @ style[sample] + layer.affine.bias
        for channel in range(3):
            values = x[sample, channel]
            normed = (values - values.mean()) / torch.sqrt(values.var(correction=0) + 1e-5)
            expected = (1.0 + numbers[channel]) * normed + numbers[3 + channel]
            torch.testing.assert_close(found[sample, channel], expected, rtol=1e-4, atol=1e-5)


@pytest.mark.parametrize("n_frames", [4, 16, 20, 200])
def test_the_stylizer_takes_any_multiple_of_four_frames(n_frames: int) -> None:
    stylizer = Stylizer(TINY).requires_grad_(False)
    initialise(stylizer)
    content = stylizer.encode(motion(n_frames=n_frames))
    assert content.shape == (2, 16, n_frames // 4, 5)
    assert stylizer.decode(content, torch.randn(2, 6)).shape == (2, 7, n_frames, 21)


def test_each_domain_has_a_branch_of_its_own() -> None:
    encoder, discriminator = StyleEncoder(TINY).requires_grad_(False), Discriminator(TINY).requires_grad_(False)
    initialise(encoder)
    initialise(discriminator)
    x = motion(n=1).expand(3, -1, -1, -1)
    domains = torch.tensor([0, 1, 2])
    codes, logits = encoder(x, domains), discriminator(x, domains)
    assert codes.shape == (3, 6) and logits.shape == (3,)
    for domain in range(3):
        torch.testing.assert_close(codes[domain : domain + 1], encoder(x[:1], domains[domain : domain + 1]))
    torch.testing.assert_close(logits, discriminator.heads(discriminator.reader(x[:1]))[0])


def test_latent_codes_and_domains_both_decide_the_style() -> None:
    mapping = MappingNetwork(TINY).requires_grad_(False)
    initialise(mapping)
    latent = torch.randn(2, 5)
    same = torch.zeros(2, dtype=torch.int64)
    codes = mapping(latent, same)
    assert codes.shape == (2, 6) and (codes.abs() <= 1.0).all()
    assert not torch.allclose(codes[0], codes[1])
    assert not torch.allclose(codes, mapping(latent, same + 1))
