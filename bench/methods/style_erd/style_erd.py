"""Tao et al. 2022, Style-ERD: Responsive and Coherent Online Motion Style Transfer (CVPR).

One frame in, one frame out: an encoder takes the style out, recurrent branches put the wanted one in, a decoder gives
rotations. Content and style labels throughout; pairs go from neutral to the other styles and from those to neutral.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.methods import rotations
from bench.methods.layers import Average, gradient_penalty
from bench.methods.style_erd import losses as equations
from bench.methods.style_erd.frames import N_POSITIONS, N_ROTATIONS, UNIT_M, FrameReader, Frames
from bench.methods.style_erd.network import ContentClassifier, Discriminator, Shape, StyleErd
from bench.methods.style_erd.supervision import Supervision, seen_columns
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import Draws, Standardise, Windows, cut_windows
from bench.motion.clip import Clip
from bench.motion.skeleton import N_JOINTS
from classifiers.data import mean_rotations

NEUTRAL_STYLES = ("neutral", "normal")
ROOT = slice(N_ROTATIONS, N_ROTATIONS + 3)
SEEN = slice(N_ROTATIONS + 3, N_ROTATIONS + 5)
POSITION_START, VELOCITY_START = N_ROTATIONS, N_ROTATIONS + N_POSITIONS
CRITIC_INPUT = slice(N_ROTATIONS, None)
GRADIENT_CLIP = 5.0


@dataclass(frozen=True)
class StyleErdConfig:
    """Everything that decides a training; the defaults are the paper's.

    Attributes
    ----------
    styles, contents, neutral : labels, known once there are takes; ``styles`` without the neutral one.
    learned_states, attention : off in two ablations.
    decoder_labels : off in the released code.
    rotation, position, velocity : weights within the reconstruction loss (eq. 3).
    adversarial, perceptual, penalty : weights of losses; 0 leaves a loss out.
    penalty_of_mean : as the released code: the gradient penalty is taken of the mean score of a batch, which divides
        it by the square of the batch.
    agreement : not in the paper: weight of the difference between decoded velocities and those of the positions.
    withheld : share of sources whose style label the encoder does not get in training: a stream has none.
    neutral_share : of the sources; every other one is transferred to neutral.
    decay : of the averaged weights; 0 keeps the last ones.
    carrying_start : not in the paper: the recurrent layers start as ones that pass on what they get.
    any_pairs, residual, content_class, style_class : not in the paper, see ``style_erd-content``.
    """

    styles: tuple[str, ...] = ()
    contents: tuple[str, ...] = ()
    neutral: str = ""
    hidden: int = 32
    neutral_layers: int = 6
    style_layers: int = 4
    learned_states: bool = True
    attention: bool = True
    decoder_labels: bool = True
    n_frames: int = 24
    stride: int = 4
    n_steps: int = 190_000
    batch: int = 16
    rate: float = 1e-4
    discriminator_rate: float = 5e-5
    rotation: float = 1.0
    position: float = 0.5
    velocity: float = 1.0
    adversarial: float = 1.0
    perceptual: float = 0.1
    penalty: float = 128.0
    penalty_of_mean: bool = False
    agreement: float = 0.0
    classifier_steps: int = 4000
    withheld: float = 0.5
    neutral_share: float = 0.5
    decay: float = 0.0
    carrying_start: bool = False
    any_pairs: bool = False
    residual: bool = False
    content_class: float = 0.0
    style_class: float = 0.0

    @property
    def shape(self) -> Shape:
        return Shape(
            N_ROTATIONS,
            N_POSITIONS,
            len(self.styles),
            len(self.contents),
            self.hidden,
            self.neutral_layers,
            self.style_layers,
            self.learned_states,
            self.decoder_labels,
            carrying_start=self.carrying_start,
        )

    def at(self, budget: str) -> StyleErdConfig:
        """The same row with less training."""
        return self if budget == "paper" else replace(self, **BUDGET_CHANGES[budget])  # type: ignore[arg-type]

    def with_labels(self, styles: Sequence[str], contents: Sequence[str]) -> StyleErdConfig:
        """The config once the labels are known; without a neutral style the first one is the basis of all."""
        neutral = next((style for style in NEUTRAL_STYLES if style in styles), styles[0])
        return replace(self, styles=tuple(s for s in styles if s != neutral), contents=tuple(contents), neutral=neutral)


BUDGET_CHANGES: Mapping[str, Mapping[str, float]] = {
    "smoke": {"n_steps": 3, "batch": 4, "stride": 16, "classifier_steps": 3},
    "small": {
        "n_steps": 4500, "stride": 8, "rate": 1e-3, "discriminator_rate": 5e-4, "classifier_steps": 400,
        "decay": 0.995, "agreement": 1.0, "carrying_start": True,
    },
}  # fmt: skip
"""Fields in which a budget differs from the paper's."""


class StyleErdNetwork(nn.Module):
    """The generator, with what reads frames and their normalisation."""

    def __init__(self, config: StyleErdConfig) -> None:
        super().__init__()
        self.config = config
        self.reader = FrameReader()
        self.scale = Standardise(config.shape.n_motion)
        self.generator = StyleErd(config.shape)

    def code(self, frames: Frames, contents: Tensor, source_styles: Tensor) -> Tensor:
        """z_t of frames, ``[B, T, hidden]``."""
        return self.generator.encode(self.scale(frames.motion), frames.contacts, contents, source_styles)

    def decode(self, frames: Frames, code: Tensor, target: Tensor) -> Tensor:
        """z'_t back to motion ``[B, T, 204]``: unit quaternions, their positions, velocities."""
        raw, velocities = self.generator.decode(code, target)
        if self.config.residual:
            raw = frames.motion[..., :N_ROTATIONS] + raw
        unit = rotations.normalise(raw.reshape(*raw.shape[:2], N_JOINTS, 4))
        positions = self.reader.positions(unit)[..., 1:, :].flatten(2)
        if self.config.residual:
            velocities = torch.cat([velocities[:, :1], positions[:, 1:] - positions[:, :-1]], dim=1)
        return torch.cat([unit.flatten(2), positions, velocities], dim=2)

    def style_weights(self, styles: Sequence[tuple[str | None, float]]) -> Tensor:
        """A mixture of labels as weights ``[1, n_styles]``; the neutral style is what is left of 1.

        Raises
        ------
        BadInput : a label that was not trained.
        """
        config = self.config
        weights = torch.zeros(1, len(config.styles))
        for style, weight in styles:
            if style == config.neutral:
                continue
            if style not in config.styles:
                known = ", ".join((config.neutral, *config.styles))
                raise BadInput(
                    f"the model knows the styles {known}, got {style!r}",
                    where="style",
                    cause="it has one branch a style, and this one was not trained",
                )
            weights[0, config.styles.index(style)] += weight
        return weights

    def content_weights(self, content: str | None) -> Tensor:
        """A label ``[1, n_contents]``; one that was not trained is a little of each."""
        contents = self.config.contents
        if content in contents:
            return functional.one_hot(torch.tensor([contents.index(str(content))]), len(contents)).float()
        return torch.full((1, len(contents)), 1.0 / len(contents))


def encode(clip: Clip) -> FloatArray:
    """A window ``[T, 89]``: rotations, the root's place, height and heading as the supervision sees them."""
    return np.concatenate([clip.rotations_wxyz.reshape(clip.n_frames, -1), clip.root_xyz_m, seen_columns(clip)], axis=1)


class ContentTraining(Trainable):
    """The classifier that the perceptual loss looks through, trained beforehand."""

    def __init__(
        self, classifier: ContentClassifier, motion: Tensor, windows: Windows, batch: int, generator: torch.Generator
    ) -> None:
        self.classifier, self.motion, self.batch, self.generator = classifier, motion, batch, generator
        self.contents = windows.contents.to(motion.device)
        self.draws = Draws(windows, balance=0.5)
        self.optimiser = torch.optim.Adam(classifier.parameters(), lr=1e-3)

    def parts(self) -> Mapping[str, Stateful]:
        return {"classifier": self.classifier, "optimiser": self.optimiser}

    def step(self, index: int) -> Losses:
        rows = self.draws.rows(self.batch, self.generator)
        scores, _ = self.classifier(self.motion[rows])
        loss = functional.cross_entropy(scores, self.contents[rows])
        self.optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return {"content_classifier": loss}


class StyleErdTraining(Trainable):
    """One step: the discriminator, then the generator, on the same transferred motion."""

    def __init__(
        self, config: StyleErdConfig, windows: Windows, generator: torch.Generator, request: FitRequest
    ) -> None:
        self.config, self.windows, self.generator, self.device = config, windows, generator, request.device
        self.network = StyleErdNetwork(config)
        self.discriminator = Discriminator(config.shape, config.n_frames, attention=config.attention)
        self.classifier = ContentClassifier(config.shape)
        unit = windows.features[..., :N_ROTATIONS].unflatten(2, (N_JOINTS, 4))  # type: ignore[no-untyped-call]
        reader = self.network.reader
        reader.offsets.copy_(windows.offsets_m.mean(dim=0) / UNIT_M)
        local = reader(unit, windows.features[..., ROOT]).motion[..., :N_ROTATIONS]
        reader.reference_wxyz.copy_(mean_rotations(local.unflatten(2, (N_JOINTS, 4))))
        self.frames: Frames = reader(unit, windows.features[..., ROOT])
        self.network.scale.fit(self.frames.motion, floor=1e-2)
        with torch.no_grad():
            bias = self.network.generator.rotation_layer.bias
            bias.copy_(torch.zeros_like(bias) if config.residual else reader.reference_wxyz.flatten())
        supervised = config.content_class > 0.0 or config.style_class > 0.0
        self.supervision = (
            Supervision(self.frames, windows, SEEN, config.classifier_steps, request) if supervised else None
        )
        self.frames = Frames(*(tensor.to(self.device) for tensor in self.frames))
        neutral = windows.style_labels.index(config.neutral)
        self.neutral, self.others = neutral, [s for s in range(len(windows.style_labels)) if s != neutral]
        self.style_codes = torch.eye(len(windows.style_labels))[:, self.others].to(self.device)
        self.content_codes = torch.eye(len(windows.content_labels)).to(self.device)
        self.draws = Draws(windows, balance=0.5)
        for part in (self.network, self.discriminator, self.classifier):
            part.to(self.device)
        self.generator_optimiser = torch.optim.Adam(self.network.parameters(), lr=config.rate, fused=True)
        self.discriminator_optimiser = torch.optim.Adam(
            self.discriminator.parameters(), lr=config.discriminator_rate, fused=True
        )
        self.average = Average(self.network, config.decay)

    def parts(self) -> Mapping[str, Stateful]:
        return {
            "network": self.network,
            "discriminator": self.discriminator,
            "generator_optimiser": self.generator_optimiser,
            "discriminator_optimiser": self.discriminator_optimiser,
            "average": self.average,
        }

    def step(self, index: int) -> Losses:
        config = self.config
        rows, target = self._pairs()
        own, content = self.style_codes[self.windows.styles[rows]], self.content_codes[self.windows.contents[rows]]
        wanted = self.style_codes[target]
        frames = Frames(*(tensor[rows] for tensor in self.frames))
        told = torch.rand(len(rows), 1, generator=self.generator).ge(config.withheld).to(own)
        made, rebuilt = self._made(frames, content, own * told, wanted, own)

        losses: dict[str, Tensor] = {}
        if config.adversarial > 0.0:
            losses |= self._discriminate(made.detach(), rows, target)
        source = frames.motion
        losses |= {
            "rotation": equations.quaternion_angle(rebuilt[..., :N_ROTATIONS], source[..., :N_ROTATIONS]),
            "position": equations.squared(
                rebuilt[..., POSITION_START:VELOCITY_START], source[..., POSITION_START:VELOCITY_START]
            ),
            "velocity": equations.squared(rebuilt[..., VELOCITY_START:], source[..., VELOCITY_START:]),
        }
        if config.adversarial > 0.0:
            self.discriminator.requires_grad_(False)
            losses["adversarial"] = equations.adversarial(self.discriminator(made[..., CRITIC_INPUT], wanted, content))
            self.discriminator.requires_grad_(True)
        if config.perceptual > 0.0:
            maps = self.classifier(self.network.scale(torch.cat([made, source])))[1]
            halves = [layer.chunk(2) for layer in maps]
            losses["perceptual"] = equations.perceptual([a for a, _ in halves], [b for _, b in halves])
        if config.agreement > 0.0:
            losses["agreement"] = equations.disagreement(torch.cat([made, rebuilt])[..., POSITION_START:])
        if self.supervision is not None:
            losses |= self.supervision(made[..., :N_ROTATIONS], rows, target)
        named = [name for name in losses if name not in ("critic", "penalty")]
        total = torch.stack([float(getattr(config, name)) * losses[name] for name in named]).sum()
        self.generator_optimiser.zero_grad(set_to_none=True)
        total.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_CLIP)
        self.generator_optimiser.step()
        self.average.update(self.network)
        return losses

    def _pairs(self) -> tuple[Tensor, Tensor]:
        """Rows of sources ``[B]`` and the styles that they shall have ``[B]``, as indices of labels."""
        config, generator = self.config, self.generator
        if config.any_pairs:
            rows = self.draws.rows(config.batch, generator)
            n_styles = len(self.windows.style_labels)
            shift = torch.randint(1, n_styles, (config.batch,), generator=generator)
            return rows, (self.windows.styles[rows] + shift) % n_styles
        n_neutral = round(config.neutral_share * config.batch)
        others = torch.tensor(self.others)[torch.randint(len(self.others), (config.batch,), generator=generator)]
        neutral = torch.full_like(others, self.neutral)
        is_neutral = torch.arange(config.batch) < n_neutral
        rows = self.draws.with_styles(torch.where(is_neutral, neutral, others), generator)
        return rows, torch.where(is_neutral, others, neutral)

    def _made(
        self, frames: Frames, content: Tensor, told: Tensor, wanted: Tensor, own: Tensor
    ) -> tuple[Tensor, Tensor]:
        """The same sources in the wanted style and in their own, motion ``[B, T, 204]`` each."""
        net = self.network
        code = net.code(frames, content, told)
        target = torch.cat([wanted, own])
        after, _ = net.generator.recur(code.repeat(2, 1, 1), target, net.generator.initial(content.repeat(2, 1)))
        twice = Frames(*(torch.cat([tensor, tensor]) for tensor in frames))
        made, rebuilt = net.decode(twice, after, target).chunk(2)
        return made, rebuilt

    def _discriminate(self, made: Tensor, rows: Tensor, target: Tensor) -> dict[str, Tensor]:
        """Equations 5, 6 and 9: real motion of the wanted style and the source's content against the transferred."""
        contents = self.windows.contents[rows]
        real_rows = self.draws.with_cells(contents, target, self.generator)
        wanted, content = self.style_codes[target], self.content_codes[contents]
        real = self.frames.motion[real_rows][..., CRITIC_INPUT].requires_grad_()
        real_scores = self.discriminator(real, wanted, self.content_codes[self.windows.contents[real_rows]])
        fake_scores = self.discriminator(made[..., CRITIC_INPUT], wanted, content)
        critic, penalty = equations.critic(real_scores, fake_scores), gradient_penalty(real_scores, real)
        if self.config.penalty_of_mean:
            penalty = penalty / len(real_scores) ** 2
        self.discriminator_optimiser.zero_grad(set_to_none=True)
        (critic + self.config.penalty * penalty).backward()  # type: ignore[no-untyped-call]
        self.discriminator_optimiser.step()
        return {"critic": critic, "penalty": penalty}


def train_style_erd(config: StyleErdConfig, request: FitRequest) -> tuple[StyleErdConfig, StyleErdNetwork, Curves]:
    """Train on takes with content and style labels: first the content classifier, then the transfer."""
    windows = cut_windows(request.takes, encode, n_frames=config.n_frames, stride=config.stride)
    config = config.with_labels(windows.style_labels, windows.content_labels)
    stages = []
    with seeded(request.seed, request.device) as generator:
        training = StyleErdTraining(config, windows, generator, request)
        if config.perceptual > 0.0:
            motion = training.network.scale(training.frames.motion)
            contents = ContentTraining(training.classifier, motion, windows, 4 * config.batch, generator)
            stages.append(
                train(
                    contents, config.classifier_steps, progress=request.progress, name="content classifier",
                    checkpoints=request.checkpoints,
                )
            )  # fmt: skip
        training.classifier.eval().requires_grad_(False)
        stages.append(train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints))
    return config, training.average.network, Curves.one_after_the_other(stages)
