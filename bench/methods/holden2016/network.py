"""The one-layer convolutional autoencoder of Holden et al. 2016 and its training loss.

Features of a motion are ``[B, 73, T]``, standardised; hidden units ``[B, width, T / 2]``.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.windows import Standardise
from bench.motion.holden_features import HOLDEN_SLICES, N_FEATURES

FOOT_CHANNELS = [*range(12, 18), *range(24, 30)]
"""Positions of feet and toes, which the released code weighs a little more than others."""
EMPHASIS = 0.9


class MotionAutoencoder(nn.Module):
    """``encode`` is the paper's Phi, ``decode`` its inverse.

    Parameters
    ----------
    width : hidden units, 256 in the paper.
    kernel : frames of each filter, odd.
    dropout : share of inputs and of hidden units that are zeroed in training.
    """

    def __init__(self, width: int, kernel: int, dropout: float) -> None:
        super().__init__()
        self.standardise = Standardise(N_FEATURES)
        self.encoder = nn.Conv1d(N_FEATURES, width, kernel, padding=kernel // 2)
        self.decoder = nn.Conv1d(width, N_FEATURES, kernel, padding=kernel // 2)
        self.dropout = dropout
        for conv in (self.encoder, self.decoder):
            nn.init.xavier_uniform_(conv.weight)
            nn.init.zeros_(torch.as_tensor(conv.bias))

    def encode(self, motion: Tensor) -> Tensor:
        """``[B, 73, T] -> [B, width, T // 2]``: the larger of two neighbouring frames of the rectified filters."""
        return functional.max_pool1d(functional.relu(self.encoder(motion)), 2)

    def decode(self, hidden: Tensor) -> Tensor:
        """``[B, width, T / 2] -> [B, 73, T]``: what ``decode_randomly`` gives on average."""
        result: Tensor = self.decoder(0.5 * hidden.repeat_interleave(2, dim=2))
        return result

    def decode_randomly(self, hidden: Tensor, generator: torch.Generator) -> Tensor:
        """As in training: each hidden unit goes to one of its two frames, the other is zero."""
        first = (torch.rand(hidden.shape, generator=generator) < 0.5).to(hidden)
        spread = torch.stack([first * hidden, (1.0 - first) * hidden], dim=-1).flatten(2)  # [B, width, T]
        result: Tensor = self.decoder(functional.dropout(spread, self.dropout, self.training))
        return result

    def forward(self, motion: Tensor, generator: torch.Generator) -> Tensor:
        """The motion denoised, as in training."""
        noisy = functional.dropout(motion, self.dropout, self.training)
        return self.decode_randomly(self.encode(noisy), generator)

    @torch.no_grad()
    def fit_standardise(self, features: Tensor) -> None:
        """Mean of each channel and one deviation for all positions, from windows ``[n, T, 73]``.

        As the released code has it: velocities keep their zero, contacts are centred at a half, and channels with a
        smaller deviation than their own weigh more.
        """
        velocity, turn, contacts = (HOLDEN_SLICES[name] for name in ("velocity_xz", "yaw_velocity", "contacts"))
        mean, deviation = self.standardise.mean, self.standardise.deviation
        mean.copy_(features.mean(dim=(0, 1)))
        mean[velocity], mean[turn], mean[contacts] = 0.0, 0.0, 0.5
        deviation.fill_(features.std())
        deviation[FOOT_CHANNELS] *= EMPHASIS
        deviation[velocity] = EMPHASIS * features[..., velocity].std().clamp_min(1e-4)
        deviation[turn] = EMPHASIS * features[..., turn].std().clamp_min(1e-4)
        deviation[contacts] = 0.5


def reconstruction_loss(output: Tensor, motion: Tensor) -> Tensor:
    """Mean squared error."""
    return functional.mse_loss(output, motion)


def sparsity_loss(network: MotionAutoencoder) -> Tensor:
    """Mean absolute filter weight of both layers."""
    return network.encoder.weight.abs().mean() + network.decoder.weight.abs().mean()
