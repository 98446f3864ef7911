"""Motion Puzzle's graphs, network and losses against the published count and small re-derivations."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pytest
import torch
from torch import Tensor

from bench.methods.layers import JointPool, n_parameters
from bench.methods.motion_puzzle import graphs
from bench.methods.motion_puzzle.losses import drawn_parts, losses_of, mixed_styles, root_loss, smoothness, weights_of
from bench.methods.motion_puzzle.network import (
    BpStyleNet,
    PartAdaIN,
    PartAttention,
    PuzzleNetwork,
    Shape,
    StConv,
    StyleFeatures,
    whole_body,
)
from bench.motion.skeleton import CANONICAL_PARENTS, PARTS

TINY = Shape(channels=4, style_channels=8)


@pytest.fixture(autouse=True)
def seeded() -> Iterator[None]:
    with torch.random.fork_rng():
        torch.default_generator.manual_seed(0)
        yield


@pytest.fixture
def network() -> PuzzleNetwork:
    return PuzzleNetwork(TINY).requires_grad_(False)


def motion(n_frames: int = 16, channels: int = 15, seed: int = 1, n: int = 2) -> Tensor:
    return torch.randn(n, channels, n_frames, 21, generator=torch.Generator().manual_seed(seed))


@pytest.mark.parametrize(
    ("shape", "count"),
    [
        (Shape(in_channels=12), 39_501_073),
        (Shape(), 39_501_652),
        (Shape(attention=False), 22_096_212),
        (Shape(attention=False, by_part=False), 18_798_932),
        (Shape(real_time=True), 15_529_662),
    ],
    ids=["released", "paper", "without attention", "whole body", "real-time"],
)
def test_parameter_counts(shape: Shape, count: int) -> None:
    assert n_parameters(PuzzleNetwork(shape)) == count


def test_parts_are_those_of_the_skeleton() -> None:
    for name, joints in zip(graphs.PART_NAMES, graphs.JOINT_PARTS, strict=True):
        assert joints == tuple(PARTS[name])


def test_partition_has_one_subset_for_each_distance() -> None:
    joint, mid, part = graphs.levels(faithful_to_code=False)
    assert [len(level.partition) for level in (joint, mid, part)] == [3, 2, 2]
    # the hips: themselves, three neighbours, and one joint behind each of the legs and two behind the spine
    assert np.count_nonzero(joint.partition[1, :, 0]) == CANONICAL_PARENTS.count(0)
    np.testing.assert_allclose(joint.partition.sum(axis=1)[:2], 1.0)
    faithful = graphs.levels(faithful_to_code=True)[0].partition
    np.testing.assert_allclose(faithful.sum(axis=(0, 1)), 1.0)


@pytest.mark.parametrize("faithful", [False, True])
def test_pooling_keeps_parts_apart_in_the_paper_and_shares_joints_in_the_code(faithful: bool) -> None:
    to_mid, to_part = graphs.pooling_groups(faithful_to_code=faithful)
    leaks = {
        (level, joint)
        for level, (groups, parts) in enumerate([(to_mid, graphs.MID_PARTS), (to_part, graphs.PART_PARTS)])
        for node, group in enumerate(groups)
        for joint in group
        if joint not in _part_of(level, node, parts)
    }
    # the root and the upper spine feed legs and arms, then the lower spine feeds them
    assert leaks == ({(0, 0), (0, 10), (1, 4)} if faithful else set())
    assert all(len({*group}) == len(group) for group in (*to_mid, *to_part))


def _part_of(level: int, node: int, parts: tuple[tuple[int, ...], ...]) -> tuple[int, ...]:
    place = next(place for place, nodes in enumerate(parts) if node in nodes)
    return (graphs.JOINT_PARTS, graphs.MID_PARTS)[level][place]


def test_pooling_averages_and_unpooling_gives_back() -> None:
    pool = JointPool(graphs.JOINT_TO_MID)
    values = torch.arange(21.0)
    pooled = pool.pool(values)
    assert pooled[5] == pytest.approx((10 + 11 + 12) / 3)
    unpooled = pool.unpool(pooled)
    for node, group in enumerate(graphs.JOINT_TO_MID):
        assert all(unpooled[joint] == pytest.approx(float(pooled[node])) for joint in group)


def test_stconv_sums_over_subsets_then_over_time() -> None:
    joint = graphs.levels(faithful_to_code=False)[1]
    layer = StConv(2, 3, 2, 3).requires_grad_(False)
    x = torch.randn(1, 2, 5, 10)
    adjacency = torch.as_tensor(joint.partition, dtype=torch.float32)
    weight, bias = layer.spatial.weight[:, :, 0, 0].view(2, 3, 2), layer.spatial.bias
    active = torch.where(x > 0, x, 0.2 * x)[0]
    assert bias is not None
    gathered = torch.zeros(3, 5, 10)
    for subset in range(2):
        for target in range(10):
            for source in range(10):
                mapped = weight[subset] @ active[:, :, source] + bias.view(2, 3)[subset][:, None]
                gathered[:, :, target] += adjacency[subset, source, target] * mapped
    padded = torch.cat([gathered[:, 1:2], gathered, gathered[:, 3:4]], dim=1)
    temporal, shift = layer.temporal.weight[..., 0], layer.temporal.bias
    assert shift is not None
    expected = torch.stack(
        [torch.einsum("oik,ikv->ov", temporal, padded[:, t : t + 3]) + shift[:, None] for t in range(5)], dim=1
    )
    torch.testing.assert_close(layer(x, adjacency)[0], expected)


def test_part_adain_gives_the_scale_and_shift_of_the_style() -> None:
    layer = PartAdaIN(3, 4).requires_grad_(False)
    x, style = torch.randn(1, 3, 6, 2), torch.randn(1, 3, 9, 2)
    mean = style.mean(dim=(2, 3))[0]
    code = torch.nn.functional.leaky_relu(layer.to_style.weight @ mean + layer.to_style.bias, 0.2)
    code = torch.nn.functional.leaky_relu(layer.hidden.weight @ code + layer.hidden.bias, 0.2)
    scale, shift = (layer.to_scale_and_shift.weight @ code + layer.to_scale_and_shift.bias).chunk(2)
    expected = torch.empty_like(x)
    for channel in range(3):
        values = x[0, channel]
        normed = (values - values.mean()) / torch.sqrt(values.var(correction=0) + 1e-5)
        expected[0, channel] = (1.0 + scale[channel]) * normed + shift[channel]
    torch.testing.assert_close(layer(x, [(style, 1.0)]), expected)
    both = layer(x, [(style, 0.5), (style, 0.5)])
    torch.testing.assert_close(both, expected)


def test_part_attention_is_a_softmax_over_the_places_of_the_style() -> None:
    layer = PartAttention(3).requires_grad_(False)
    x, style = torch.randn(1, 3, 2, 2), torch.randn(1, 3, 4, 2)
    attention = layer.attention_map(x, style)[0]
    assert attention.shape == (4, 8)

    def mapped(convolution: torch.nn.Conv2d, values: Tensor) -> Tensor:
        assert convolution.bias is not None
        return convolution.weight[:, :, 0, 0] @ values.flatten(1) + convolution.bias[:, None]

    def normed(values: Tensor) -> Tensor:
        mean, variance = values.mean(dim=(1, 2), keepdim=True), values.var(dim=(1, 2), keepdim=True, correction=0)
        return (values - mean) / torch.sqrt(variance + 1e-5)

    queries, keys = mapped(layer.queries, normed(x[0])), mapped(layer.keys, normed(style[0]))
    values = mapped(layer.values, style[0])
    attended = torch.zeros(3, 4)
    for place in range(4):
        scores = [math.exp(float(queries[:, place] @ keys[:, other])) for other in range(8)]
        for other in range(8):
            assert attention[place, other] == pytest.approx(scores[other] / sum(scores), rel=1e-4)
            attended[:, place] += scores[other] / sum(scores) * values[:, other]
    expected = x[0] + mapped(layer.output, attended[..., None]).view(3, 2, 2)
    torch.testing.assert_close(layer(x, [(style, 1.0)])[0], expected)


def test_styles_of_different_lengths_can_be_combined(network: PuzzleNetwork) -> None:
    content = network.content(motion())
    styles = [network.style(motion(n_frames, seed=n_frames)) for n_frames in (12, 16, 20, 24, 28)]
    answer = network.decode(content, [[(style, 1.0)] for style in styles])
    assert answer.shape == (2, 15, 16, 21)
    assert torch.isfinite(answer).all()


def test_decoding_together_is_decoding_one_by_one(network: PuzzleNetwork) -> None:
    source, target = motion(), motion(seed=2)
    style, other = network.style(source), network.style(target)
    pairs = [
        (network.content(source), mixed_styles(style, other, (1, 3))),
        (network.content(target), whole_body(other)),
        (network.content(source), whole_body(style)),
    ]
    for together, (content, styles) in zip(network.decode_together(pairs), pairs, strict=True):
        torch.testing.assert_close(together, network.decode(content, styles), rtol=1e-4, atol=1e-4)


def changed(network: PuzzleNetwork, part: int) -> Tensor:
    """How much each joint moves before any graph convolution, where the style of one part changes: BP-AdaIN alone."""
    net = next(module for module in network.modules() if isinstance(module, BpStyleNet))
    x = torch.randn(1, net.adain[0].to_style.in_features, 4, 5)  # type: ignore[union-attr,arg-type]
    one, other = torch.randn_like(x), torch.randn_like(x)

    def injected(mixed: list[Tensor]) -> Tensor:
        styles = [[((style, style, style, style), 1.0)] for style in mixed]
        return net._by_part(net.adain, x, styles, 0)

    base = injected([one] * 5)
    return (injected([other if place == part else one for place in range(5)]) - base).abs().amax(dim=(0, 1, 2))


@pytest.mark.parametrize("part", range(5))
def test_a_style_is_injected_into_its_own_part_only(network: PuzzleNetwork, part: int) -> None:
    moved = changed(network, part)
    assert moved[part] > 1e-5
    assert (moved[[place for place in range(5) if place != part]] == 0).all()


def leaks(shape: Shape) -> set[int]:
    """Parts whose style features (pooled, before any graph convolution) change when the root alone does."""
    pools = PuzzleNetwork(shape).style_encoder.graphs
    values = torch.zeros(21)
    values[0] = 1.0
    return set(torch.nonzero(pools.to_part.pool(pools.to_mid.pool(values)))[:, 0].tolist())


def test_features_stay_in_their_part_in_the_paper_and_leak_in_the_released_pooling() -> None:
    assert leaks(TINY) == {2}
    assert leaks(Shape(channels=4, style_channels=8, faithful_to_code=True)) == {0, 1, 2, 3, 4}


@pytest.mark.parametrize("faithful", [False, True])
def test_losses_are_zero_where_nothing_is_wrong(faithful: bool) -> None:
    class Perfect(PuzzleNetwork):
        def decode(self, content: Tensor, styles: object) -> Tensor:
            return source.repeat(len(content) // len(source), 1, 1, 1)

    source = motion()
    found = losses_of(Perfect(TINY), source, source, (), faithful_to_code=faithful)
    assert set(found) == ({"rec", "cyc", "sm"} if faithful else {"rec", "cyc", "sm", "root"})
    assert all(float(loss) == 0.0 for loss in found.values())


def test_losses_of_an_untrained_network_are_positive(network: PuzzleNetwork) -> None:
    found = losses_of(network, motion(), motion(seed=2), (0, 3), faithful_to_code=False)
    assert all(float(loss) > 0.01 for loss in found.values())
    assert set(weights_of(faithful_to_code=True)) >= set(found)


def test_losses_by_hand_and_monotone() -> None:
    source = torch.zeros(1, 15, 3, 21)
    output = torch.zeros(1, 15, 3, 21)
    output[:, 12:] = 2.0
    assert float(root_loss(output, source)) == 2.0
    assert float(smoothness(output, source)) == 0.0
    output[:, :, 1] += 3.0
    assert float(smoothness(output, source)) == pytest.approx(3.0)
    values = [float(root_loss(source + fault, source)) for fault in (0.1, 0.2, 0.4)]
    assert values == sorted(values)


def test_mixing_takes_chosen_parts_from_the_source() -> None:
    one, other = ((torch.tensor(float(place)),) * 4 for place in range(2))
    mixed = mixed_styles(one, other, (1, 4))
    assert [float(part[0][0][0]) for part in mixed] == [1.0, 0.0, 1.0, 1.0, 0.0]


@pytest.mark.parametrize("faithful", [False, True])
def test_draws_of_parts(faithful: bool) -> None:
    generator = torch.Generator().manual_seed(0)
    draws = [drawn_parts(0.5, generator, faithful_to_code=faithful) for _ in range(400)]
    assert 150 < sum(not draw for draw in draws) < 250
    assert {len(draw) for draw in draws} == {0, 1, 2, 3, 4, 5}
    if faithful:
        assert all((0 in draw) == (1 in draw) and (3 in draw) == (4 in draw) for draw in draws)
    assert drawn_parts(0.0, generator, faithful_to_code=faithful) == ()


def test_whole_body_is_one_style_for_all_parts() -> None:
    style: StyleFeatures = (torch.zeros(1),) * 4
    assert [part[0][1] for part in whole_body(style)] == [1.0] * 5
