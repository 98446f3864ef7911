"""The style transformer and the ways of swapping tokens (Kuriyama 2022, sections 3.4 and 4.3)."""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.methods.kuriyama2022.autoencoder import LATENT_CHANNELS
from bench.methods.kuriyama2022.tokens import WIDTH

TOKEN_CHANNELS = WIDTH * LATENT_CHANNELS
REACH = 20
"""Tokens to each side that self-attention sees: omega."""
DEVIATION_FLOOR = 1e-6


class Attention(nn.Module):
    """Scaled dot-product attention with one head; queries, keys and values keep the 64 channels and have no bias."""

    def __init__(self) -> None:
        super().__init__()
        self.queries = nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS, bias=False)
        self.keys = nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS, bias=False)
        self.values = nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS, bias=False)
        self.output = nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS)

    def forward(self, asking: Tensor, answering: Tensor, allowed: Tensor | None = None) -> Tensor:
        """``[B, N, 64]`` and ``[B, M, 64]``; ``allowed`` ``[N, M]`` says who may look where."""
        similarity = self.queries(asking) @ self.keys(answering).transpose(1, 2) / math.sqrt(TOKEN_CHANNELS)
        if allowed is not None:
            similarity = similarity.masked_fill(~allowed, -torch.inf)
        attended: Tensor = self.output(similarity.softmax(dim=-1) @ self.values(answering))
        return attended


class Mlp(nn.Sequential):
    """Two fully connected layers of 64 channels with a GELU between them."""

    def __init__(self) -> None:
        super().__init__(
            nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS), nn.GELU(), nn.Linear(TOKEN_CHANNELS, TOKEN_CHANNELS)
        )


class TransformerEncoder(nn.Module):
    """T_E: class token, positions (eq. 2), one pre-normalised layer of masked self-attention.

    Parameters
    ----------
    with_positions : False leaves the position codes out. With them the identity loss is solved by matching the i-th
        token with the i-th, whatever they show, and the style is then played as it is.
    """

    def __init__(self, with_positions: bool = True) -> None:
        super().__init__()
        self.with_positions = with_positions
        self.class_token = nn.Parameter(torch.zeros(TOKEN_CHANNELS))
        self.before_attention = nn.LayerNorm(TOKEN_CHANNELS)
        self.attention = Attention()
        self.before_mlp = nn.LayerNorm(TOKEN_CHANNELS)
        self.mlp = Mlp()

    def forward(self, tokens: Tensor) -> tuple[Tensor, Tensor]:
        """``[B, N, 64] -> class token [B, 64], encoded tokens [B, N, 64]``."""
        batch, n_tokens, _ = tokens.shape
        sequence = torch.cat([self.class_token.expand(batch, 1, -1), tokens], dim=1)
        if self.with_positions:
            sequence = sequence + positions(n_tokens + 1).to(tokens)
        normed = self.before_attention(sequence)
        sequence = sequence + self.attention(normed, normed, near(n_tokens).to(tokens.device))
        sequence = sequence + self.mlp(self.before_mlp(sequence))
        return sequence[:, 0], sequence[:, 1:]

    def keys(self, tokens: Tensor) -> Tensor:
        """k_i = m_k g_i of eq. 9: ``[B, N, 64] -> [B, N, 64]``."""
        projected: Tensor = self.attention.keys(tokens)
        return projected


class TransformerDecoder(nn.Module):
    """T_D: one layer of cross-attention from encoded content to encoded style (eq. 3)."""

    def __init__(self) -> None:
        super().__init__()
        self.before_queries = nn.LayerNorm(TOKEN_CHANNELS)
        self.before_keys = nn.LayerNorm(TOKEN_CHANNELS)
        self.attention = Attention()
        self.before_mlp = nn.LayerNorm(TOKEN_CHANNELS)
        self.mlp = Mlp()

    def forward(self, content: Tensor, style: Tensor) -> Tensor:
        """``[B, N, 64], [B, M, 64] -> [B, N, 64]``."""
        decoded = content + self.attention(self.before_queries(content), self.before_keys(style))
        refined: Tensor = decoded + self.mlp(self.before_mlp(decoded))
        return refined


class StyleTransformer(nn.Module):
    """Encoder, decoder and the similarity of their tokens."""

    def __init__(self, with_positions: bool = True) -> None:
        super().__init__()
        self.encoder = TransformerEncoder(with_positions)
        self.decoder = TransformerDecoder()

    def similarity(self, content: Tensor, style: Tensor) -> Tensor:
        """Dot products of decoded content and encoded style tokens: ``[B, N, 64], [B, M, 64] -> [B, N, M]``."""
        _, encoded_content = self.encoder(content)
        _, encoded_style = self.encoder(style)
        similarity: Tensor = self.decoder(encoded_content, encoded_style) @ encoded_style.transpose(1, 2)
        return similarity

    def soft_swap(self, content: Tensor, style: Tensor, temperature: float = 1.0) -> Tensor:
        """Every content token replaced by a blend of style tokens (eq. 4): ``[B, N, 64]``."""
        return (self.similarity(content, style) / temperature).softmax(dim=-1) @ style

    def hard_swap(self, content: Tensor, style: Tensor) -> Tensor:
        """Every content token replaced by the most similar style token (eq. 19)."""
        return _picked(style, self.similarity(content, style).argmax(dim=-1))


def avatar_net_swap(content: Tensor, style: Tensor) -> Tensor:
    """Every content token replaced by the style token of largest cosine (eq. 18): ``[B, N, 64], [B, M, 64]``.

    As printed the equation takes the largest angle; the nearest token is meant.
    """
    cosine = functional.normalize(content, dim=-1) @ functional.normalize(style, dim=-1).transpose(1, 2)
    return _picked(style, cosine.argmax(dim=-1))


def latent_adain(content: Tensor, style: Tensor) -> Tensor:
    """Latents ``[B, d, F]`` of the content with the style's mean and deviation over time (eq. 17)."""
    return restyled(whitened(content), style)


def whitened(latents: Tensor) -> Tensor:
    """Latents ``[B, d, F]`` with mean 0 and deviation 1 over time."""
    deviation, mean = torch.std_mean(latents, dim=2, keepdim=True, correction=0)
    return (latents - mean) / deviation.clamp_min(DEVIATION_FLOOR)


def restyled(latents: Tensor, style: Tensor) -> Tensor:
    """The inverse of :func:`whitened` with another clip's statistics."""
    deviation, mean = torch.std_mean(style, dim=2, keepdim=True, correction=0)
    return latents * deviation + mean


def positions(n_places: int) -> Tensor:
    """Sine and cosine position codes ``[n, 64]`` (Vaswani 2017, section 3.5)."""
    place = torch.arange(n_places, dtype=torch.float32)[:, None]
    rate = torch.exp(torch.arange(0, TOKEN_CHANNELS, 2) * (-math.log(10000.0) / TOKEN_CHANNELS))
    return torch.stack([torch.sin(place * rate), torch.cos(place * rate)], dim=-1).flatten(1)


def near(n_tokens: int) -> Tensor:
    """Who may look at whom ``[1 + N, 1 + N]``: tokens at most 20 apart; the class token sees and is seen by all."""
    place = torch.arange(n_tokens)
    allowed = torch.ones(n_tokens + 1, n_tokens + 1, dtype=torch.bool)
    allowed[1:, 1:] = (place[:, None] - place[None, :]).abs() <= REACH
    return allowed


def _picked(style: Tensor, chosen: Tensor) -> Tensor:
    """``style[b, chosen[b, n]]``: ``[B, M, 64], [B, N] -> [B, N, 64]``."""
    return style.gather(1, chosen[..., None].expand(-1, -1, style.shape[2]))
