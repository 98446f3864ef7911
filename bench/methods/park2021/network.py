"""Park 2021, section 6.1 and appendix A: stylizer G, style encoder E, mapping network F, discriminator D.

Motions are ``[B, 7, T, 21]``. Graphs of 21, 10 and 5 nodes, T, T / 2 and T / 4 frames. At full width and 8 styles G has
961,095 parameters, E 5,910,016, F 860,224 and D 5,780,488.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.layers import JointPool, adain, halve_time, stretch_time
from bench.motion.skeleton import CANONICAL_PARENTS
from classifiers.graph import spatial_partition

CHANNELS = 7
LEVELS = 3
PARENTS = (CANONICAL_PARENTS, (4, 0, 4, 2, -1, 4, 5, 6, 5, 8), (2, 2, -1, 2, 2))
"""Trees of the three graphs; roots are nodes 0, 4 and 2."""
POOLED = (
    ((1, 2), (3, 4), (5, 6), (7, 8), (0, 9), (10, 11, 12), (13, 14), (15, 16), (17, 18), (19, 20)),
    ((0, 1), (2, 3), (4, 5), (6, 7), (8, 9)),
)
"""Joints of each of the 10 nodes, and of these each of the 5 nodes: neighbours within a body part (Fig. 3)."""
SHRINK = 4
"""Frames for one frame of the coarsest graph."""
LEAK = 0.2


@dataclass(frozen=True)
class NetworkSize:
    """Sizes of the four networks; the defaults are the paper's.

    Attributes
    ----------
    n_styles : style domains.
    width : channels of the finest graph; the coarser ones have two and four times as many.
    style_dim, latent_dim : length of a style code and of a latent code z.
    hidden_dim : of the mapping network.
    n_frames : length of the windows that E and D see.
    faithful_partition : the graph partition of the released code, see ``classifiers.graph.spatial_partition``.
    """

    n_styles: int
    width: int = 64
    style_dim: int = 64
    latent_dim: int = 16
    hidden_dim: int = 512
    n_frames: int = 64
    faithful_partition: bool = False


class SpatialConv(nn.Module):
    """Equation 1: the sum over subsets k of ``(W_k x + b_k) A_k``, ``[B, C, T, V] -> [B, out, T, V]``.

    Neighbours are gathered before the channels are mixed, which gives the same and is faster on a CPU.
    """

    adjacency: Tensor

    def __init__(self, n_in: int, n_out: int, level: int, size: NetworkSize) -> None:
        super().__init__()
        partition = spatial_partition(PARENTS[level], faithful=size.faithful_partition)  # [K, source, target]
        self.register_buffer("adjacency", torch.as_tensor(partition, dtype=torch.float32), persistent=False)
        self.weight = nn.Parameter(torch.empty(n_out, len(partition), n_in))
        self.bias = nn.Parameter(torch.zeros(len(partition), n_out))

    def forward(self, x: Tensor) -> Tensor:
        batch, channels, frames, joints = x.shape
        subsets = len(self.adjacency)
        gather = self.adjacency.permute(2, 0, 1).reshape(joints * subsets, joints)
        rows = x.permute(0, 2, 3, 1).reshape(batch * frames, joints, channels)
        gathered = torch.matmul(gather, rows).reshape(batch, frames, joints, subsets * channels)
        offset = self.adjacency.sum(dim=1).T @ self.bias  # [V, out]
        return (functional.linear(gathered, self.weight.flatten(1)) + offset).permute(0, 3, 1, 2)


class TemporalConv(nn.Module):
    """Convolution over three frames, ``[B, C, T, V] -> [B, C, T, V]``."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.conv = nn.Conv2d(channels, channels, (3, 1), padding=(1, 0))

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = self.conv(x)
        return result


class Resample(nn.Module):
    """From one graph to a coarser or finer one: means of nodes and frame pairs; copies and linear interpolation."""

    def __init__(self, level: int, *, coarser: bool) -> None:
        super().__init__()
        self.nodes = JointPool(POOLED[level])
        self.coarser = coarser

    def forward(self, x: Tensor) -> Tensor:
        if self.coarser:
            return halve_time(self.nodes.pool(x))
        return stretch_time(self.nodes.unpool(x), 2 * x.shape[2])


class SpatialTemporalConv(nn.Module):
    """Spatial convolution, change of graph if any, rectifier, temporal convolution."""

    def __init__(self, n_in: int, n_out: int, level: int, size: NetworkSize, resample: nn.Module | None = None) -> None:
        super().__init__()
        self.spatial = SpatialConv(n_in, n_out, level, size)
        self.resample = resample if resample is not None else nn.Identity()
        self.temporal = TemporalConv(n_out)

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = self.temporal(functional.relu(self.resample(self.spatial(x))))
        return result


class PointwiseMix(nn.Linear):
    """A 1 x 1 convolution, ``[B, C, T, V] -> [B, out, T, V]``."""

    def forward(self, x: Tensor) -> Tensor:
        # contiguous, or torch would multiply in another order, and round differently, where weights need no gradient
        return super().forward(x.permute(0, 2, 3, 1).contiguous()).permute(0, 3, 1, 2)


class EncoderBlock(nn.Module):
    """Residual block from one graph to the next coarser one, twice the channels; with instance norm in G only."""

    def __init__(self, n_in: int, level: int, size: NetworkSize, *, normalised: bool) -> None:
        super().__init__()
        self.norms = nn.ModuleList(
            nn.InstanceNorm2d(n_in, affine=True) if normalised else nn.Identity() for _ in range(2)
        )
        self.pool = Resample(level, coarser=True)
        self.first = SpatialTemporalConv(n_in, n_in, level, size, self.pool)
        self.second = SpatialTemporalConv(n_in, 2 * n_in, level + 1, size)
        self.shortcut = PointwiseMix(n_in, 2 * n_in, bias=False)

    def forward(self, x: Tensor) -> Tensor:
        carried: Tensor = self.shortcut(self.pool(x))
        deep = self.first(functional.leaky_relu(self.norms[0](x), LEAK))
        deep = self.second(functional.leaky_relu(self.norms[1](deep), LEAK))
        joined: Tensor = (carried + deep) / math.sqrt(2.0)
        return joined


class Adain(nn.Module):
    """Equation 4 as meant: ``(1 + gamma(s)) instance_norm(x) + beta(s)``."""

    def __init__(self, channels: int, style_dim: int) -> None:
        super().__init__()
        self.affine = nn.Linear(style_dim, 2 * channels)

    def forward(self, x: Tensor, style: Tensor) -> Tensor:
        gamma, beta = self.affine(style).chunk(2, dim=1)
        return adain(x, 1.0 + gamma, beta)


class DecoderBlock(nn.Module):
    """Residual block with AdaIN from one graph to the next finer one, half the channels."""

    def __init__(self, n_in: int, level: int, size: NetworkSize) -> None:
        super().__init__()
        n_out = n_in // 2
        self.norms = nn.ModuleList(Adain(channels, size.style_dim) for channels in (n_in, n_out))
        self.unpool = Resample(level, coarser=False)
        self.first = SpatialTemporalConv(n_in, n_out, level + 1, size, self.unpool)
        self.second = SpatialTemporalConv(n_out, n_out, level, size)
        self.shortcut = PointwiseMix(n_in, n_out, bias=False)

    def forward(self, x: Tensor, style: Tensor) -> Tensor:
        carried: Tensor = self.unpool(self.shortcut(x))
        deep = self.first(functional.leaky_relu(self.norms[0](x, style), LEAK))
        deep = self.second(functional.leaky_relu(self.norms[1](deep, style), LEAK))
        joined: Tensor = (carried + deep) / math.sqrt(2.0)
        return joined


class Trunk(nn.Module):
    """What G's encoder, E and D share in shape: a 1 x 1 convolution and two residual blocks."""

    def __init__(self, size: NetworkSize, *, normalised: bool) -> None:
        super().__init__()
        self.enter = PointwiseMix(CHANNELS, size.width)
        self.blocks = nn.ModuleList(
            EncoderBlock(size.width * 2**level, level, size, normalised=normalised) for level in range(LEVELS - 1)
        )

    def forward(self, motion: Tensor) -> Tensor:
        x: Tensor = self.enter(motion)
        for block in self.blocks:
            x = block(x)
        return x  # [B, 4 width, T / 4, 5]


class Stylizer(nn.Module):
    """G, equations 2 and 3: ``[B, 7, T, 21]`` and codes ``[B, style_dim]`` to a motion; T is a multiple of 4."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.encoder = Trunk(size, normalised=True)
        self.decoder = nn.ModuleList(
            DecoderBlock(size.width * 2 ** (level + 1), level, size) for level in reversed(range(LEVELS - 1))
        )
        self.leave = PointwiseMix(size.width, CHANNELS)

    def encode(self, motion: Tensor) -> Tensor:
        """Equation 2: ``[B, 7, T, 21] -> [B, 4 width, T / 4, 5]``."""
        content: Tensor = self.encoder(motion)
        return content

    def decode(self, content: Tensor, style: Tensor) -> Tensor:
        """Equation 3: ``[B, 4 width, T / 4, 5]`` and codes ``[B, style_dim]`` to ``[B, 7, T, 21]``."""
        for block in self.decoder:
            content = block(content, style)
        result: Tensor = self.leave(content)
        return result

    def forward(self, motion: Tensor, style: Tensor) -> Tensor:
        return self.decode(self.encode(motion), style)


class Reader(nn.Module):
    """Trunk, then one convolution over all that is left of a window: ``[B, 7, n_frames, 21] -> [B, 4 width]``."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.trunk = Trunk(size, normalised=False)
        nodes, frames, channels = len(PARENTS[-1]), size.n_frames // SHRINK, SHRINK * size.width
        self.whole = nn.Linear(channels * frames * nodes, channels)

    def forward(self, motion: Tensor) -> Tensor:
        deep = functional.leaky_relu(self.trunk(motion), LEAK)
        return functional.leaky_relu(self.whole(deep.flatten(1)), LEAK)


class StyleEncoder(nn.Module):
    """E, equation 5: windows and their domains ``[B]`` to style codes ``[B, style_dim]``."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.reader = Reader(size)
        self.heads = nn.ModuleList(nn.Linear(SHRINK * size.width, size.style_dim) for _ in range(size.n_styles))

    def forward(self, motion: Tensor, domains: Tensor) -> Tensor:
        read = self.reader(motion)
        return of_domain(torch.stack([head(read) for head in self.heads], dim=1), domains)


class MappingNetwork(nn.Module):
    """F, equation 6: latent codes ``[B, latent_dim]`` and domains ``[B]`` to style codes ``[B, style_dim]``."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.n_styles = size.n_styles
        self.of_latent = nn.Linear(size.latent_dim, size.hidden_dim // 2)
        self.of_domain = nn.Linear(size.n_styles, size.hidden_dim // 2)
        self.shared = nn.Sequential(
            nn.Linear(size.hidden_dim, size.hidden_dim),
            nn.ReLU(),
            nn.Linear(size.hidden_dim, 2 * size.hidden_dim),
            nn.ReLU(),
            nn.Linear(2 * size.hidden_dim, size.style_dim),
            nn.Tanh(),
        )

    def forward(self, latent: Tensor, domains: Tensor) -> Tensor:
        label = functional.one_hot(domains, self.n_styles).to(latent)
        read = torch.cat([functional.relu(self.of_latent(latent)), functional.relu(self.of_domain(label))], dim=1)
        result: Tensor = self.shared(read)
        return result


class Discriminator(nn.Module):
    """D: a logit for each domain, of which ``domains`` ``[B]`` picks one, ``[B]``."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.reader = Reader(size)
        self.heads = nn.Linear(SHRINK * size.width, size.n_styles)

    def forward(self, motion: Tensor, domains: Tensor) -> Tensor:
        return of_domain(self.heads(self.reader(motion)), domains)


def of_domain(outputs: Tensor, domains: Tensor) -> Tensor:
    """Of ``[B, n_styles, ...]`` the output of each sample's own domain, ``[B, ...]``."""
    return outputs[torch.arange(len(outputs), device=outputs.device), domains]


@torch.no_grad()
def initialise(network: nn.Module) -> None:
    """He et al. 2015 for rectifiers by fan-in; biases zero (in place)."""
    for module in network.modules():
        if isinstance(module, SpatialConv):
            # as in the released code, where each subset's filters are of their own
            nn.init.normal_(module.weight, std=math.sqrt(2.0 / module.weight.shape[2]))
        elif isinstance(module, nn.Linear | nn.Conv2d):
            nn.init.kaiming_normal_(module.weight, nonlinearity="relu")
            if module.bias is not None:
                nn.init.zeros_(module.bias)
