"""The gesture auto-encoder: upper body in, upper and lower body out, a quarter of the frames in between.

Kuriyama 2022, section 3.2 and appendix A: 10,288 + 10,311 + 3,144 = 23,743 parameters.
"""

from __future__ import annotations

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.kuriyama2022.gestures import LOWER_CHANNELS, UPPER_CHANNELS

LATENT_CHANNELS = 16
FRAMES_A_LATENT = 4


class Encoder(nn.Module):
    """``[B, 39, T] -> [B, 16, T / 4]``: kernel 1, then twice kernel 3 with stride 2, GELU after each."""

    def __init__(self) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            nn.Conv1d(UPPER_CHANNELS, 64, 1),
            nn.GELU(),
            nn.Conv1d(64, 32, 3, stride=2, padding=1),
            nn.GELU(),
            nn.Conv1d(32, LATENT_CHANNELS, 3, stride=2, padding=1),
            nn.GELU(),
        )

    def forward(self, upper: Tensor) -> Tensor:
        encoded: Tensor = self.layers(upper)
        return encoded


class Decoder(nn.Module):
    """``[B, 16, F] -> [B, channels, 4 F]``: linear up-sampling by 2 before the first and the second layer."""

    def __init__(self, widths: tuple[int, int], channels: int) -> None:
        super().__init__()
        self.first = nn.ConvTranspose1d(LATENT_CHANNELS, widths[0], 3, padding=1)
        self.second = nn.ConvTranspose1d(widths[0], widths[1], 3, padding=1)
        self.last = nn.ConvTranspose1d(widths[1], channels, 1)

    def forward(self, latents: Tensor) -> Tensor:
        hidden = functional.gelu(self.first(_upsampled(latents)))
        hidden = functional.gelu(self.second(_upsampled(hidden)))
        decoded: Tensor = self.last(hidden)
        return decoded


class GestureAutoencoder(nn.Module):
    """One encoder and the decoders of the two halves of the body."""

    def __init__(self) -> None:
        super().__init__()
        self.encoder = Encoder()
        self.upper_decoder = Decoder((32, 64), UPPER_CHANNELS)
        self.lower_decoder = Decoder((16, 32), LOWER_CHANNELS)

    def forward(self, upper: Tensor) -> tuple[Tensor, Tensor]:
        """``[B, 39, T] -> [B, 39, T], [B, 24, T]`` with T a multiple of 4."""
        return self.decode(self.encoder(upper))

    def decode(self, latents: Tensor) -> tuple[Tensor, Tensor]:
        """``[B, 16, F] -> [B, 39, 4 F], [B, 24, 4 F]``."""
        return self.upper_decoder(latents), self.lower_decoder(latents)


def restoration_loss(upper: Tensor, lower: Tensor, true_upper: Tensor, true_lower: Tensor) -> Tensor:
    """Mean over frames and joints of the squared angle in rad² between restored and true rotations (section 3.5).

    All ``[B, 3 J, T]`` logarithmic maps.
    """
    restored, true = torch.cat([upper, lower], dim=1), torch.cat([true_upper, true_lower], dim=1)
    return squared_angles(_as_vectors(restored), _as_vectors(true)).mean()


def squared_angles(first: Tensor, second: Tensor) -> Tensor:
    """Squared angle between rotations given as rotation vectors ``[..., 3]``, smooth also where they are equal."""
    first_w, first_xyz = _quaternion(first)
    second_w, second_xyz = _quaternion(second)
    w = first_w * second_w + (first_xyz * second_xyz).sum(dim=-1)
    xyz = first_w[..., None] * second_xyz - second_w[..., None] * first_xyz - torch.linalg.cross(first_xyz, second_xyz)
    sine = torch.sqrt(xyz.square().sum(dim=-1) + 1e-12)
    return (2.0 * torch.atan2(sine, w.abs())).square()


def _quaternion(vectors: Tensor) -> tuple[Tensor, Tensor]:
    """Scalar ``[...]`` and vector part ``[..., 3]`` of the rotations."""
    half = torch.sqrt(vectors.square().sum(dim=-1) + 1e-12) / 2.0
    return torch.cos(half), vectors * (torch.sinc(half / torch.pi) / 2.0)[..., None]


def _as_vectors(channels: Tensor) -> Tensor:
    """``[B, 3 J, T] -> [B, T, J, 3]``."""
    batch, _, n_frames = channels.shape
    return channels.transpose(1, 2).reshape(batch, n_frames, -1, 3)


def _upsampled(signal: Tensor) -> Tensor:
    upsampled: Tensor = functional.interpolate(signal, scale_factor=2.0, mode="linear", align_corners=False)
    return upsampled
