"""Park 2021, section 6.2: the terms of the full loss (equation 12). Motions are ``[B, 7, T, 21]``."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional


def adversarial_of_discriminator(real: Tensor, fake: Tensor) -> Tensor:
    """Equation 7, which D maximises, with its sign turned, on logits ``[B]``: ``-log D(m) - log(1 - D(m_hat))``."""
    return functional.softplus(-real).mean() + functional.softplus(fake).mean()


def adversarial_of_stylizer(fake: Tensor) -> Tensor:
    """``-log D(m_hat)``, the form of equation 7's second term whose gradient does not vanish (as released)."""
    return functional.softplus(-fake).mean()


def motion_distance(motion: Tensor, other: Tensor) -> Tensor:
    """Norms of equations 8 and 9, as released: Euclidean over joints, mean over samples, channels and frames."""
    norms: Tensor = torch.linalg.vector_norm(motion - other, dim=3)
    return norms.mean()


def style_distance(code: Tensor, found: Tensor) -> Tensor:
    """Equation 10: mean absolute difference of style codes ``[B, style_dim]``."""
    return (code - found).abs().mean()


def diversity(motion: Tensor, other: Tensor) -> Tensor:
    """Equation 11, to be maximised: mean absolute difference; no gradient through ``other`` (as released)."""
    return (motion - other.detach()).abs().mean()
