"""Networks of Mason et al. 2022: three synthesis networks times three ways to modulate them by style.

A synthesis network is three layers whose weights are blends of experts. PFNN blends four control points by a global
phase (Holden et al. 2017, equation 7), LPN and MANN eight experts by a gating network that sees local phases or
velocities of the end effectors (section 4.1). A style enters as a one-hot input, as a residual adapter of the second
hidden layer, or as FiLM of both hidden layers (section 4.2, equations 2 and 3).
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor, nn
from torch.nn import functional

Backbone = Literal["pfnn", "mann", "lpn"]
Modulation = Literal["onehot", "resad", "film"]

CONTROL_POINTS = 4
EXPERTS = 8
GATE_WIDTH = 32
N_PHASES = 8
N_GATE_VELOCITIES = 12
NORM_EPSILON = 1e-6
CLIP_KERNEL = 25


@dataclass(frozen=True)
class ModelSize:
    """Widths of one model.

    Attributes
    ----------
    backbone, modulation : which synthesis network, and how a style enters it.
    n_input, n_output : features of a frame and of the frame that follows.
    n_styles : styles that the one-hot input and the residual adapters tell apart.
    hidden : both hidden layers.
    clip_frames, clip_features : of the style clip that FiLM parameters are read from.
    clip_channels : of both convolutions over it.
    film_hidden : first fully connected layer of the FiLM generator.
    rank : of PFNN's residual adapters.
    dropout : in front of every layer of synthesis, gating and FiLM networks.
    """

    backbone: Backbone
    modulation: Modulation
    n_input: int
    n_output: int
    n_styles: int
    hidden: int = 512
    clip_frames: int = 240
    clip_features: int = 300
    clip_channels: int = 256
    film_hidden: int = 2048
    rank: int = 30
    dropout: float = 0.3

    @property
    def n_experts(self) -> int:
        return CONTROL_POINTS if self.backbone == "pfnn" else EXPERTS

    @property
    def n_gate(self) -> int:
        """Width of what blends the experts: a phase, local phases, or velocities."""
        return {"pfnn": 1, "lpn": N_PHASES, "mann": N_GATE_VELOCITIES}[self.backbone]


class BlendedLinear(nn.Module):
    """``W = sum of alpha_i W_i`` (section 4.1): one affine layer a sample, blended from experts."""

    def __init__(self, n_experts: int, n_in: int, n_out: int) -> None:
        super().__init__()
        bound = math.sqrt(6.0 / (n_in + n_out))
        self.weight = nn.Parameter(torch.empty(n_experts, n_out, n_in).uniform_(-bound, bound))
        self.bias = nn.Parameter(torch.zeros(n_experts, n_out))

    def forward(self, x: Tensor, blend: Tensor) -> Tensor:
        """``x`` ``[B, n_in]``, ``blend`` ``[B, n_experts]``, result ``[B, n_out]``."""
        return blended(x, self.weight, blend) + blend @ self.bias


def blended(x: Tensor, weight: Tensor, blend: Tensor) -> Tensor:
    """Every expert's product, weighted: ``[B, n_in], [E, n_out, n_in], [B, E] -> [B, n_out]``."""
    n_experts, n_out, n_in = weight.shape
    products = (x @ weight.reshape(n_experts * n_out, n_in).T).view(len(x), n_experts, n_out)
    return torch.einsum("be,beo->bo", blend, products)


def catmull_rom(phase: Tensor) -> Tensor:
    """Weights of four control points on a closed cubic Catmull-Rom spline (Holden et al. 2017, equation 7).

    ``phase`` ``[B]`` in cycles, of which only the fraction counts; result ``[B, 4]``, each row with sum 1.
    """
    place = CONTROL_POINTS * torch.remainder(phase, 1.0)
    first = torch.remainder(place.floor().long(), CONTROL_POINTS)
    w = (place - place.floor())[:, None]
    weights = torch.cat(
        [
            -0.5 * w + w**2 - 0.5 * w**3,
            1.0 - 2.5 * w**2 + 1.5 * w**3,
            0.5 * w + 2.0 * w**2 - 1.5 * w**3,
            -0.5 * w**2 + 0.5 * w**3,
        ],
        dim=1,
    )
    points = torch.remainder(first[:, None] + torch.arange(-1, 3, device=phase.device), CONTROL_POINTS)
    return torch.zeros_like(weights).scatter(1, points, weights)


class Gate(nn.Module):
    """Omega: phases or velocities of the end effectors to blending weights that sum to 1."""

    def __init__(self, n_input: int, dropout: float) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Dropout(dropout), nn.Linear(n_input, GATE_WIDTH), nn.ELU(),
            nn.Dropout(dropout), nn.Linear(GATE_WIDTH, GATE_WIDTH), nn.ELU(),
            nn.Dropout(dropout), nn.Linear(GATE_WIDTH, EXPERTS),
        )  # fmt: skip

    def forward(self, signal: Tensor) -> Tensor:
        """``[B, n_input] -> [B, 8]``."""
        scores: Tensor = self.layers(signal)
        return scores.softmax(dim=1)


class Synthesis(nn.Module):
    """Phi and what blends its experts: the animation synthesis network ("A.S.N." of Table 2)."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        n = size.n_experts
        self.gate = None if size.backbone == "pfnn" else Gate(size.n_gate, size.dropout)
        self.first = BlendedLinear(n, size.n_input, size.hidden)
        self.second = BlendedLinear(n, size.hidden, size.hidden)
        self.third = BlendedLinear(n, size.hidden, size.n_output)
        self.dropout = nn.Dropout(size.dropout)

    def blend(self, signal: Tensor) -> Tensor:
        """Weights of the experts ``[B, E]`` from ``[B, n_gate]``."""
        if self.gate is None:
            return catmull_rom(signal[:, 0])
        weights: Tensor = self.gate(signal)
        return weights


class StyleModulation(nn.Module):
    """The style modulation network ("S.M.N." of Table 2): what a style does to the two hidden layers.

    A style is a code ``[B, ...]``: weights of the known styles ``[B, n_styles]``, or FiLM parameters ``[B, 4 hidden]``.
    """

    @abstractmethod
    def first(self, features: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        """Features of layer 1 ``[B, hidden]`` to its hidden units."""
        raise NotImplementedError

    @abstractmethod
    def second(self, features: Tensor, below: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        """Features of layer 2 and the hidden units below it to its hidden units."""
        raise NotImplementedError


class OneHot(StyleModulation):
    """The label beside the input (Holden et al. 2017): in effect one bias a style and expert in layer 1."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        self.bias = nn.Parameter(torch.zeros(size.n_experts, size.hidden, size.n_styles))
        nn.init.normal_(self.bias, std=0.01)

    def first(self, features: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        return functional.elu(features + blended(code, self.bias, blend))

    def second(self, features: Tensor, below: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        return functional.elu(features)


class ResidualAdapter(StyleModulation):
    """A matrix a style, added to hidden layer 2 (Rebuffi et al. 2017)."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        self.weight = nn.Parameter(torch.empty(size.n_styles, size.hidden, size.hidden))
        self.bias = nn.Parameter(torch.zeros(size.n_styles, size.hidden))
        nn.init.normal_(self.weight, std=0.1 / math.sqrt(size.hidden))

    def first(self, features: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        return functional.elu(features)

    def second(self, features: Tensor, below: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        return functional.elu(features + per_style(below, self.weight, code) + code @ self.bias)


class PhaseResidualAdapter(StyleModulation):
    """The adapter of PFNN: ``B diag(c(phase)) A``, a CP decomposition of rank 30 (Mason et al. 2018, section 4)."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        scale = 1.0 / math.sqrt(size.hidden)
        self.down = nn.Parameter(torch.randn(size.n_styles, size.rank, size.hidden) * scale)
        self.middle = nn.Parameter(torch.ones(size.n_styles, CONTROL_POINTS, size.rank))
        self.up = nn.Parameter(torch.randn(size.n_styles, size.hidden, size.rank) * scale)
        self.bias = nn.Parameter(torch.zeros(size.n_styles, size.hidden))

    def first(self, features: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        return functional.elu(features)

    def second(self, features: Tensor, below: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        n_styles, rank, _ = self.down.shape
        inner = (below @ self.down.flatten(0, 1).T).view(len(below), n_styles, rank)
        inner = inner * torch.einsum("be,ser->bsr", blend, self.middle) * code[:, :, None]
        adapted = torch.einsum("bsr,sor->bo", inner, self.up)
        return functional.elu(features + adapted + code @ self.bias)


def per_style(x: Tensor, weight: Tensor, code: Tensor) -> Tensor:
    """Products with the styles' own matrices, weighted by ``code``; what nobody wants is not read."""
    wanted = torch.nonzero((code != 0).any(dim=0))[:, 0]
    return blended(x, weight[wanted], code[:, wanted])


class Film(StyleModulation):
    """Psi: a clip of the style to gamma and beta of both hidden layers (equations 2 and 3)."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        self.generator = nn.Sequential(
            _convolution(size.clip_features, size.clip_channels), nn.ReLU(), nn.MaxPool1d(2),
            _convolution(size.clip_channels, size.clip_channels), nn.ReLU(), nn.MaxPool1d(2),
            nn.Flatten(),
            nn.Dropout(size.dropout),
            nn.Linear(size.clip_channels * (size.clip_frames // 4), size.film_hidden), nn.ReLU(),
            nn.Dropout(size.dropout),
            nn.Linear(size.film_hidden, 4 * size.hidden),
        )  # fmt: skip

    def code(self, clip: Tensor) -> Tensor:
        """``[B, clip_frames, clip_features] -> [B, 4 hidden]``: gamma 1, beta 1, gamma 2, beta 2."""
        parameters: Tensor = self.generator(clip.transpose(1, 2))
        return parameters

    def first(self, features: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        gamma, beta, _, _ = code.chunk(4, dim=1)
        return functional.elu(gamma * layer_norm(features) + beta)

    def second(self, features: Tensor, below: Tensor, code: Tensor, blend: Tensor) -> Tensor:
        _, _, gamma, beta = code.chunk(4, dim=1)
        return functional.elu(gamma * layer_norm(features) + beta)


def _convolution(n_in: int, n_out: int) -> nn.Conv1d:
    return nn.Conv1d(n_in, n_out, CLIP_KERNEL, padding=CLIP_KERNEL // 2)


def layer_norm(features: Tensor) -> Tensor:
    """Zero mean and unit sample deviation over the features of each sample, ``[B, C] -> [B, C]``."""
    deviation, mean = torch.std_mean(features, dim=1, keepdim=True)
    return (features - mean) / (deviation + NORM_EPSILON)


class StyleModel(nn.Module):
    """One of the seven models: z = Phi(x; Omega(signal), style) (equation 4)."""

    def __init__(self, size: ModelSize) -> None:
        super().__init__()
        self.size = size
        self.synthesis = Synthesis(size)
        self.modulation = modulation_of(size)

    def forward(self, x: Tensor, signal: Tensor, code: Tensor) -> Tensor:
        """Frame ``[B, n_input]``, gating signal ``[B, n_gate]`` and style code to the next frame ``[B, n_output]``."""
        synthesis, drop = self.synthesis, self.synthesis.dropout
        blend = synthesis.blend(signal)
        below = self.modulation.first(synthesis.first(drop(x), blend), code, blend)
        hidden = self.modulation.second(synthesis.second(drop(below), blend), below, code, blend)
        result: Tensor = synthesis.third(drop(hidden), blend)
        return result

    def code(self, style: Tensor | None, clip: Tensor | None) -> Tensor:
        """The style code: FiLM parameters of a clip, else the weights of the known styles themselves."""
        if isinstance(self.modulation, Film):
            if clip is None:
                raise ValueError("FiLM reads a style off a clip, got none")
            return self.modulation.code(clip)
        if style is None:
            raise ValueError(f"{self.size.modulation} knows styles by label, got none")
        return style


def modulation_of(size: ModelSize) -> StyleModulation:
    """The style modulation network of a model."""
    if size.modulation == "film":
        return Film(size)
    if size.modulation == "onehot":
        return OneHot(size)
    return PhaseResidualAdapter(size) if size.backbone == "pfnn" else ResidualAdapter(size)


def numbers_per_style(size: ModelSize) -> int:
    """What has to be kept of one style at run time ("P.S.R." of Table 2)."""
    if size.modulation == "film":
        return 4 * size.hidden
    if size.modulation == "onehot":
        return size.n_experts * size.hidden
    if size.backbone == "pfnn":
        return 2 * size.rank * size.hidden + CONTROL_POINTS * size.rank + size.hidden
    return size.hidden * size.hidden + size.hidden
