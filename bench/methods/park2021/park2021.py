"""Park 2021: training (section 6.2, appendix A.2), transfer by reference motion and by latent code."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from bench.errors import BadInput
from bench.methods.layers import Average, gradient_penalty
from bench.methods.park2021.losses import (
    adversarial_of_discriminator,
    adversarial_of_stylizer,
    diversity,
    motion_distance,
    style_distance,
)
from bench.methods.park2021.network import (
    SHRINK,
    Discriminator,
    MappingNetwork,
    NetworkSize,
    StyleEncoder,
    Stylizer,
    initialise,
)
from bench.methods.park2021.supervision import Supervision
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
)
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.edit import windows as windows_of
from bench.motion.park_features import ROTATION, clip_from_park_frame, park_frame_features
from bench.motion.representation import RootTrack
from bench.motion.skeleton import N_JOINTS
from classifiers.data import mean_rotations

N_CHANNELS = 7


@dataclass(frozen=True)
class ParkConfig:
    """What is built and trained; the defaults are the paper's.

    Attributes
    ----------
    style_labels : domains in order; training fills them in.
    width, style_dim, latent_dim, hidden_dim : of the networks, see :class:`NetworkSize`.
    n_frames, stride : of the training windows, at 30 fps.
    faithful_partition : the graph partition of the released code.
    by_positions : bones follow the predicted positions, as in the paper's figures; the predicted rotations alone
        otherwise.
    n_steps, batch : iterations and windows each; latent and reference mode take turns.
    rate, rate_mapping, rate_encoder, rate_discriminator, betas : of Adam for G, F, E and D.
    average : decay of a moving average of the weights that is used at test; 0 for the last weights.
    adversarial, cycle, identity, style, diversity : weights of the terms of equation 12.
    penalty : weight of R1 on D, which only the released code has.
    content : not in the paper: content labels of the fit part choose D's branch, too, and teach what content is.
    perceptual, content_class, style_class, classifier_steps : weights and training of what ``content`` adds.
    """

    style_labels: tuple[str, ...] = ()
    width: int = 64
    style_dim: int = 64
    latent_dim: int = 16
    hidden_dim: int = 512
    n_frames: int = 64
    stride: int = 32
    faithful_partition: bool = False
    by_positions: bool = True
    n_steps: int = 100_000
    batch: int = 8
    rate: float = 1e-4
    rate_mapping: float = 1e-4
    rate_encoder: float = 1e-6
    rate_discriminator: float = 1e-6
    betas: tuple[float, float] = (0.99, 0.999)
    average: float = 0.0
    adversarial: float = 1.0
    cycle: float = 1.0
    identity: float = 1.0
    style: float = 1.0
    diversity: float = 1.0
    penalty: float = 1.0
    content: bool = False
    perceptual: float = 0.3
    content_class: float = 0.5
    style_class: float = 1.0
    classifier_steps: int = 1000

    def at(self, budget: str) -> ParkConfig:
        """The same variant with less training, narrower networks and rates that fit a short training."""
        if budget == "paper":
            return self
        short = replace(
            self,
            rate=1e-3,
            rate_mapping=1e-3,
            rate_encoder=1e-3,
            rate_discriminator=5e-4,
            betas=(0.5, 0.99),
        )
        if budget == "smoke":
            return replace(
                short, width=4, style_dim=8, hidden_dim=16, n_steps=4, batch=4, average=0.5, classifier_steps=3
            )
        return replace(
            short, width=24, hidden_dim=128, n_frames=32, stride=16, n_steps=2600, average=0.99, classifier_steps=250
        )

    @property
    def size(self) -> NetworkSize:
        return NetworkSize(
            n_styles=len(self.style_labels),
            width=self.width,
            style_dim=self.style_dim,
            latent_dim=self.latent_dim,
            hidden_dim=self.hidden_dim,
            n_frames=self.n_frames,
            faithful_partition=self.faithful_partition,
        )


class Park2021(nn.Module):
    """G, E and F between a normalisation and its inverse."""

    reference_wxyz: Tensor

    def __init__(self, config: ParkConfig) -> None:
        super().__init__()
        self.config = config
        self.stylizer = Stylizer(config.size)
        self.style_encoder = StyleEncoder(config.size)
        self.mapping = MappingNetwork(config.size)
        self.standardise = Standardise(N_JOINTS, N_CHANNELS)
        self.register_buffer("reference_wxyz", torch.zeros(N_JOINTS, 4))

    def fit_scale(self, features: Tensor) -> None:
        """Take mean rotations, means and deviations from windows ``[n, T, 21, 7]``."""
        self.reference_wxyz.copy_(mean_rotations(features[..., ROTATION]))
        self.standardise.fit(self.signed(features), floor=1e-2)

    def signed(self, features: Tensor) -> Tensor:
        """Signs of whole tracks of quaternions in ``[n, T, 21, 7]`` as in the mean rotations."""
        dots = (features[..., ROTATION] * self.reference_wxyz).sum(dim=-1).mean(dim=1)  # [n, 21]
        signs = torch.where(dots < 0.0, -1.0, 1.0)[:, None, :, None]
        return torch.cat([features[..., : ROTATION.start], signs * features[..., ROTATION]], dim=-1)

    def motions(self, features: Tensor) -> Tensor:
        """``[n, T, 21, 7]`` of :func:`park_frame_features` as ``[n, 7, T, 21]``, standardised."""
        standard: Tensor = self.standardise(self.signed(features))
        return standard.permute(0, 3, 1, 2).contiguous()

    def features(self, motions: Tensor) -> Tensor:
        """From standardised ``[n, 7, T, 21]`` back to ``[n, T, 21, 7]``."""
        return self.standardise.inverse(motions.permute(0, 2, 3, 1))

    def domain(self, label: str | None) -> Tensor:
        """``[1]`` index of a style label.

        Raises
        ------
        BadInput : a style that was not trained.
        """
        if label not in self.config.style_labels:
            known = ", ".join(self.config.style_labels)
            raise BadInput(f"style must be one of {known}; got {label!r}", remedy="train with takes of that style")
        return torch.tensor([self.config.style_labels.index(label)])

    @torch.inference_mode()
    def code_of_reference(self, clip: Clip, label: str | None) -> Tensor:
        """``[1, style_dim]``: mean over windows of the training length, every half of it, of equation 5."""
        n_frames = self.config.n_frames
        parts = [part for _, part in windows_of(resample(clip, FPS), n_frames, n_frames // 2)]
        windows = torch.from_numpy(np.stack([park_frame_features(part)[0] for part in parts]).astype(np.float32))
        domains = self.domain(label).expand(len(parts))
        codes: Tensor = self.style_encoder(self.motions(windows), domains)
        return codes.mean(dim=0, keepdim=True)

    @torch.inference_mode()
    def code_of_latent(self, label: str, rng: np.random.Generator) -> Tensor:
        """``[1, style_dim]`` of a latent code drawn from a standard normal (equation 6)."""
        latent = torch.from_numpy(rng.standard_normal((1, self.config.latent_dim)).astype(np.float32))
        code: Tensor = self.mapping(latent, self.domain(label))
        return code

    @torch.inference_mode()
    def transfer(self, content: Clip, codes: Sequence[tuple[Tensor, float]]) -> Clip:
        """The content in a mixture of style codes with weights that sum to 1; its path over the ground stays.

        A clip of any length is answered at once, at 30 fps; one shorter than a training window holds its last pose.
        """
        code = torch.stack([weight * code for code, weight in codes]).sum(dim=0)

        def answer(clip: Clip) -> Clip:
            held = hold(clip, padded_frames(clip.n_frames, SHRINK, self.config.n_frames))
            features, track = park_frame_features(held)
            motion = self.stylizer(self.motions(torch.from_numpy(features[None].astype(np.float32))), code)
            made = self.features(motion)[0, : clip.n_frames].double().numpy()
            path = RootTrack(track.yaw_rad[: clip.n_frames], track.xz_m[: clip.n_frames])
            return clip_from_park_frame(made, path, clip, by_positions=self.config.by_positions)

        return at_training_rate(content, answer)


def train_park(config: ParkConfig, request: FitRequest) -> tuple[ParkConfig, Park2021, Curves]:
    """Train on takes with style labels; content labels are looked at where the config says so."""
    windows = cut_windows(
        request.takes,
        lambda clip: park_frame_features(clip)[0],
        n_frames=config.n_frames,
        stride=config.stride,
        mirrored=not config.content,  # left and right are contents
    )
    config = replace(config, style_labels=windows.style_labels)
    with seeded(request.seed, request.device) as generator:
        training = _ParkTraining(config, windows, generator, request)
        curves = train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints)
    return config, training.average.network, curves


class _ParkTraining(Trainable):
    """One iteration: D, then G with E or F, on the same outputs; even iterations draw codes from F, odd ones from E."""

    def __init__(self, config: ParkConfig, windows: Windows, generator: torch.Generator, request: FitRequest) -> None:
        self.config, self.windows, self.generator, self.device = config, windows, generator, request.device
        self.n_styles = len(windows.style_labels)
        n_branches = self.n_styles * (len(windows.content_labels) if config.content else 1)
        self.model = Park2021(config)
        self.discriminator = Discriminator(replace(config.size, n_styles=n_branches))
        for network in (self.model, self.discriminator):
            initialise(network)
        self.model.fit_scale(windows.features)
        self.motions = self.model.motions(windows.features).to(self.device)
        self.supervision = (
            Supervision(
                self.model.signed(windows.features), windows, config.classifier_steps, request.seed, self.device
            )
            if config.content
            else None
        )
        self.draws = Draws(windows)
        self.model.to(self.device)
        self.discriminator.to(self.device)
        self.optimiser = torch.optim.Adam(
            [
                {"params": list(self.model.stylizer.parameters()), "lr": config.rate},
                {"params": list(self.model.mapping.parameters()), "lr": config.rate_mapping},
                {"params": list(self.model.style_encoder.parameters()), "lr": config.rate_encoder},
            ],
            betas=config.betas,
        )
        self.discriminator_optimiser = torch.optim.Adam(
            self.discriminator.parameters(), lr=config.rate_discriminator, betas=config.betas
        )
        self.average = Average(self.model, config.average)

    def parts(self) -> Mapping[str, Stateful]:
        return {
            "model": self.model,
            "discriminator": self.discriminator,
            "optimiser": self.optimiser,
            "discriminator_optimiser": self.discriminator_optimiser,
            "average": self.average,
        }

    def step(self, index: int) -> Losses:
        config, stylizer, encoder = self.config, self.model.stylizer, self.model.style_encoder
        own, target = self._styles(), self._styles()
        rows = self.draws.with_styles(own, self.generator)
        source, contents = self.motions[rows], self.windows.contents[rows]
        own_domain, target_domain = own.to(self.device), target.to(self.device)
        code, another = self._codes(target, by_reference=index % 2 == 1)

        content = stylizer.encode(source)
        output = stylizer.decode(content, code)
        branch = self._branch(contents, target)
        discriminated = self._discriminate(rows, contents, own, target, output.detach(), branch)

        self.discriminator.requires_grad_(False)
        found = encoder(torch.cat([source, output]), torch.cat([own_domain, target_domain]))
        own_code, target_code = found.chunk(2)
        losses = {
            "adversarial": adversarial_of_stylizer(self.discriminator(output, branch)),
            "cycle": motion_distance(source, stylizer(output, own_code)),
            "identity": motion_distance(source, stylizer.decode(content, own_code)),
        }
        self.discriminator.requires_grad_(True)
        if config.style:
            losses["style"] = style_distance(code, target_code)
        if config.diversity:
            with torch.no_grad():
                other = stylizer.decode(content, another)
            losses["diversity"] = diversity(output, other)
        if self.supervision:
            made, real = self.model.features(output), self.model.features(source)
            losses |= self.supervision(made, real, contents.to(self.device), target_domain)
        weighted = [
            (-1.0 if name == "diversity" else 1.0) * float(getattr(config, name)) * loss
            for name, loss in losses.items()
        ]
        self.optimiser.zero_grad(set_to_none=True)
        torch.stack(weighted).sum().backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        self.average.update(self.model)
        return {**losses, **discriminated}

    def _styles(self) -> Tensor:
        """``[batch]`` domains, each as often as the others (as released)."""
        return torch.randint(self.n_styles, (self.config.batch,), generator=self.generator)

    def _codes(self, styles: Tensor, *, by_reference: bool) -> tuple[Tensor, Tensor]:
        """Two codes ``[batch, style_dim]`` of each style: of two reference motions, or of two latent codes."""
        domains = styles.to(self.device).repeat(2)
        if by_reference:
            rows = torch.cat([self.draws.with_styles(styles, self.generator) for _ in range(2)])
            codes = self.model.style_encoder(self.motions[rows], domains)
        else:
            latent = torch.randn(2 * len(styles), self.config.latent_dim, generator=self.generator)
            codes = self.model.mapping(latent.to(self.device), domains)
        one, other = codes.chunk(2)
        return one, other

    def _branch(self, contents: Tensor, styles: Tensor) -> Tensor:
        """``[batch]`` branches of D: the style's, or that of content and style where contents are known."""
        return (contents * self.n_styles + styles if self.config.content else styles).to(self.device)

    def _discriminate(
        self, rows: Tensor, contents: Tensor, own: Tensor, target: Tensor, fake: Tensor, fake_branch: Tensor
    ) -> dict[str, Tensor]:
        """Real motions of any domain against outputs; with contents known, real ones of the outputs' cells."""
        real_branch = self._branch(contents, own)
        if self.config.content:
            rows, real_branch = self.draws.with_cells(contents, target, self.generator), fake_branch
        real = self.motions[rows].requires_grad_()
        scores = self.discriminator(real, real_branch)
        adversarial = adversarial_of_discriminator(scores, self.discriminator(fake, fake_branch))
        penalty = gradient_penalty(scores, real)
        self.discriminator_optimiser.zero_grad(set_to_none=True)
        (adversarial + self.config.penalty * penalty).backward()  # type: ignore[no-untyped-call]
        self.discriminator_optimiser.step()
        return {"discriminator": adversarial, "penalty": penalty}
