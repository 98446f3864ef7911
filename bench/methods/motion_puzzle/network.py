"""Encoders and decoder of Motion Puzzle (Jang et al. 2022, section 4 and Table 3). Tensors are ``[B, C, T, V]``.

A *part style* is a mixture ``[(style features, weight), ...]`` whose weights sum to 1: AdaIN blends scales and shifts,
attention blends what it found. The paper's five part-features (eq. 5) are five mixtures of one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.layers import JointPool, double_time, halve_time, instance_norm
from bench.methods.motion_puzzle.graphs import Level, levels, pooling_groups

RESIDUAL_KERNEL = 3
RESIDUAL_SCALE = 0.1
"""Of the branch of residual blocks; in the released code only."""
SLOPE = 0.2

StyleFeatures: TypeAlias = tuple[Tensor, Tensor, Tensor, Tensor]
"""Of one target motion: ``[B, 2w, T, 21]``, ``[B, 4w, T/2, 10]``, ``[B, 8w, T/4, 5]``, and after the residual block."""
PartStyle: TypeAlias = Sequence[tuple[StyleFeatures, float]]
PartStyles: TypeAlias = Sequence[PartStyle]
"""For left leg, right leg, spine, left arm, right arm."""


@dataclass(frozen=True)
class Shape:
    """Sizes of the network; the defaults are the paper's, with 15 channels a joint.

    Attributes
    ----------
    in_channels : a joint's numbers: 15 in the paper, 12 in the released code.
    channels : after the first layer; 2, 4 and 8 times as many on the three graphs.
    style_channels : of the vector from which AdaIN's scale and shift are made.
    attention : with BP-ATN.
    by_part : style injected part by part; False is the ablation STGCN+AdaIN with one AdaIN for the whole body.
    real_time : without residual blocks, BP-StyleNets on the 5- and 10-node graphs only (appendix A.1).
    faithful_to_code : pooling, normalisation of neighbours and scale of residuals of the released code.
    """

    in_channels: int = 15
    channels: int = 64
    style_channels: int = 128
    attention: bool = True
    by_part: bool = True
    real_time: bool = False
    faithful_to_code: bool = False


class StConv(nn.Module):
    """STConv: activation, graph convolution over distance subsets (eq. 1), convolution over time.

    ``adjacency`` comes with each call because all layers on one graph share their learned edge importance.
    """

    def __init__(self, in_channels: int, out_channels: int, subsets: int, kernel: int, *, active: bool = True) -> None:
        super().__init__()
        self.active = active
        self.subsets = subsets
        self.spatial = nn.Conv2d(in_channels, out_channels * subsets, 1)
        self.temporal = nn.Conv2d(
            out_channels, out_channels, (kernel, 1), padding=(kernel // 2, 0), padding_mode="reflect"
        )

    def forward(self, x: Tensor, adjacency: Tensor) -> Tensor:
        mixed = self.spatial(functional.leaky_relu(x, SLOPE) if self.active else x)
        batch, _, n_frames, n_nodes = mixed.shape
        by_subset = mixed.view(batch, self.subsets, -1, n_frames, n_nodes)
        result: Tensor = self.temporal(torch.einsum("bkctv,kvw->bctw", by_subset, adjacency))
        return result


class Graphs(nn.Module):
    """Adjacency of the three graphs scaled by learned edge importance, and the way from one graph to the next."""

    joint: Tensor
    mid: Tensor
    part: Tensor

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        joint, mid, part = levels(faithful_to_code=shape.faithful_to_code)
        importance = {"joint": joint, "mid": mid, "part": part}
        if not shape.real_time:
            importance["residual"] = part
        self.importance = nn.ParameterDict()
        for name, level in importance.items():
            self.register_buffer(name, torch.as_tensor(level.partition, dtype=torch.float32), persistent=False)
            self.importance[name] = nn.Parameter(torch.ones(level.partition.shape))
        to_mid, to_part = pooling_groups(faithful_to_code=shape.faithful_to_code)
        self.to_mid, self.to_part = JointPool(to_mid), JointPool(to_part)

    def adjacency(self, name: str) -> Tensor:
        """``[K, V, V]`` of one graph."""
        partition: Tensor = getattr(self, name)
        weighted: Tensor = partition * self.importance[name]
        return weighted


class Encoder(nn.Module):
    """Three STConvs with pooling between and a residual block; instance norms for content, none for style."""

    def __init__(self, shape: Shape, *, normalised: bool) -> None:
        super().__init__()
        width = shape.channels
        joint, mid, part = levels(faithful_to_code=shape.faithful_to_code)
        self.normalised = normalised
        self.residual_scale = RESIDUAL_SCALE if shape.faithful_to_code else 1.0
        self.graphs = Graphs(shape)
        self.from_motion = nn.Conv2d(shape.in_channels, width, 1)
        self.joint = StConv(width, 2 * width, len(joint.partition), joint.kernel)
        self.mid = StConv(2 * width, 4 * width, len(mid.partition), mid.kernel)
        self.part = StConv(4 * width, 8 * width, len(part.partition), part.kernel)
        subsets = len(part.partition)
        self.residual = nn.ModuleList(
            []
            if shape.real_time
            else [
                StConv(8 * width, 8 * width, subsets, RESIDUAL_KERNEL),
                StConv(8 * width, 8 * width, subsets, RESIDUAL_KERNEL, active=False),
            ]
        )

    def forward(self, motion: Tensor) -> StyleFeatures:
        """``[B, channels, T, 21]`` with T a multiple of 4, at least 12, to the features of all levels."""
        graphs = self.graphs
        joint = self.joint(self._normed(self.from_motion(motion)), graphs.adjacency("joint"))
        mid = self.mid(self._normed(halve_time(graphs.to_mid.pool(joint))), graphs.adjacency("mid"))
        part = self.part(self._normed(halve_time(graphs.to_part.pool(mid))), graphs.adjacency("part"))
        branch = part
        for layer in self.residual:
            branch = layer(self._normed(branch), graphs.adjacency("residual"))
        last = part + self.residual_scale * branch if len(self.residual) else part
        return joint, mid, part, last

    def _normed(self, x: Tensor) -> Tensor:
        return instance_norm(x) if self.normalised else x


class PartAdaIN(nn.Module):
    """AdaIN of one part (eq. 9): scale and shift from the mean of the part's style feature over time and nodes."""

    def __init__(self, channels: int, style_channels: int) -> None:
        super().__init__()
        self.to_style = nn.Linear(channels, style_channels)
        self.hidden = nn.Linear(style_channels, style_channels)
        self.to_scale_and_shift = nn.Linear(style_channels, 2 * channels)

    def forward(self, x: Tensor, styles: Sequence[tuple[Tensor, float]]) -> Tensor:
        """``[B, C, T, V]`` and a mixture of ``[B, C, T', V]``."""
        mixed = torch.stack([weight * self._statistics(style) for style, weight in styles]).sum(dim=0)
        scale, shift = mixed[:, :, None, None].chunk(2, dim=1)
        return (1.0 + scale) * instance_norm(x) + shift

    def _statistics(self, style: Tensor) -> Tensor:
        code = functional.leaky_relu(self.to_style(style.mean(dim=(2, 3))), SLOPE)
        found: Tensor = self.to_scale_and_shift(functional.leaky_relu(self.hidden(code), SLOPE))
        return found


class PartAttention(nn.Module):
    """Attention of one part (eq. 11-13): every frame and node of the content looks for its like in the style."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.queries = nn.Conv2d(channels, channels, 1)
        self.keys = nn.Conv2d(channels, channels, 1)
        self.values = nn.Conv2d(channels, channels, 1)
        self.output = nn.Conv2d(channels, channels, 1)

    def forward(self, x: Tensor, styles: Sequence[tuple[Tensor, float]]) -> Tensor:
        """``[B, C, T, V]`` and a mixture of ``[B, C, T', V]``."""
        attended = torch.stack(
            [
                weight * (self.values(style).flatten(2) @ self.attention_map(x, style).transpose(1, 2))
                for style, weight in styles
            ]
        ).sum(dim=0)  # [B, C, T V]
        result: Tensor = x + self.output(attended.view_as(x))
        return result

    def attention_map(self, x: Tensor, style: Tensor) -> Tensor:
        """``[B, T V, T' V]``, each row sums to 1 over the style's places (eq. 12)."""
        queries = self.queries(instance_norm(x)).flatten(2)
        keys = self.keys(instance_norm(style)).flatten(2)
        attention: Tensor = (queries.transpose(1, 2) @ keys).softmax(dim=-1)
        return attention


class BpStyleNet(nn.Module):
    """BP-StyleNet on one graph (section 4.4, Table 3 d): BP-AdaIN, STConv, BP-ATN, STConv."""

    nodes: Tensor

    def __init__(
        self, shape: Shape, level: Level, in_channels: int, out_channels: int, kernel: int, *, active: bool
    ) -> None:
        super().__init__()
        subsets = len(level.partition)
        parts = level.parts if shape.by_part else (tuple(range(level.partition.shape[1])),)
        self.sizes = [len(part) for part in parts]
        self.register_buffer("nodes", torch.tensor([node for part in parts for node in part]), persistent=False)
        self.adain = nn.ModuleList([PartAdaIN(in_channels, shape.style_channels) for _ in parts])
        self.first = StConv(in_channels, in_channels, subsets, kernel, active=active)
        self.attention = nn.ModuleList([PartAttention(in_channels) for _ in parts if shape.attention])
        self.second = StConv(in_channels, out_channels, subsets, kernel, active=False)

    def forward(self, x: Tensor, styles: PartStyles, level: int, adjacency: Tensor) -> Tensor:
        """``level`` says which of the style features belong to this graph."""
        x = self.first(self._by_part(self.adain, x, styles, level), adjacency)
        if len(self.attention):
            x = self._by_part(self.attention, x, styles, level)
        result: Tensor = self.second(x, adjacency)
        return result

    def _by_part(self, modules: nn.ModuleList, x: Tensor, styles: PartStyles, level: int) -> Tensor:
        """Eq. 8 and 11: each part of ``x`` with the same part of its own style."""
        found = []
        for nodes, module, style in zip(torch.split(self.nodes, self.sizes), modules, styles, strict=False):
            own = [(features[level].index_select(3, nodes), weight) for features, weight in style]
            found.append(module(x.index_select(3, nodes), own))
        return torch.cat(found, dim=3).index_select(3, self.nodes.argsort())


class Decoder(nn.Module):
    """Residual block and three BP-StyleNets with unpooling between them (section 4.4, Table 3 c)."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        width = shape.channels
        joint, mid, part = levels(faithful_to_code=shape.faithful_to_code)
        self.residual_scale = RESIDUAL_SCALE if shape.faithful_to_code else 1.0
        self.graphs = Graphs(shape)
        wide = 8 * width
        self.residual = nn.ModuleList(
            []
            if shape.real_time
            else [
                BpStyleNet(shape, part, wide, wide, RESIDUAL_KERNEL, active=True),
                BpStyleNet(shape, part, wide, wide, RESIDUAL_KERNEL, active=False),
            ]
        )
        self.part = BpStyleNet(shape, part, 8 * width, 4 * width, part.kernel, active=True)
        self.mid = BpStyleNet(shape, mid, 4 * width, 2 * width, mid.kernel, active=True)
        self.joint: nn.Module
        if shape.real_time:
            self.joint = StConv(2 * width, width, len(joint.partition), joint.kernel)
        else:
            self.joint = BpStyleNet(shape, joint, 2 * width, width, joint.kernel, active=True)
        self.to_motion = nn.Conv2d(width, shape.in_channels, 1)

    def forward(self, content: Tensor, styles: PartStyles) -> Tensor:
        """Content feature ``[B, 8w, T/4, 5]`` to motion ``[B, channels, T, 21]`` (eq. 7)."""
        graphs = self.graphs
        x = branch = content
        for layer in self.residual:
            branch = layer(branch, styles, 3, graphs.adjacency("residual"))
        if len(self.residual):
            x = content + self.residual_scale * branch
        x = self.part(x, styles, 2, graphs.adjacency("part"))
        x = double_time(graphs.to_part.unpool(x))
        x = self.mid(x, styles, 1, graphs.adjacency("mid"))
        x = double_time(graphs.to_mid.unpool(x))
        adjacency = graphs.adjacency("joint")
        x = self.joint(x, adjacency) if isinstance(self.joint, StConv) else self.joint(x, styles, 0, adjacency)
        motion: Tensor = self.to_motion(functional.leaky_relu(x, SLOPE))
        return motion


class PuzzleNetwork(nn.Module):
    """Content encoder, style encoder, decoder."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.content_encoder = Encoder(shape, normalised=True)
        self.style_encoder = Encoder(shape, normalised=False)
        self.decoder = Decoder(shape)
        self.apply(_start_of_linear_layers)

    def content(self, motion: Tensor) -> Tensor:
        """E_c (eq. 6)."""
        last: Tensor = self.content_encoder(motion)[3]
        return last

    def style(self, motion: Tensor) -> StyleFeatures:
        """E_s (eq. 3)."""
        features: StyleFeatures = self.style_encoder(motion)
        return features

    def decode(self, content: Tensor, styles: PartStyles) -> Tensor:
        """D (eq. 7)."""
        motion: Tensor = self.decoder(content, styles)
        return motion

    def decode_together(self, pairs: Sequence[tuple[Tensor, PartStyles]]) -> tuple[Tensor, ...]:
        """Several batches of content features, each part of each in one style, decoded as one batch."""
        contents, styles = zip(*pairs, strict=True)
        joined: PartStyles = [
            [(_joined([mixture[0][0] for mixture in part]), 1.0)] for part in zip(*styles, strict=True)
        ]
        motions = torch.split(self.decode(torch.cat(contents), joined), [len(content) for content in contents])
        return tuple(motions)


def _joined(styles: Sequence[StyleFeatures]) -> StyleFeatures:
    joint, mid, part, last = (torch.cat(features) for features in zip(*styles, strict=True))
    return joint, mid, part, last


def whole_body(style: StyleFeatures) -> PartStyles:
    """One target motion for all five parts."""
    return [[(style, 1.0)]] * 5


def he_start(module: nn.Module) -> None:
    """Convolutions as in the released code: He's normal deviations, biases zero."""
    if isinstance(module, nn.Conv2d):
        nn.init.kaiming_normal_(module.weight)
        if module.bias is not None:
            nn.init.zeros_(module.bias)


def _start_of_linear_layers(module: nn.Module) -> None:
    if isinstance(module, nn.Linear):
        nn.init.normal_(module.weight, std=0.02)
        nn.init.zeros_(module.bias)
