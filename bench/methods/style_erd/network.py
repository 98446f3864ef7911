"""The encoder-recurrent-decoder, the discriminator with attention, and the content classifier.

Tao et al. 2022, section 3.1 and supplement A. At the paper's 31 joints, 7 styles and 5 contents the generator has
377,604 parameters in the paper's form and 479,236 in the released one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import torch
from torch import Tensor, nn

State: TypeAlias = tuple[Tensor, Tensor]
"""Hidden and cell state of one branch, ``[layers, B, hidden]`` each."""
N_CONTACTS = 4
LABEL_WIDTH = 64
OPEN_GATE = 2.0
"""Added to the biases of gates that start open: a sigmoid of 0.88."""


@dataclass(frozen=True)
class Shape:
    """Sizes of the networks.

    Attributes
    ----------
    n_rotations, n_positions : numbers of a frame; velocities are as many as positions.
    n_styles : without the neutral one. n_contents : content labels.
    hidden : of the latent code and the LSTMs.
    neutral_layers, style_layers : 6 and 4 in the paper, 4 and 6 in the released code.
    learned_states : initial states are parameters; False is the ablation with zeros.
    decoder_labels : the decoder sees the target style; in the released code its input for it is zero.
    carrying_start : not in the paper: layers of the branches start as ones that pass on what they get.
    """

    n_rotations: int
    n_positions: int
    n_styles: int
    n_contents: int
    hidden: int = 32
    neutral_layers: int = 6
    style_layers: int = 4
    learned_states: bool = True
    decoder_labels: bool = True
    carrying_start: bool = False

    @property
    def n_motion(self) -> int:
        return self.n_rotations + 2 * self.n_positions


class Branch(nn.Module):
    """A stack of LSTM layers with one learned initial state for each of some labels."""

    states: Tensor

    def __init__(self, shape: Shape, layers: int, n_states: int) -> None:
        super().__init__()
        self.lstm = nn.LSTM(shape.hidden, shape.hidden, layers, batch_first=True)
        if shape.carrying_start:
            _carry(self.lstm)
        states = torch.zeros(2, layers, n_states, shape.hidden)
        if shape.learned_states:
            self.states = nn.Parameter(states)
        else:
            self.register_buffer("states", states)

    def initial(self, labels: Tensor) -> State:
        """The states with which sequences of label weights ``[B, n_states]`` begin."""
        hidden, cell = torch.einsum("bn,klnh->klbh", labels, self.states)
        return hidden.contiguous(), cell.contiguous()

    def forward(self, latent: Tensor, state: State) -> tuple[Tensor, State]:
        """``[B, T, hidden]`` and what was before it."""
        result: tuple[Tensor, State] = self.lstm(latent, state)
        return result


class StyleErd(nn.Module):
    """The generator: encode a frame, add a style's residual to the neutral branch, decode (section 3.1).

    Contents ``[B, n_contents]`` are one-hot. Styles ``[B, n_styles]`` are weights without the neutral one, which is all
    zeros: one-hot for a style, less than 1 for its intensity, several for a mixture (section 4.4).
    """

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        self.shape = shape
        read = shape.n_motion + shape.n_styles + shape.n_contents + N_CONTACTS
        widths = (read, read // 4 * 2, read // 4 * 2 // 4 * 2, shape.hidden)
        self.encoder = nn.Sequential(
            nn.Linear(widths[0], widths[1]), nn.ReLU(), nn.Linear(widths[1], widths[2]), nn.ReLU(),
            nn.Linear(widths[2], widths[3]),
        )  # fmt: skip
        self.neutral = Branch(shape, shape.neutral_layers, shape.n_contents)
        self.styles = nn.ModuleList([Branch(shape, shape.style_layers, 1) for _ in range(shape.n_styles)])
        inner = [shape.hidden + shape.n_styles]
        for _ in range(3):
            inner.append(int(inner[-1] * 1.5 // 2 * 2))
        self.decoder = nn.Sequential(
            nn.Linear(inner[0], inner[1]), nn.ReLU(), nn.Linear(inner[1], inner[2]), nn.ReLU(),
            nn.Linear(inner[2], inner[3]), nn.ReLU(),
        )  # fmt: skip
        self.rotation_layer = nn.Linear(inner[3], shape.n_rotations)
        self.velocity_layer = nn.Linear(inner[3], shape.n_positions)

    def encode(self, motion: Tensor, contacts: Tensor, contents: Tensor, source_styles: Tensor) -> Tensor:
        """z_t ``[B, T, hidden]`` of motion ``[B, T, R + 2P]`` and contacts ``[B, T, 4]``."""
        labels = torch.cat([source_styles, contents], dim=1)[:, None].expand(-1, motion.shape[1], -1)
        code: Tensor = self.encoder(torch.cat([motion, labels, contacts], dim=2))
        return code

    def initial(self, contents: Tensor) -> list[State]:
        """States of the neutral branch and of every style's, at the beginning of sequences."""
        one = torch.ones_like(contents[:, :1])
        return [self.neutral.initial(contents), *(_branch(style).initial(one) for style in self.styles)]

    def recur(self, code: Tensor, target: Tensor, states: Sequence[State]) -> tuple[Tensor, list[State]]:
        """z'_t = r_0(z_t) + sum of weight times r_S(z_t), and the states afterwards.

        Branches that no sequence wants do not run, and their states stay.
        """
        result, after = self.neutral(code, states[0])
        following = [after, *states[1:]]
        for style, branch in enumerate(self.styles):
            wanted = torch.nonzero(target[:, style])[:, 0]
            if len(wanted) == 0:
                continue
            hidden, cell = states[1 + style]
            offset, (new_hidden, new_cell) = branch(
                code[wanted], (hidden[:, wanted].contiguous(), cell[:, wanted].contiguous())
            )
            result = result.index_add(0, wanted, target[wanted, style, None, None] * offset)
            following[1 + style] = (hidden.index_copy(1, wanted, new_hidden), cell.index_copy(1, wanted, new_cell))
        return result, following

    def decode(self, code: Tensor, target: Tensor) -> tuple[Tensor, Tensor]:
        """Raw rotations ``[B, T, R]`` and velocities ``[B, T, P]``."""
        labels = target if self.shape.decoder_labels else torch.zeros_like(target)
        hidden = self.decoder(torch.cat([code, labels[:, None].expand(-1, code.shape[1], -1)], dim=2))
        return self.rotation_layer(hidden), self.velocity_layer(hidden)


@torch.no_grad()
def _carry(lstm: nn.LSTM) -> None:
    """Open input and output gates, forget soon, and turn what comes in without stretching it."""
    size = lstm.hidden_size
    for layer in range(lstm.num_layers):
        into_input, into_forget, _, into_output = lstm.get_parameter(f"bias_ih_l{layer}").chunk(4)
        into_input.add_(OPEN_GATE)
        into_output.add_(OPEN_GATE)
        into_forget.sub_(0.5 * OPEN_GATE)
        nn.init.orthogonal_(lstm.get_parameter(f"weight_ih_l{layer}")[2 * size : 3 * size])


def _branch(module: nn.Module) -> Branch:
    if not isinstance(module, Branch):
        raise TypeError(f"expected a branch, got {type(module).__name__}")
    return module


def _convolution(in_channels: int, out_channels: int, kernel: int) -> nn.Conv1d:
    return nn.Conv1d(in_channels, out_channels, kernel, padding=kernel // 2, padding_mode="replicate")


class Discriminator(nn.Module):
    """FT-Att: features over time weighted by the outer product of two attention vectors of the labels (eq. 1).

    Without attention (ablation) it has a score for each style and gives that of the wanted one.
    """

    def __init__(self, shape: Shape, n_frames: int, *, attention: bool = True, n_features: int = 16) -> None:
        super().__init__()
        self.attention = attention
        widths = [2 * shape.n_positions]
        layers: list[nn.Module] = []
        for _ in range(4):
            widths.append(widths[-1] // 3 * 2)
            layers += [_convolution(widths[-2], widths[-1], 3), nn.LeakyReLU()]
        self.features = nn.Sequential(*layers, _convolution(widths[-1], n_features, 3))
        n_labels = shape.n_styles + shape.n_contents
        self.labels = nn.Sequential(
            nn.Linear(n_labels, LABEL_WIDTH), nn.LeakyReLU(), nn.Linear(LABEL_WIDTH, LABEL_WIDTH), nn.LeakyReLU()
        )
        self.over_time = nn.Linear(LABEL_WIDTH, n_frames)
        self.over_features = nn.Linear(LABEL_WIDTH, n_features)
        self.scores = nn.Linear(n_features, 1 + shape.n_styles)

    def forward(self, motion: Tensor, style: Tensor, content: Tensor) -> Tensor:
        """Positions and velocities ``[B, T, 2P]``, labels ``[B, n_styles]``, ``[B, n_contents]``; scores ``[B]``."""
        features: Tensor = self.features(motion.transpose(1, 2))
        if not self.attention:
            neutral = 1.0 - style.sum(dim=1, keepdim=True)
            classes: Tensor = self.scores(features.mean(dim=2))
            return torch.cat([neutral, style], dim=1).mul(classes).sum(dim=1)
        labels = self.labels(torch.cat([style, content], dim=1))
        weight = self.over_features(labels)[:, :, None] * self.over_time(labels)[:, None, :]
        scores: Tensor = (features * weight).sum(dim=(1, 2))
        return scores


class ContentClassifier(nn.Module):
    """Content from rotations, positions and velocities; its feature maps are compared by the perceptual loss."""

    def __init__(self, shape: Shape) -> None:
        super().__init__()
        widths = [shape.n_motion]
        layers = []
        for _ in range(4):
            widths.append(widths[-1] // 4 * 2)
            norm = nn.InstanceNorm1d(widths[-1])
            layers.append(nn.Sequential(_convolution(widths[-2], widths[-1], 5), norm, nn.LeakyReLU()))
        self.layers = nn.ModuleList(layers)
        self.logits = _convolution(widths[-1], shape.n_contents, 5)

    def forward(self, motion: Tensor) -> tuple[Tensor, list[Tensor]]:
        """``[B, T, R + 2P]`` to logits ``[B, n_contents]`` and the feature maps of all layers."""
        maps = []
        x = motion.transpose(1, 2)
        for layer in self.layers:
            x = layer(x)
            maps.append(x)
        scores: Tensor = self.logits(x)
        return scores.mean(dim=2), maps
