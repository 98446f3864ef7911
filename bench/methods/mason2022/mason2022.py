"""Mason et al. 2022, Real-Time Style Modelling of Human Locomotion via Feature-Wise Transformations and Local Motion
Phases: configs, losses, training and fine-tuning of the seven models.

Paper: Proc. ACM Comput. Graph. Interact. Tech. 5(1). Differences from paper and released code:
docs/methods/mason2022.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor, nn

from bench.arrays import FloatArray
from bench.methods.mason2022.examples import StyleExamples, examples_of, layout_of, locomotion
from bench.methods.mason2022.features import PER_JOINT, Layout
from bench.methods.mason2022.network import Backbone, Film, ModelSize, Modulation, StyleModel
from bench.methods.training import Curves, FitRequest, Losses, Stateful, Trainable, seeded, train
from bench.methods.windows import Standardise
from bench.motion.skeleton import CANONICAL_PARENTS, LEFT_FINGER, RIGHT_FINGER

BONES = tuple(joint for joint in range(1, len(CANONICAL_PARENTS)) if joint not in (LEFT_FINGER, RIGHT_FINGER))
"""Ends of the bones whose length is held; fingers are virtual in most data."""
FARTHEST = 10.0
"""Standard deviations from the mean to which inputs are held."""


@dataclass(frozen=True)
class MasonConfig:
    """Everything that decides a training.

    Attributes
    ----------
    backbone, modulation : which of the seven models.
    hidden, clip_channels, film_hidden, rank : widths; the paper's are the defaults.
    clip_frames : of a style clip at 60 fps.
    dropout : in front of every layer.
    n_steps, batch, rate : Adam steps of one style each, styles in turn.
    bone : weight of the bone length loss, in metres.
    as_released : phase features as the released exporter has them instead of equation 1.
    styles : labels seen in training, sorted; filled in by the training.
    phase_shift : where in the left toe's cycle PFNN's phase is 0, cycles; filled in by the training.
    """

    backbone: Backbone
    modulation: Modulation
    hidden: int = 512
    clip_channels: int = 256
    film_hidden: int = 2048
    rank: int = 30
    clip_frames: int = 240
    dropout: float = 0.3
    n_steps: int = 300_000
    batch: int = 32
    rate: float = 1e-4
    bone: float = 1.0
    as_released: bool = False
    styles: tuple[str, ...] = ()
    phase_shift: float = 0.0

    @property
    def layout(self) -> Layout:
        return layout_of(self.backbone)

    @property
    def size(self) -> ModelSize:
        layout = self.layout
        return ModelSize(
            self.backbone, self.modulation, n_input=layout.n_input, n_output=layout.n_output,
            n_styles=len(self.styles), hidden=self.hidden, clip_frames=self.clip_frames,
            clip_features=layout.n_pose, clip_channels=self.clip_channels, film_hidden=self.film_hidden,
            rank=self.rank, dropout=self.dropout,
        )  # fmt: skip


MODELS: dict[str, tuple[Backbone, Modulation]] = {
    "pfnn-onehot": ("pfnn", "onehot"),
    "lpn-onehot": ("lpn", "onehot"),
    "pfnn-resad": ("pfnn", "resad"),
    "lpn-resad": ("lpn", "resad"),
    "pfnn-film": ("pfnn", "film"),
    "mann-film": ("mann", "film"),
    "lpn-film": ("lpn", "film"),
}
"""The rows of Table 2."""


def config_of(model: str, budget: str) -> MasonConfig:
    """The config of a row of Table 2 at a budget."""
    config = MasonConfig(*MODELS[model])
    if budget == "paper":
        return config
    if budget == "smoke":
        return replace(config, hidden=16, clip_channels=8, film_hidden=16, rank=4, n_steps=3, batch=4)
    return replace(config, hidden=256, clip_channels=64, film_hidden=256, n_steps=9000, rate=5e-4, dropout=0.1)


class MasonNetwork(nn.Module):
    """A model with the normalisation of its frames."""

    def __init__(self, config: MasonConfig) -> None:
        super().__init__()
        self.config = config
        self.model = StyleModel(config.size)
        self.input_scale = Standardise(config.layout.n_input)
        self.output_scale = Standardise(config.layout.n_output)
        self.clip_scale = Standardise(config.layout.n_pose)

    def code(self, clips: Tensor, styles: Tensor | None) -> Tensor:
        """Style codes of clips ``[B, F, 12 J]``, or of weights of the known styles ``[B, n_styles]``."""
        code: Tensor = self.model.code(styles, self.clip_scale(clips))
        return code

    def standard(self, inputs: Tensor, gates: Tensor, code: Tensor) -> Tensor:
        """Standardised inputs ``[B, n_input]`` to standardised outputs ``[B, n_output]``."""
        result: Tensor = self.model(inputs, gates, code)
        return result

    def forward(self, inputs: Tensor, gates: Tensor, code: Tensor) -> Tensor:
        """Inputs ``[B, n_input]`` to outputs ``[B, n_output]`` in their own units.

        Inputs far from everything that training saw are held: what is fed back must not grow without end.
        """
        known = self.input_scale(inputs).clamp(-FARTHEST, FARTHEST)
        result: Tensor = self.output_scale.inverse(self.standard(known, gates, code))
        return result


def l_mse(true: Tensor, predicted: Tensor) -> Tensor:
    """Equation 5a on standardised outputs ``[B, n_output]``, a mean over frames and features."""
    return (predicted - true).square().mean()


def l_bll(true_pose: Tensor, predicted_pose: Tensor) -> Tensor:
    """Equations 5b and 5c: mean absolute difference of bone lengths of poses ``[B, 12 J]``, metres."""
    return (_bone_lengths_m(predicted_pose) - _bone_lengths_m(true_pose)).abs().mean()


def _bone_lengths_m(pose: Tensor) -> Tensor:
    positions = pose.view(len(pose), -1, PER_JOINT)[..., :3]
    child, parent = list(BONES), [CANONICAL_PARENTS[joint] for joint in BONES]
    lengths: Tensor = torch.linalg.vector_norm(positions[:, child] - positions[:, parent], dim=-1)
    return lengths


class MasonTraining(Trainable):
    """One style a step, styles in a fixed order (section 4.3).

    ``trained`` are the parts of the network that move: all of it, or the style modulation alone for new styles.
    """

    def __init__(
        self,
        network: MasonNetwork,
        examples: Mapping[str, StyleExamples],
        generator: torch.Generator,
        trained: nn.Module | None = None,
    ) -> None:
        self.network = network
        self.trained = network.model if trained is None else trained
        self.config = network.config
        self.generator = generator
        device = next(network.parameters()).device
        self.styles = sorted(examples)
        self.frames = [
            [_tensor(array).to(device) for array in (e.inputs, e.gates, e.outputs, e.clips)]
            for e in (examples[style] for style in self.styles)
        ]
        self.optimiser = torch.optim.Adam(self.trained.parameters(), lr=self.config.rate)

    def step(self, index: int) -> Losses:
        network, config = self.network, self.config
        style = index % len(self.styles)
        inputs, gates, outputs, clips = self.frames[style]
        rows = torch.randint(len(inputs), (config.batch,), generator=self.generator).to(inputs.device)
        start = int(torch.randint(max(len(clips) - config.clip_frames, 0) + 1, (1,), generator=self.generator))
        frames = (start + torch.arange(config.clip_frames, device=clips.device)) % len(clips)
        network.train()
        code = network.code(clips[None, frames], self._one_hot(style, inputs)).expand(config.batch, -1)
        true = network.output_scale(outputs[rows])
        predicted = network.standard(network.input_scale(inputs[rows]), gates[rows], code)
        mse = l_mse(true, predicted)
        pose = config.layout.pose
        bll = l_bll(outputs[rows][:, pose], network.output_scale.inverse(predicted)[:, pose])
        self.optimiser.zero_grad(set_to_none=True)
        (mse + config.bone * bll).backward()  # type: ignore[no-untyped-call]
        self.optimiser.step()
        return {"mse": mse, "bll": bll}

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser}

    def _one_hot(self, style: int, like: Tensor) -> Tensor | None:
        if self.config.modulation == "film":
            return None
        code = torch.zeros(1, len(self.config.styles), device=like.device)
        code[0, self.config.styles.index(self.styles[style])] = 1.0
        return code


def train_mason(config: MasonConfig, request: FitRequest) -> tuple[MasonConfig, MasonNetwork, Curves]:
    """Train one model on the takes that travel."""
    request.progress("phases and frames", 0, 1)
    examples, shift = examples_of(locomotion(request.takes), config.backbone, as_released=config.as_released)
    config = replace(config, styles=tuple(sorted(examples)), phase_shift=shift)
    with seeded(request.seed, request.device) as generator:
        network = MasonNetwork(config)
        standardise(network, list(examples.values()))
        network.to(request.device)
        training = MasonTraining(network, examples, generator)
        curves = train(training, config.n_steps, progress=request.progress, checkpoints=request.checkpoints)
    return config, network, curves


def standardise(network: MasonNetwork, examples: Sequence[StyleExamples]) -> None:
    """Take the statistics of inputs, outputs and clips over all styles."""
    network.input_scale.fit(torch.cat([_tensor(e.inputs) for e in examples])[:, None])
    network.output_scale.fit(torch.cat([_tensor(e.outputs) for e in examples])[:, None])
    network.clip_scale.fit(torch.cat([_tensor(e.clips) for e in examples])[:, None])


def _tensor(array: FloatArray) -> Tensor:
    return torch.from_numpy(array.astype(np.float32))


def fine_tune(
    network: MasonNetwork, examples: Mapping[str, StyleExamples], n_steps: int, request: FitRequest
) -> Curves:
    """Learn styles that were not seen, by training the FiLM generator alone (section 5.3.2).

    Nothing else moves, so a style whose FiLM parameters were kept beforehand (section 4.4) answers as before.

    Raises
    ------
    ValueError : the model is not modulated by FiLM.
    """
    film = network.model.modulation
    if not isinstance(film, Film):
        raise ValueError(f"only FiLM learns new styles by itself, this model has {network.config.modulation}")
    with seeded(request.seed, request.device) as generator:
        training = MasonTraining(network, examples, generator, trained=film)
        return train(training, n_steps, progress=request.progress, name="new styles", checkpoints=request.checkpoints)
