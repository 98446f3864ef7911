"""The four losses of the style transformer (Kuriyama 2022, section 3.5, eq. 5-12)."""

from __future__ import annotations

from collections.abc import Collection

import torch
from torch import Tensor
from torch.nn import functional

from bench.methods.kuriyama2022.transformer import StyleTransformer

LOSSES = ("identity", "cyclic", "structure", "appearance")


def losses_of(
    transformer: StyleTransformer, content: Tensor, style: Tensor, wanted: Collection[str]
) -> dict[str, Tensor]:
    """The losses named in ``wanted`` for a batch of content and style tokens ``[B, N, 64]``, ``[B, M, 64]``."""
    swapped = transformer.soft_swap(content, style)
    found = {}
    if "identity" in wanted:
        found["identity"] = identity_loss(transformer, content, style)
    if "cyclic" in wanted:
        found["cyclic"] = token_distance(transformer.soft_swap(swapped, content), content)
    if "structure" in wanted:
        found["structure"] = structure_loss(transformer, content, swapped)
    if "appearance" in wanted:
        found["appearance"] = appearance_loss(transformer, style, swapped)
    return found


def identity_loss(transformer: StyleTransformer, content: Tensor, style: Tensor) -> Tensor:
    """Eq. 5: a gesture swapped with itself is itself."""
    return token_distance(transformer.soft_swap(content, content), content) + token_distance(
        transformer.soft_swap(style, style), style
    )


def structure_loss(transformer: StyleTransformer, content: Tensor, swapped: Tensor) -> Tensor:
    """Eq. 10: Frobenius norm of the difference of self-similarities, mean over the batch."""
    difference = self_similarity(transformer.encoder.keys(content)) - self_similarity(transformer.encoder.keys(swapped))
    distance: Tensor = torch.linalg.matrix_norm(difference).mean()
    return distance


def appearance_loss(transformer: StyleTransformer, style: Tensor, swapped: Tensor) -> Tensor:
    """Eq. 11: distance of the class tokens of style and output, mean over the batch."""
    style_class, _ = transformer.encoder(style)
    swapped_class, _ = transformer.encoder(swapped)
    distance: Tensor = torch.linalg.vector_norm(style_class - swapped_class, dim=-1).mean()
    return distance


def self_similarity(keys: Tensor) -> Tensor:
    """Cosines of all pairs of keys (eq. 9): ``[B, N, 64] -> [B, N, N]``."""
    unit = functional.normalize(keys, dim=-1)
    return unit @ unit.transpose(1, 2)


def token_distance(first: Tensor, second: Tensor) -> Tensor:
    """L2 norm of the difference of tokens ``[B, N, 64]``, mean over tokens: the norm written with tau in eq. 5-6."""
    distance: Tensor = torch.linalg.vector_norm(first - second, dim=-1).mean()
    return distance
