"""What every judge does to its input first: one hemisphere for rotations, zero mean and unit deviation.

The numbers come from the judge part only and travel inside the checkpoint as buffers of the network.
"""

from __future__ import annotations

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

DEVIATION_FLOOR = 0.02
"""Smallest deviation divided by: 2 % of the stature, or 2 degrees, so that nearly still channels are not blown up."""


class BadArray(ValueError):
    """An array of features has the wrong shape or is not finite."""


def checked_features(features: NDArray[np.floating], shape: tuple[int, ...]) -> Tensor:
    """Features ``[n, *shape]`` as a float32 tensor.

    Raises
    ------
    BadArray : another shape, no samples, NaN or Inf.
    """
    array = np.asarray(features)
    if array.ndim != len(shape) + 1 or array.shape[0] == 0 or array.shape[1:] != shape:
        raise BadArray(f"features must have shape [n, {', '.join(map(str, shape))}], got {list(array.shape)}")
    if not np.isfinite(array).all():
        raise BadArray(f"features must be finite, got {int((~np.isfinite(array)).sum())} NaN or Inf")
    # a copy: torch warns about arrays that may not be written to
    return torch.from_numpy(np.array(array, dtype=np.float32, order="C"))


def checked_labels(labels: NDArray[np.integer], n_samples: int, n_classes: int) -> Tensor:
    """Class indices ``[n]`` as an int64 tensor.

    Raises
    ------
    BadArray : another length, an index outside 0 to ``n_classes - 1``, or a class without any sample.
    """
    array = np.asarray(labels)
    if array.shape != (n_samples,) or not np.issubdtype(array.dtype, np.integer):
        raise BadArray(f"labels must be {n_samples} integers, got shape {list(array.shape)} of {array.dtype}")
    present = set(np.unique(array).tolist())
    if present != set(range(n_classes)):
        raise BadArray(f"labels must cover the classes 0 to {n_classes - 1}, got {sorted(present)}")
    return torch.as_tensor(array.astype(np.int64))


def mean_rotations(rotations_wxyz: Tensor) -> Tensor:
    """Mean rotation of each joint, ``[..., V, 4] -> [V, 4]``; independent of signs (Markley et al. 2007)."""
    flat = rotations_wxyz.reshape(-1, *rotations_wxyz.shape[-2:]).double()
    scatter = torch.einsum("nvi,nvj->vij", flat, flat)
    mean = torch.linalg.eigh(scatter)[1][..., -1]
    return torch.where(mean[:, :1] < 0.0, -mean, mean).float()


def one_hemisphere(rotations_wxyz: Tensor, reference_wxyz: Tensor) -> Tensor:
    """Signs of ``[..., V, 4]`` flipped into the hemisphere of ``reference_wxyz`` ``[V, 4]``."""
    dots = (rotations_wxyz * reference_wxyz).sum(dim=-1, keepdim=True)
    return torch.where(dots < 0.0, -rotations_wxyz, rotations_wxyz)


class Standardise(nn.Module):
    """``[B, T, V, C] -> [B, T, V, C]``; the last four channels are a quaternion w, x, y, z.

    Attributes
    ----------
    reference_wxyz : ``[V, 4]`` mean rotation of each joint.
    mean, deviation : ``[V, C]`` over samples and frames, after the signs are settled; deviation has a floor.
    """

    reference_wxyz: Tensor
    mean: Tensor
    deviation: Tensor

    def __init__(self, n_joints: int, channels: int) -> None:
        super().__init__()
        self.register_buffer("reference_wxyz", torch.zeros(n_joints, 4))
        self.register_buffer("mean", torch.zeros(n_joints, channels))
        self.register_buffer("deviation", torch.ones(n_joints, channels))

    def fit(self, features: Tensor) -> None:
        """Take references, means and deviations from ``[n, T, V, C]``."""
        self.reference_wxyz.copy_(mean_rotations(features[..., -4:]))
        settled = self.settle_signs(features).double()
        self.mean.copy_(settled.mean(dim=(0, 1)))
        self.deviation.copy_(settled.std(dim=(0, 1), correction=0).clamp_min(DEVIATION_FLOOR))

    def settle_signs(self, features: Tensor) -> Tensor:
        rotations = one_hemisphere(features[..., -4:], self.reference_wxyz)
        return torch.cat([features[..., :-4], rotations], dim=-1)

    def forward(self, features: Tensor) -> Tensor:
        return (self.settle_signs(features) - self.mean) / self.deviation


class StandardisePositions(nn.Module):
    """``[B, T, V, 3] -> [B, T, V, 3]``: joint positions, without signs to settle.

    Attributes
    ----------
    mean, deviation : ``[V, 3]`` over samples and frames; deviation has a floor.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, n_joints: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(n_joints, 3))
        self.register_buffer("deviation", torch.ones(n_joints, 3))

    def fit(self, positions: Tensor) -> None:
        """Take means and deviations from ``[n, T, V, 3]``."""
        exact = positions.double()
        self.mean.copy_(exact.mean(dim=(0, 1)))
        self.deviation.copy_(exact.std(dim=(0, 1), correction=0).clamp_min(DEVIATION_FLOOR))

    def forward(self, positions: Tensor) -> Tensor:
        return (positions - self.mean) / self.deviation
