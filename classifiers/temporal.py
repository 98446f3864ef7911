"""The second family of judges: a convolution over time on joint positions alone.

It shares nothing with the ST-GCN but the windows: no graph, no rotations, every frame read, all joints mixed in the
first layer. Numbers on which both families agree do not hang on one network's habits.
"""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor, nn
from torch.nn import functional

from classifiers.data import StandardisePositions


@dataclass(frozen=True)
class TemporalConfig:
    """The network.

    Attributes
    ----------
    n_joints : joints of a frame, three coordinates each.
    n_classes : outputs.
    n_frames : frames of a window.
    widths : output channels of the blocks; the last is the length of the feature.
    strides : step over time of each block.
    temporal_kernel : frames, odd.
    """

    n_joints: int
    n_classes: int
    n_frames: int = 64
    widths: tuple[int, ...] = (48, 64, 64)
    strides: tuple[int, ...] = (2, 2, 1)
    temporal_kernel: int = 5

    @property
    def input_shape(self) -> tuple[int, int, int]:
        """Frames, joints, coordinates of one sample."""
        return self.n_frames, self.n_joints, 3


class Temporal(nn.Module):
    """Input ``[B, T, V, 3]`` as :func:`checked_features` gives it; standardisation is part of the network."""

    def __init__(self, config: TemporalConfig) -> None:
        super().__init__()
        self.config = config
        self.standardise = StandardisePositions(config.n_joints)
        inputs = (3 * config.n_joints, *config.widths)
        self.blocks = nn.Sequential(
            *(
                _Block(n_in, n_out, config.temporal_kernel, stride)
                for n_in, n_out, stride in zip(inputs, config.widths, config.strides, strict=False)
            )
        )
        self.last = nn.Linear(config.widths[-1], config.n_classes)

    @property
    def n_parameters(self) -> int:
        """Learned numbers."""
        return sum(parameter.numel() for parameter in self.parameters())

    def features(self, windows: Tensor) -> Tensor:
        """Mean over time before the last layer, ``[B, widths[-1]]``."""
        standard: Tensor = self.standardise(windows)
        deep: Tensor = self.blocks(standard.flatten(start_dim=2).transpose(1, 2))
        return deep.mean(dim=2)

    def logits(self, features: Tensor) -> Tensor:
        """``[B, widths[-1]] -> [B, n_classes]``."""
        result: Tensor = self.last(features)
        return result

    def forward(self, windows: Tensor) -> Tensor:
        return self.logits(self.features(windows))


class _Block(nn.Module):
    """Convolution, normalisation, ReLU; carried past where the shapes allow it."""

    def __init__(self, n_in: int, n_out: int, kernel: int, stride: int) -> None:
        super().__init__()
        self.conv = nn.Conv1d(n_in, n_out, kernel, stride, padding=kernel // 2)
        self.norm = nn.BatchNorm1d(n_out)
        self.carries = n_in == n_out and stride == 1

    def forward(self, x: Tensor) -> Tensor:
        deeper: Tensor = self.norm(self.conv(x))
        return functional.relu(deeper + x if self.carries else deeper)
