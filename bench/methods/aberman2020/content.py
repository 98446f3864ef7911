"""``aberman2020-content``: Aberman's encoders and decoder, taught what content is. Not in the paper.

Without content labels the networks of Aberman et al. 2020 find the style soon and lose the content: what moves in the
reference leaks into the output. Here the content labels of the fit part, which the paper's method does not use, teach
three things: a discriminator that sees the (content, style) cell that an output claims to be of, and two small
classifiers of our own, trained on the fit part alone, whose features and answers an output has to keep. At transfer no
label is needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.arrays import FloatArray
from bench.methods import rotations
from bench.methods.aberman2020.network import LEAST_FRAMES, CellDiscriminator, Generator, NetworkSize
from bench.methods.layers import Average, hinge_discriminator
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import (
    FPS,
    Draws,
    Standardise,
    Windows,
    at_training_rate,
    cut_windows,
    hold,
    padded_frames,
    to_tensor,
)
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.edit import windows as windows_of
from bench.motion.kinematics import yaw_aligned
from bench.motion.pose import heading_removed
from bench.motion.skeleton import CANONICAL_PARENTS, HEAD, LEFT_TOE, N_JOINTS, RIGHT_TOE
from classifiers.data import mean_rotations
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.train import TrainingConfig, train_classifier

N_VECTORS = 3 * N_JOINTS
N_OUTPUT = N_VECTORS + 1
N_INPUT = N_OUTPUT + N_VECTORS
CLASSIFIER_WIDTHS = (8, 16, 32)
GRADIENT_CLIP = 5.0


@dataclass(frozen=True)
class ContentConfig:
    """Everything that decides a training.

    Attributes
    ----------
    hidden, style_hidden, mlp : inner channels of the generator.
    n_frames, stride : of the training windows.
    n_steps, batch, rate, decay : Adam steps, their size and rate, and the averaging of weights.
    reconstruction, cycle, matching, perceptual, content_class, style_class, smoothness : weights of losses; the
        adversarial loss has weight 1.
    classifier_steps : of each of the two classifiers.
    """

    hidden: int = 64
    style_hidden: int = 64
    mlp: tuple[int, ...] = (96, 128)
    n_frames: int = 64
    stride: int = 16
    n_steps: int = 3200
    batch: int = 16
    rate: float = 5e-4
    decay: float = 0.995
    discriminator_width: int = 64
    reconstruction: float = 5.0
    cycle: float = 1.0
    matching: float = 5.0
    perceptual: float = 1.0
    content_class: float = 0.5
    style_class: float = 0.5
    smoothness: float = 0.5
    classifier_steps: int = 250

    @property
    def size(self) -> NetworkSize:
        return NetworkSize(
            N_INPUT, N_INPUT, 0, N_OUTPUT, self.hidden, self.style_hidden, self.mlp, every_layer=True, linear=True
        )


CONFIGS = {
    "smoke": ContentConfig(hidden=16, style_hidden=16, mlp=(16, 16), n_steps=3, batch=4, discriminator_width=8,
                           classifier_steps=3),
    "small": ContentConfig(),
    "paper": ContentConfig(hidden=144, style_hidden=96, mlp=(192, 256), n_steps=60_000, batch=64,
                           classifier_steps=1000, discriminator_width=128),
}  # fmt: skip


class ContentNetwork(nn.Module):
    """The generator, with the numbers that turn motion into its channels and back.

    Channels of a pose: rotation vectors about the mean rotation of each joint, heading removed (63), the root's height
    in statures (1), joint positions in statures in the frame that :func:`seen` says (63).
    """

    reference_wxyz: Tensor

    def __init__(self, config: ContentConfig) -> None:
        super().__init__()
        self.generator = Generator(config.size)
        self.standardise = Standardise(N_INPUT)
        self.register_buffer("reference_wxyz", torch.zeros(N_JOINTS, 4))

    def plain_channels(self, poses: Tensor, offsets: Tensor) -> Tensor:
        """Poses ``[B, T, 86]`` of :func:`encode` and bones ``[B, 21, 3]`` in statures to ``[B, T, 127]``."""
        wxyz, height, heading = split(poses)
        turned = rotations.multiply(rotations.conjugate(self.reference_wxyz), wxyz)
        positions = seen(wxyz, height, heading, offsets)[..., :3]
        return torch.cat([rotations.to_rotation_vector(turned).flatten(2), height, positions.flatten(2)], dim=2)

    def channels(self, poses: Tensor, offsets: Tensor) -> Tensor:
        """As :meth:`plain_channels`, standardised and time last: ``[B, 127, T]``."""
        standard: Tensor = self.standardise(self.plain_channels(poses, offsets))
        return standard.transpose(1, 2)

    def poses(self, output: Tensor) -> tuple[Tensor, Tensor]:
        """Decoded ``[B, 64, T]`` as rotations ``[B, T, 21, 4]``, heading removed, and heights ``[B, T, 1]``."""
        plain = output.transpose(1, 2) * self.standardise.deviation[:N_OUTPUT] + self.standardise.mean[:N_OUTPUT]
        vectors = plain[..., :N_VECTORS].reshape(*plain.shape[:2], N_JOINTS, 3)
        turned = rotations.multiply(self.reference_wxyz, rotations.from_rotation_vector(vectors))
        return turned, plain[..., N_VECTORS:]

    def motion(self, output: Tensor, heading: Tensor, offsets: Tensor) -> tuple[Tensor, Tensor]:
        """Decoded ``[B, 64, T]`` on the content's heading ``[B, T, 1]`` and bones: its channels and what is seen."""
        wxyz, height = self.poses(output)
        view = seen(wxyz, height, heading, offsets)
        positions = view[..., :3].flatten(2)
        standard = (positions - self.standardise.mean[N_OUTPUT:]) / self.standardise.deviation[N_OUTPUT:]
        return torch.cat([output, standard.transpose(1, 2)], dim=1), view


def encode(clip: Clip) -> FloatArray:
    """A window as poses ``[T, 86]``: rotations without heading (84), height in statures, heading about its mean."""
    wxyz, yaw = heading_removed(clip)
    heading = np.unwrap(yaw)
    height = clip.root_xyz_m[:, 1] / clip.skeleton.stature_m
    columns = [wxyz.reshape(len(wxyz), -1), height[:, None], (heading - heading.mean())[:, None]]
    return np.concatenate(columns, axis=1)


def split(poses: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """``[B, T, 86]`` as rotations ``[B, T, 21, 4]``, heights and headings ``[B, T, 1]``."""
    wxyz = poses[..., : 4 * N_JOINTS].reshape(*poses.shape[:2], N_JOINTS, 4)
    return wxyz, poses[..., -2:-1], poses[..., -1:]


def seen(wxyz: Tensor, height: Tensor, heading: Tensor, offsets: Tensor) -> Tensor:
    """What judges of motion see, ``[B, T, 21, 7]``: positions in statures and local rotations, turns included.

    The root stays over one place and its heading is taken about the window's mean, so that a turn is visible.
    """
    root = rotations.multiply(rotations.about_y(heading), wxyz[:, :, :1])
    turned = torch.cat([root, wxyz[:, :, 1:]], dim=2)
    place = functional.pad(height, (1, 1))
    return torch.cat([rotations.forward_kinematics(turned, place, offsets[:, None]), turned], dim=3)


def excess_jerk(made: Tensor, real: Tensor) -> Tensor:
    """By how much, on a logarithmic scale, made motion is jerkier than real motion of its cell; 0 where it is calmer.

    Parameters
    ----------
    made, real : ``[B, T, 21, 7]`` of :func:`seen`.
    """
    jerks = [torch.diff(view[..., :3], n=3, dim=1).norm(dim=-1).mean(dim=(1, 2)) for view in (made, real)]
    return functional.relu(torch.log(jerks[0] / jerks[1].clamp(min=1e-9))).mean()


def in_statures(offsets_m: Tensor) -> Tensor:
    """Bones ``[..., 21, 3]`` divided by the rest height of Head over the lower toe."""
    still = torch.zeros(*offsets_m.shape[:-1], 4)
    still[..., 0] = 1.0
    rest = rotations.forward_kinematics(still, torch.zeros(*offsets_m.shape[:-2], 3), offsets_m)[..., 1]
    stature = rest[..., HEAD] - torch.minimum(rest[..., LEFT_TOE], rest[..., RIGHT_TOE])
    return offsets_m / stature[..., None, None]


class ContentTraining(Trainable):
    """One step: discriminator, then generator, on the same outputs."""

    def __init__(
        self, config: ContentConfig, windows: Windows, generator: torch.Generator, request: FitRequest
    ) -> None:
        self.config, self.windows, self.generator, self.device = config, windows, generator, request.device
        self.n_styles = len(windows.style_labels)
        n_cells = self.n_styles * len(windows.content_labels)
        self.network = ContentNetwork(config)
        self.discriminator = CellDiscriminator(N_INPUT, n_cells, config.discriminator_width)
        offsets = in_statures(windows.offsets_m)
        self.network.reference_wxyz.copy_(mean_rotations(split(windows.features)[0]))
        self.network.standardise.fit(self.network.plain_channels(windows.features, offsets), floor=1e-2)
        view = seen(*split(windows.features), offsets)
        self.content_classifier = _classifier(view, windows.contents, config, request.seed)
        self.style_classifier = _classifier(view, windows.styles, config, request.seed + 1)
        self.channels = self.network.channels(windows.features, offsets).to(self.device)
        self.view, self.offsets = view.to(self.device), offsets.to(self.device)
        self.draws = Draws(windows, balance=0.5)
        for part in (self.network, self.discriminator, self.content_classifier, self.style_classifier):
            part.to(self.device)
        betas = (0.5, 0.99)
        self.generator_optimiser = torch.optim.Adam(self.network.parameters(), lr=config.rate, betas=betas)
        self.discriminator_optimiser = torch.optim.Adam(self.discriminator.parameters(), lr=config.rate, betas=betas)
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
        config, net = self.config, self.network.generator
        a = self.draws.rows(config.batch, self.generator)
        own = self.windows.styles[a]
        other = (own + torch.randint(1, self.n_styles, own.shape, generator=self.generator)) % self.n_styles
        contents = self.windows.contents[a]
        b = self.draws.with_styles(other, self.generator)
        again = self.draws.with_styles(own, self.generator)
        real = self.draws.with_cells(contents, other, self.generator)
        cells = (contents * self.n_styles + other).to(self.device)

        source, heading, bones = self.channels[a], self.windows.features[a, :, -1:].to(self.device), self.offsets[a]
        content = net.content_encoder(source)
        codes = net.style_encoder(torch.cat([self.channels[b], self.channels[again]]))
        decoded = net.decode(torch.cat([content, content]), codes)
        output, view = self.network.motion(decoded, torch.cat([heading, heading]), torch.cat([bones, bones]))
        fake, rebuilt = output.chunk(2)

        discriminated = self._discriminate(self.channels[real], fake.detach(), cells)
        self.discriminator.requires_grad_(False)
        score, features = self.discriminator(fake, cells)
        real_features = self.discriminator(self.channels[real], cells)[1]
        self.discriminator.requires_grad_(True)
        shown = view[: config.batch]
        kept, content_scores = _looked_at(self.content_classifier, shown)
        wanted, _ = _looked_at(self.content_classifier, self.view[a])
        _, style_scores = _looked_at(self.style_classifier, shown)
        cycle = net.decode(net.content_encoder(fake), codes[config.batch :])
        losses = {
            "adversarial": -score.mean(),
            "reconstruction": (rebuilt - source).abs().mean(),
            "cycle": (cycle - source[:, :N_OUTPUT]).abs().mean(),
            "matching": (features.mean(dim=0) - real_features.mean(dim=0)).abs().mean(),
            "perceptual": (kept - wanted).abs().mean(),
            "content_class": functional.cross_entropy(content_scores, contents.to(self.device)),
            "style_class": functional.cross_entropy(style_scores, other.to(self.device)),
            "smoothness": excess_jerk(shown, self.view[real]),
        }
        total = sum((self._weight(name) * loss for name, loss in losses.items()), torch.zeros(()))
        self.generator_optimiser.zero_grad(set_to_none=True)
        total.backward()
        nn.utils.clip_grad_norm_(self.network.parameters(), GRADIENT_CLIP)
        self.generator_optimiser.step()
        self.average.update(self.network)
        return {**losses, "discriminator": discriminated}

    def _discriminate(self, real: Tensor, fake: Tensor, cells: Tensor) -> Tensor:
        scores, _ = self.discriminator(torch.cat([real, fake]), torch.cat([cells, cells]))
        loss = hinge_discriminator(*scores.chunk(2))
        self.discriminator_optimiser.zero_grad(set_to_none=True)
        loss.backward()  # type: ignore[no-untyped-call]
        nn.utils.clip_grad_norm_(self.discriminator.parameters(), GRADIENT_CLIP)
        self.discriminator_optimiser.step()
        return loss

    def _weight(self, loss: str) -> float:
        config = self.config
        return {
            "adversarial": 1.0,
            "reconstruction": config.reconstruction,
            "cycle": config.cycle,
            "matching": config.matching,
            "perceptual": config.perceptual,
            "content_class": config.content_class,
            "style_class": config.style_class,
            "smoothness": config.smoothness,
        }[loss]


def _classifier(view: Tensor, labels: Tensor, config: ContentConfig, seed: int) -> Stgcn:
    """A small classifier of fit windows; it shares nothing with the judges but the kind of network."""
    network = StgcnConfig(CANONICAL_PARENTS, int(labels.max()) + 1, n_frames=config.n_frames, widths=CLASSIFIER_WIDTHS)
    training = TrainingConfig(n_steps=config.classifier_steps, batch_size=64)
    model, _ = train_classifier(view.numpy(), labels.numpy(), network, training, seed=seed)
    return model.requires_grad_(False)


def _looked_at(classifier: Stgcn, view: Tensor) -> tuple[Tensor, Tensor]:
    """The last feature map averaged over joints ``[B, C, T]``, and the scores ``[B, classes]``."""
    standard = classifier.standardise(view[:, :: classifier.config.frame_step])
    deep: Tensor = classifier.blocks(standard.permute(0, 3, 1, 2))
    return deep.mean(dim=3), classifier.logits(deep.mean(dim=(2, 3)))


def train_content(config: ContentConfig, request: FitRequest) -> tuple[ContentConfig, ContentNetwork, Curves]:
    """Train on labelled takes; the averaged weights are the result."""
    windows = cut_windows(request.takes, encode, n_frames=config.n_frames, stride=config.stride)
    with seeded(request.seed, request.device) as generator:
        training = ContentTraining(config, windows, generator, request)
        curves = train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints)
    return config, training.average.network, curves


@torch.inference_mode()
def transfer(
    network: ContentNetwork, config: ContentConfig, content: Clip, styles: Sequence[tuple[Clip, float]]
) -> Clip:
    """The content's motion in a mixture of styles: a weighted mean of style codes. Works at the content's own fps."""
    code = sum((weight * style_code(network, config, clip) for clip, weight in styles), torch.zeros(()))
    return at_training_rate(content, lambda clip: _decoded(network, clip, code))


def style_code(network: ContentNetwork, config: ContentConfig, clip: Clip) -> Tensor:
    """``[1, hidden]``: the mean code over windows of the training length, every half of it."""
    parts = [part for _, part in windows_of(resample(clip, FPS), config.n_frames, config.n_frames // 2)]
    poses = torch.cat([to_tensor(encode(part)) for part in parts])
    channels = network.channels(poses, _bones(clip).expand(len(parts), -1, -1))
    codes: Tensor = network.generator.style_encoder(channels)
    return codes.mean(dim=0, keepdim=True)


def _decoded(network: ContentNetwork, clip: Clip, code: Tensor) -> Clip:
    held = hold(clip, padded_frames(clip.n_frames, 2, LEAST_FRAMES))
    channels = network.channels(to_tensor(encode(held)), _bones(clip))
    output = network.generator.decode(network.generator.content_encoder(channels), code)
    wxyz, height = (found[0, : clip.n_frames].double().numpy() for found in network.poses(output))
    _, yaw = heading_removed(clip)
    root = clip.root_xyz_m.copy()
    root[:, 1] = height[:, 0] * clip.skeleton.stature_m
    turned, _ = yaw_aligned(quat.normalise(wxyz), root, -yaw)
    return clip.with_motion(turned, root)


def _bones(clip: Clip) -> Tensor:
    return in_statures(to_tensor(clip.skeleton.offsets_m))
