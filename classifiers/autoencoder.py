"""Denoising auto-encoder whose bottleneck Style-ERD 2022 takes Frechet distances in (appendix; released code).

Three convolutions over time take 24 frames of local quaternions to one vector of 512: 24 -> 6 -> 2 -> 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from classifiers.data import mean_rotations, one_hemisphere


@dataclass(frozen=True)
class AutoencoderConfig:
    """The network.

    Attributes
    ----------
    n_joints : joints of the skeleton; input channels are four times as many.
    n_frames : 24, the only length the layers fit.
    widths : channels of the three layers; the last is the length of the feature.
    n_components : leading principal components kept beside the encoder.
    """

    n_joints: int = 21
    n_frames: int = 24
    widths: tuple[int, int, int] = (128, 256, 512)
    n_components: int = 32

    @property
    def input_shape(self) -> tuple[int, int, int]:
        """Frames, joints, channels of one sample."""
        return self.n_frames, self.n_joints, 4


class Encoder(nn.Module):
    """``[B, 24, V, 4]`` local quaternions w, x, y, z to ``[B, 512]``; their signs are settled here.

    Attributes
    ----------
    reference_wxyz : ``[V, 4]`` mean rotation of each joint in the judge part.
    mean : ``[512]`` mean feature of the judge part; components: ``[32, 512]`` its leading principal directions.
    """

    reference_wxyz: Tensor
    mean: Tensor
    components: Tensor

    def __init__(self, config: AutoencoderConfig) -> None:
        super().__init__()
        self.config = config
        narrow, middle, wide = config.widths
        self.register_buffer("reference_wxyz", torch.zeros(config.n_joints, 4))
        self.register_buffer("mean", torch.zeros(wide))
        self.register_buffer("components", torch.zeros(config.n_components, wide))
        self.layers = nn.Sequential(
            nn.Conv1d(4 * config.n_joints, narrow, 4, stride=4), nn.BatchNorm1d(narrow), nn.ReLU(),
            nn.Conv1d(narrow, middle, 3, dilation=2), nn.BatchNorm1d(middle), nn.ReLU(),
            nn.Conv1d(middle, wide, 2), nn.BatchNorm1d(wide), nn.ReLU(),
        )  # fmt: skip

    @property
    def n_parameters(self) -> int:
        """Learned numbers."""
        return sum(parameter.numel() for parameter in self.parameters())

    def settle_signs(self, rotations_wxyz: Tensor) -> Tensor:
        return one_hemisphere(rotations_wxyz, self.reference_wxyz)

    def fit_reference(self, rotations_wxyz: Tensor) -> None:
        """Take each joint's mean rotation from ``[n, T, V, 4]``."""
        self.reference_wxyz.copy_(mean_rotations(rotations_wxyz))

    def fit_components(self, features: Tensor) -> None:
        """Take mean and leading principal directions from ``[n, 512]``; each direction's largest entry is positive."""
        exact = features.double()
        self.mean.copy_(exact.mean(dim=0))
        directions = torch.linalg.svd(exact - exact.mean(dim=0), full_matrices=False)[2][: self.config.n_components]
        largest = directions.gather(1, directions.abs().argmax(dim=1, keepdim=True))
        self.components.copy_(directions * largest.sign())

    def project(self, features: Tensor) -> Tensor:
        """``[n, 512]`` to its principal components ``[n, 32]``."""
        return (features - self.mean) @ self.components.T

    def forward(self, rotations_wxyz: Tensor) -> Tensor:
        settled = self.settle_signs(rotations_wxyz)
        result: Tensor = self.layers(settled.flatten(start_dim=2).transpose(1, 2)).squeeze(-1)
        return result


class Autoencoder(nn.Module):
    """Encoder and its mirror image; only the encoder is kept after training."""

    def __init__(self, config: AutoencoderConfig) -> None:
        super().__init__()
        self.config = config
        self.encoder = Encoder(config)
        narrow, middle, wide = config.widths
        self.decoder = nn.Sequential(
            nn.ConvTranspose1d(wide, middle, 2), nn.BatchNorm1d(middle), nn.ReLU(),
            nn.ConvTranspose1d(middle, narrow, 3, dilation=2), nn.BatchNorm1d(narrow), nn.ReLU(),
            nn.ConvTranspose1d(narrow, 4 * config.n_joints, 4, stride=4),
        )  # fmt: skip

    def forward(self, rotations_wxyz: Tensor) -> Tensor:
        """Reconstruction ``[B, 24, V, 4]``, unit quaternions."""
        decoded: Tensor = self.decoder(self.encoder(rotations_wxyz).unsqueeze(-1))
        raw = decoded.view(len(decoded), self.config.n_joints, 4, self.config.n_frames).permute(0, 3, 1, 2)
        return raw * raw.square().sum(dim=-1, keepdim=True).clamp_min(1e-12).rsqrt()


def squared_half_angles(left_wxyz: Tensor, right_wxyz: Tensor) -> Tensor:
    """``arccos(|q . q'|)**2`` of unit quaternions ``[..., 4] -> [...]`` (Style-ERD 2022, appendix A).

    Written with the chord, ``2 arcsin(|q - q'| / 2)``: value and gradient stay exact near 0, where arccos has none.
    """
    dots = (left_wxyz * right_wxyz).sum(dim=-1, keepdim=True)
    nearer = torch.where(dots < 0.0, -right_wxyz, right_wxyz)
    half_chord = ((left_wxyz - nearer).square().sum(dim=-1) / 4.0).clamp_min(1e-12).sqrt()
    return (2.0 * torch.arcsin(half_chord)).square()
