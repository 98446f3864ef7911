"""Losses of Aberman et al. 2020 that are more than a mean of differences (section 4.4 and the released code)."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional


def quaternion_norm(raw: Tensor) -> Tensor:
    """Mean squared distance of the lengths of decoded rotations ``[..., 4]`` from 1."""
    length: Tensor = torch.linalg.vector_norm(raw, dim=-1)
    return (length - 1.0).square().mean()


def twist(rotation: Tensor, limit_rad: float) -> Tensor:
    """Mean squared excess of each joint's turn about its y axis over a limit; the root may turn.

    The angle is the y angle of the y-z-x Euler decomposition.

    Parameters
    ----------
    rotation : ``[..., J, 4]`` unit quaternions.
    """
    w, x, y, z = rotation[..., 1:, :].unbind(-1)
    angle = torch.atan2(2.0 * (y * w - x * z), x * x - y * y - z * z + w * w)
    return functional.relu(angle.abs() - limit_rad).square().mean()


def feature_distance(features: Tensor, wanted: Tensor) -> Tensor:
    """L1 between discriminator features averaged over time, ``[B, C, T]`` each."""
    return (features.mean(dim=2) - wanted.mean(dim=2)).abs().mean()


def with_differences(motion: Tensor) -> Tensor:
    """What the discriminator reads of ``[B, C, T]``: the first frame, then the change from frame to frame."""
    return torch.cat([motion[..., :1], motion[..., 1:] - motion[..., :-1]], dim=-1)
