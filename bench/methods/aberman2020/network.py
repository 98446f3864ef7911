"""The networks of Aberman et al. 2020 (section 4): content encoder, style encoders, decoder, discriminator.

Tensors are ``[B, channels, T]``. Widths and kernels are those of the released code; with its 31 joints the generator
has 1,409,900 weights and the discriminator 1,009,752.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.layers import adain, double_time

LEAST_FRAMES = 16
"""Below this the reflected padding would be longer than what it pads."""


@dataclass(frozen=True)
class NetworkSize:
    """Channels and kernels.

    Attributes
    ----------
    content, style, video, output : channels in and out; ``video`` 0 builds no encoder of projected motion.
    hidden : of content codes, style codes and the decoder.
    style_hidden : after the first layer of style encoders and the first stage of the discriminator.
    mlp : hidden layers between a style code and the numbers of AdaIN.
    every_layer : AdaIN after every convolution of the residual block, as the paper words it; the released code
        has it once, before the block.
    linear : frames between those of a code are interpolated, not repeated as in the paper. Filters over repeated frames
        can answer every second frame differently, which shakes.
    """

    content: int
    style: int
    video: int
    output: int
    hidden: int = 144
    style_hidden: int = 96
    mlp: tuple[int, ...] = (192, 256)
    every_layer: bool = False
    linear: bool = False

    def narrowed(self, width: float) -> NetworkSize:
        """The same network with all inner channels multiplied by ``width``."""
        return replace(
            self,
            hidden=round(self.hidden * width),
            style_hidden=round(self.style_hidden * width),
            mlp=tuple(round(n * width) for n in self.mlp),
        )


class Conv(nn.Module):
    """Convolution over time with reflected (or zero) ends: ``[B, C, T] -> [B, D, T / stride]``."""

    def __init__(
        self, n_in: int, n_out: int, kernel: int, stride: int = 1, *, mode: str = "reflect", bias: bool = True
    ) -> None:
        super().__init__()
        self.conv = nn.Conv1d(n_in, n_out, kernel, stride, bias=bias)
        self.ends = ((kernel - 1) // 2, kernel - 1 - (kernel - 1) // 2)
        self.mode = mode
        nn.init.kaiming_normal_(self.conv.weight)
        if self.conv.bias is not None:
            nn.init.zeros_(self.conv.bias)

    def forward(self, x: Tensor) -> Tensor:
        result: Tensor = self.conv(functional.pad(x, self.ends, mode=self.mode))
        return result


def leaky(x: Tensor) -> Tensor:
    """Leaky ReLU with slope 0.2."""
    return functional.leaky_relu(x, 0.2)


class ContentEncoder(nn.Module):
    """One halving convolution and a residual block; instance norm takes style out (section 4.1)."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.down = Conv(size.content, size.hidden, 8, 2)
        self.inner = nn.ModuleList([Conv(size.hidden, size.hidden, 8) for _ in range(2)])
        self.norms = nn.ModuleList([nn.InstanceNorm1d(size.hidden, affine=True) for _ in range(3)])

    def forward(self, motion: Tensor) -> Tensor:
        """``[B, content, T] -> [B, hidden, T / 2]``."""
        x = leaky(self.norms[0](self.down(motion)))
        inner = leaky(self.norms[1](self.inner[0](x)))
        result: Tensor = x + self.norms[2](self.inner[1](inner))
        return result


class StyleEncoder(nn.Module):
    """Two halving convolutions, no norm, then the maximum over time (section 4.2)."""

    def __init__(self, n_in: int, size: NetworkSize) -> None:
        super().__init__()
        self.layers = nn.ModuleList([Conv(n_in, size.style_hidden, 8, 2), Conv(size.style_hidden, size.hidden, 8, 2)])

    def forward(self, motion: Tensor) -> Tensor:
        """``[B, n_in, T] -> [B, hidden]``."""
        for layer in self.layers:
            motion = leaky(layer(motion))
        return motion.amax(dim=2)


class StyleMlp(nn.Module):
    """A style code as shifts and scales of AdaIN: ``[B, hidden] -> [B, n_out]``."""

    def __init__(self, size: NetworkSize, n_out: int) -> None:
        super().__init__()
        widths = (size.hidden, *size.mlp, n_out)
        linear = [nn.Linear(n_in, n_next) for n_in, n_next in pairwise(widths)]
        for layer in linear:
            nn.init.kaiming_normal_(layer.weight)
            nn.init.zeros_(layer.bias)
        self.layers = nn.ModuleList(linear)

    def forward(self, code: Tensor) -> Tensor:
        for layer in self.layers[:-1]:
            code = leaky(layer(code))
        result: Tensor = self.layers[-1](code)
        return result


class Decoder(nn.Module):
    """AdaIN, a residual block, up-sampling to the nearest neighbour and one convolution (section 4.3)."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.n_adain = 3 if size.every_layer else 1
        self.linear = size.linear
        self.inner = nn.ModuleList([Conv(size.hidden, size.hidden, 8) for _ in range(2)])
        self.up = Conv(size.hidden, size.output, 8)

    def forward(self, content: Tensor, numbers: Tensor) -> Tensor:
        """Content ``[B, hidden, T / 2]`` and AdaIN numbers ``[B, 2 n_adain hidden]`` to ``[B, output, T]``."""
        shifts_scales = numbers.reshape(len(numbers), self.n_adain, 2, -1)
        x = adain(content, shifts_scales[:, 0, 1], shifts_scales[:, 0, 0])
        inner = x
        for layer, conv in enumerate(self.inner):
            inner = conv(inner)
            if self.n_adain > 1:
                inner = adain(inner, shifts_scales[:, 1 + layer, 1], shifts_scales[:, 1 + layer, 0])
            inner = leaky(inner) if layer == 0 else inner
        code: Tensor = x + inner
        doubled = functional.interpolate(code, scale_factor=2, mode="linear") if self.linear else double_time(code)
        result: Tensor = self.up(doubled)
        return result


class Generator(nn.Module):
    """Content code of one motion, style code of another, decoded to output channels."""

    def __init__(self, size: NetworkSize) -> None:
        super().__init__()
        self.content_encoder = ContentEncoder(size)
        self.style_encoder = StyleEncoder(size.style, size)
        self.video_encoder = StyleEncoder(size.video, size) if size.video else None
        self.decoder = Decoder(size)
        self.mlp = StyleMlp(size, 2 * self.decoder.n_adain * size.hidden)

    def decode(self, content_code: Tensor, style_code: Tensor) -> Tensor:
        """``[B, hidden, T / 2]`` and ``[B, hidden]`` to ``[B, output, T]``."""
        result: Tensor = self.decoder(content_code, self.mlp(style_code))
        return result

    def forward(self, content: Tensor, style: Tensor) -> Tensor:
        """``[B, content, T]`` and ``[B, style, S]`` to ``[B, output, T]``."""
        return self.decode(self.content_encoder(content), self.style_encoder(style))


class Discriminator(nn.Module):
    """Patches of motion judged by one head a style (section 4.4): a residual network with two poolings.

    Parameters
    ----------
    n_in : channels of a motion.
    n_styles : heads.
    widths : after the first and the second stage.
    """

    def __init__(self, n_in: int, n_styles: int, widths: tuple[int, int] = (96, 144)) -> None:
        super().__init__()
        self.first = Conv(n_in, n_in, 6)
        stages = []
        for n_before, n_after in pairwise((n_in, *widths)):
            stages.append(nn.Sequential(ResidualBlock(n_before, n_before), ResidualBlock(n_before, n_after)))
        self.stages = nn.ModuleList(stages)
        self.last = nn.Sequential(ResidualBlock(widths[-1], widths[-1]), ResidualBlock(widths[-1], widths[-1]))
        self.heads = Conv(widths[-1], n_styles, 6)

    def forward(self, motion: Tensor, styles: Tensor) -> tuple[Tensor, Tensor]:
        """Scores of the heads of ``styles`` ``[B]`` and features: ``[B, n_in, T] -> [B, T / 4], [B, width, T / 4]``."""
        x = self.first(motion)
        for stage in self.stages:
            x = functional.avg_pool1d(functional.pad(stage(x), (0, 1), mode="reflect"), 3, 2)
        features: Tensor = self.last(x)
        scores = self.heads(leaky(features))
        return scores[torch.arange(len(styles), device=styles.device), styles], features


class ResidualBlock(nn.Module):
    """Two convolutions, activations first; the shortcut is a convolution without bias where widths differ."""

    def __init__(self, n_in: int, n_out: int) -> None:
        super().__init__()
        inner = min(n_in, n_out)
        self.layers = nn.ModuleList([Conv(n_in, inner, 6), Conv(inner, n_out, 6)])
        self.shortcut = Conv(n_in, n_out, 6, mode="constant", bias=False) if n_in != n_out else nn.Identity()

    def forward(self, x: Tensor) -> Tensor:
        inner = x
        for layer in self.layers:
            inner = layer(leaky(inner))
        result: Tensor = self.shortcut(x) + inner
        return result


class CellDiscriminator(nn.Module):
    """Spectrally normalised convolutions with a projection on (content, style) cells (Miyato and Koyama 2018)."""

    def __init__(self, n_in: int, n_cells: int, width: int = 64) -> None:
        super().__init__()
        widths = (n_in, width, width + width // 2, 2 * width)
        normed = nn.utils.parametrizations.spectral_norm
        self.layers = nn.ModuleList([normed(nn.Conv1d(a, b, 4, 2, padding=1)) for a, b in pairwise(widths)])
        self.score = normed(nn.Linear(widths[-1], 1))
        self.cells = nn.Embedding(n_cells, widths[-1])
        nn.init.normal_(self.cells.weight, std=1.0 / math.sqrt(widths[-1]))

    def forward(self, motion: Tensor, cells: Tensor) -> tuple[Tensor, Tensor]:
        """Scores ``[B]`` and features ``[B, 2 width]`` of ``[B, n_in, T]`` in cells ``[B]``."""
        for layer in self.layers:
            motion = leaky(layer(motion))
        features = motion.mean(dim=2)
        score: Tensor = self.score(features)[:, 0] + (self.cells(cells) * features).sum(dim=1)
        return score, features
