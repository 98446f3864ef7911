"""Gesture tokens: four successive latents each, half overlapping, and their merging (Kuriyama 2022, section 3.3)."""

from __future__ import annotations

import torch
from torch import Tensor

WIDTH = 4
STRIDE = WIDTH // 2


def tokens_of(latents: Tensor) -> Tensor:
    """Latents ``[B, d, F]`` as tokens ``[B, F / 2, 4 d]`` (eq. 1), F even; the last token repeats the last latent.

    Channels of one latent stay together: token = latent 1, latent 2, ...
    """
    padded = torch.cat([latents, latents[..., -1:].expand(-1, -1, WIDTH - STRIDE)], dim=2)
    windows = padded.unfold(2, WIDTH, STRIDE)  # [B, d, N, 4]
    return windows.permute(0, 2, 3, 1).flatten(2)


def latents_of(tokens: Tensor) -> Tensor:
    """Tokens ``[B, N, 4 d]`` merged into latents ``[B, d, 2 N]``: linear cross-fade where two overlap."""
    batch, n_tokens, _ = tokens.shape
    halves = tokens.reshape(batch, n_tokens, 2, STRIDE, -1)  # [B, N, half, 2, d]
    own, earlier = halves[:, :, 0], halves[:, :, 1].roll(1, dims=1)
    rising = (torch.arange(STRIDE, device=tokens.device) + 0.5) / STRIDE
    weight = rising.expand(n_tokens, STRIDE).clone()
    weight[0] = 1.0
    merged = torch.lerp(earlier, own, weight[None, :, :, None])
    return merged.flatten(1, 2).transpose(1, 2)
