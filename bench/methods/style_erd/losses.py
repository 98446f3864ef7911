"""Losses of Style-ERD by the equations of Tao et al. 2022, section 3.2.

The paper does not say where it sums and where it averages; here every norm is a mean over batch, frames and numbers.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

NEAR_ONE = 1.0 - 1e-6
"""The arc cosine has no slope at 1."""


def quaternion_angle(one: Tensor, other: Tensor) -> Tensor:
    """Equation 2: mean square of ``acos |r . r''|`` (half the angle between rotations), radians, ``[B, T, 4 J]``."""
    dots = (one * other).unflatten(-1, (-1, 4)).sum(dim=-1).abs()  # type: ignore[no-untyped-call]
    return torch.acos(dots.clamp(max=NEAR_ONE)).square().mean()


def squared(one: Tensor, other: Tensor) -> Tensor:
    """Mean squared difference."""
    return (one - other).square().mean()


def adversarial(fake_scores: Tensor) -> Tensor:
    """Equation 4: the generator wants scores of 0."""
    return fake_scores.square().mean()


def critic(real_scores: Tensor, fake_scores: Tensor) -> Tensor:
    """Equation 5: the discriminator wants scores of 1 for real and -1 for transferred motion."""
    return (real_scores - 1.0).square().mean() + (fake_scores + 1.0).square().mean()


def perceptual(made: Sequence[Tensor], wanted: Sequence[Tensor]) -> Tensor:
    """Equation 7: mean squared difference of feature maps, summed over the layers of the content classifier."""
    return torch.stack([squared(a, b) for a, b in zip(made, wanted, strict=True)]).sum()


def disagreement(motion: Tensor) -> Tensor:
    """Not in the paper: how far velocities are from differences of positions, ``[B, T, 2 P]`` of both.

    The decoder gives velocities beside rotations; nothing else in the losses says that they are of one motion.
    """
    positions, velocities = motion.chunk(2, dim=2)
    return squared(positions[:, 1:] - positions[:, :-1], velocities[:, 1:])
