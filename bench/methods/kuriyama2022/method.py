"""Training and transfer: the auto-encoder first, then the style transformer on its frozen latents.

Kuriyama 2022, sections 3.5 and 4.1. The latents of a style gesture are joined by those of its mirror image when motions
are transferred (section 4.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadData
from bench.methods.kuriyama2022.autoencoder import FRAMES_A_LATENT, GestureAutoencoder, restoration_loss
from bench.methods.kuriyama2022.gestures import FPS, UPPER_CHANNELS, Gesture, clip_of, gesture_of
from bench.methods.kuriyama2022.losses import LOSSES, losses_of
from bench.methods.kuriyama2022.tokens import STRIDE, latents_of, tokens_of
from bench.methods.kuriyama2022.transformer import (
    StyleTransformer,
    avatar_net_swap,
    latent_adain,
    restyled,
    whitened,
)
from bench.methods.training import Curves, FitRequest, Stateful, Trainable, seeded, train
from bench.methods.windows import at_training_rate
from bench.motion.clip import Clip
from bench.motion.edit import mirror

ORDINARY_STYLES = ("neutral", "normal")
"""Styles of gestures on the content side; where a dataset has neither, gestures of all styles are content."""
SWAPS = ("soft", "hard", "avatar-net", "adain")
WITHOUT_TRANSFORMER = ("avatar-net", "adain")
BLOCK_FRAMES = FRAMES_A_LATENT * STRIDE


@dataclass(frozen=True)
class KuriyamaConfig:
    """What is trained and how; the defaults are the paper's.

    Attributes
    ----------
    swap : how tokens or latents of the content are exchanged for the style's: one of SWAPS.
    losses : of the transformer, all with weight 1 (eq. 12).
    positions : False leaves the position codes of eq. 2 out, see :class:`TransformerEncoder`; not in the paper.
    rate : of Adam, for both networks.
    autoencoder_steps, autoencoder_batch, autoencoder_frames : 1000 epochs over 1242 s in crops of 256 frames.
    transformer_steps, transformer_batch, transformer_frames : 1000 epochs over 63 pairs in crops of 1280 frames.
    """

    swap: str = "soft"
    losses: tuple[str, ...] = LOSSES
    positions: bool = True
    rate: float = 1e-4
    autoencoder_steps: int = 9000
    autoencoder_batch: int = 32
    autoencoder_frames: int = 256
    transformer_steps: int = 8000
    transformer_batch: int = 8
    transformer_frames: int = 1280

    def at(self, budget: str) -> KuriyamaConfig:
        """The same method with less training; the networks are small enough to keep their size."""
        if budget == "smoke":
            return replace(
                self,
                rate=1e-3,
                autoencoder_steps=20,
                autoencoder_batch=8,
                transformer_steps=4,
                transformer_batch=2,
                transformer_frames=320,
            )
        if budget == "small":
            return replace(self, rate=1e-3, autoencoder_steps=1500, transformer_steps=400)
        return self

    @property
    def needs_transformer(self) -> bool:
        return self.swap not in WITHOUT_TRANSFORMER


class GestureTransfer(nn.Module):
    """Auto-encoder and style transformer with one way of swapping."""

    def __init__(self, config: KuriyamaConfig) -> None:
        super().__init__()
        self.config = config
        self.autoencoder = GestureAutoencoder()
        self.transformer = StyleTransformer(config.positions)

    def swapped(self, content: Tensor, style: Tensor) -> Tensor:
        """Latents of the output: ``[B, 16, F], [B, 16, G] -> [B, 16, F]`` with even F and G."""
        swap = self.config.swap
        if swap == "adain":
            return latent_adain(content, style)
        if swap == "avatar-net":
            tokens = avatar_net_swap(tokens_of(whitened(content)), tokens_of(whitened(style)))
            return restyled(whitened(latents_of(tokens)), style)
        exchange = self.transformer.soft_swap if swap == "soft" else self.transformer.hard_swap
        return latents_of(exchange(tokens_of(content), tokens_of(style)))

    @torch.inference_mode()
    def transfer(self, content: Clip, style: Clip) -> Clip:
        """The content's gesture in the style's style, on the content's bones and clock."""
        styles = [gesture_of(style), gesture_of(mirror(style))]
        latents = torch.cat([self.autoencoder.encoder(channels_of(one.upper)) for one in styles], dim=2)

        def answer(clip: Clip) -> Clip:
            encoded = self.autoencoder.encoder(channels_of(gesture_of(clip).upper))
            upper, lower = self.autoencoder.decode(self.swapped(encoded, latents))
            return clip_of(_frames_of(upper, clip.n_frames), _frames_of(lower, clip.n_frames), clip)

        return at_training_rate(content, answer, FPS)


def train_gestures(config: KuriyamaConfig, request: FitRequest) -> tuple[KuriyamaConfig, GestureTransfer, Curves]:
    """Train both networks on takes with style labels.

    Raises
    ------
    BadData : no takes, or takes without style labels.
    """
    gestures = _Gestures.of(request.takes, max(config.autoencoder_frames, config.transformer_frames))
    with seeded(request.seed) as generator:
        network = GestureTransfer(config)
        stages: list[tuple[Trainable, int, str]] = [
            (_AutoencoderTraining(network, gestures, generator), config.autoencoder_steps, "auto-encoder")
        ]
        if config.needs_transformer:
            stages.append((_TransformerTraining(network, gestures, generator), config.transformer_steps, "transformer"))
        curves = [
            train(stage, n_steps, progress=request.progress, name=name, checkpoints=request.checkpoints)
            for stage, n_steps, name in stages
        ]
    return config, network, Curves.one_after_the_other(curves)


@dataclass(frozen=True, eq=False)
class _Gestures:
    """Sequences ``[T, 63]`` of both sides, none shorter than a crop: upper channels first, then the legs'."""

    content: tuple[Tensor, ...]
    style: tuple[Tensor, ...]

    @classmethod
    def of(cls, takes: Sequence[Take], least_frames: int) -> _Gestures:
        styles = sorted({take.style for take in takes if take.style is not None})
        if not styles or any(take.style is None for take in takes):
            raise BadData("gestures are learned from takes with style labels", where="takes")
        ordinary = [style for style in styles if style in ORDINARY_STYLES] or styles
        expressive = [style for style in styles if style not in ORDINARY_STYLES] or styles
        by_style = {
            style: _joined([gesture_of(take.clip) for take in takes if take.style == style], least_frames)
            for style in styles
        }
        return cls(*(tuple(s for style in side for s in by_style[style]) for side in (ordinary, expressive)))


def _joined(gestures: Sequence[Gesture], least_frames: int) -> list[Tensor]:
    """Short gestures of one style one after the other, until a sequence is long enough to be cropped."""
    sequences, waiting, n_frames = [], [], 0
    for gesture in gestures:
        waiting.append(np.concatenate([gesture.upper, gesture.lower], axis=1))
        n_frames += len(gesture.upper)
        if n_frames >= least_frames:
            sequences.append(np.concatenate(waiting))
            waiting, n_frames = [], 0
    if waiting and sequences:
        sequences[-1] = np.concatenate([sequences[-1], *waiting])
    elif waiting:
        repeats = -(-least_frames // n_frames)
        sequences.append(np.concatenate(waiting * repeats))
    return [torch.from_numpy(sequence.astype(np.float32)) for sequence in sequences]


class _AutoencoderTraining(Trainable):
    """Crops of all gestures, restored."""

    def __init__(self, network: GestureTransfer, gestures: _Gestures, generator: torch.Generator) -> None:
        self.network = network.autoencoder
        self.config = network.config
        self.sequences = (*gestures.content, *gestures.style)
        self.generator = generator
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=self.config.rate)

    def step(self, index: int) -> Mapping[str, Tensor]:
        crops = _crops(self.sequences, self.config.autoencoder_batch, self.config.autoencoder_frames, self.generator)
        upper, lower = crops[:, :UPPER_CHANNELS], crops[:, UPPER_CHANNELS:]
        restored_upper, restored_lower = self.network(upper)
        loss = restoration_loss(restored_upper, restored_lower, upper, lower)
        _descend(self.optimiser, loss)
        return {"restoration": loss}

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser}


class _TransformerTraining(Trainable):
    """Pairs of an ordinary and an expressive gesture, neither aligned nor of one scenario; the auto-encoder rests."""

    def __init__(self, network: GestureTransfer, gestures: _Gestures, generator: torch.Generator) -> None:
        self.network = network
        self.config = network.config
        self.gestures = gestures
        self.generator = generator
        self.optimiser = torch.optim.Adam(network.transformer.parameters(), lr=self.config.rate)

    def step(self, index: int) -> Mapping[str, Tensor]:
        content, style = (self._tokens(side) for side in (self.gestures.content, self.gestures.style))
        losses = losses_of(self.network.transformer, content, style, self.config.losses)
        _descend(self.optimiser, torch.stack(list(losses.values())).sum())
        return losses

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network.transformer, "optimiser": self.optimiser}

    @torch.no_grad()
    def _tokens(self, sequences: Sequence[Tensor]) -> Tensor:
        crops = _crops(sequences, self.config.transformer_batch, self.config.transformer_frames, self.generator)
        return tokens_of(self.network.autoencoder.encoder(crops[:, :UPPER_CHANNELS]))


def channels_of(upper: FloatArray) -> Tensor:
    """``[T, 39] -> [1, 39, 8 n]``: the last frame held until tokens fit."""
    missing = -len(upper) % BLOCK_FRAMES
    padded = np.concatenate([upper, np.repeat(upper[-1:], missing, axis=0)]).astype(np.float32)
    return torch.from_numpy(padded.T[None].copy())


def _frames_of(channels: Tensor, n_frames: int) -> FloatArray:
    return channels[0, :, :n_frames].T.numpy().astype(np.float64)


def _crops(sequences: Sequence[Tensor], n: int, n_frames: int, generator: torch.Generator) -> Tensor:
    """``[n, channels, n_frames]`` cut at even chance from sequences ``[T, channels]``."""
    crops = []
    for row in torch.randint(len(sequences), (n,), generator=generator).tolist():
        sequence = sequences[row]
        start = int(torch.randint(len(sequence) - n_frames + 1, (1,), generator=generator))
        crops.append(sequence[start : start + n_frames].T)
    return torch.stack(crops)


def _descend(optimiser: torch.optim.Optimizer, loss: Tensor) -> None:
    optimiser.zero_grad(set_to_none=True)
    loss.backward()  # type: ignore[no-untyped-call]
    optimiser.step()
