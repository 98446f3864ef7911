"""Tao et al. 2022, Style-ERD: the rows ``style_erd*``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bench.adapters.base import Stream, Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip
from bench.motion.skeleton import N_JOINTS

if TYPE_CHECKING:
    from bench.methods.style_erd.style_erd import StyleErdConfig, StyleErdNetwork
    from bench.methods.training import Curves, FitRequest


class StyleErd(LearnedAdapter["StyleErdConfig", "StyleErdNetwork"]):
    """The paper's method: one frame in, one frame out."""

    name = "style_erd"
    title = "Style-ERD 2022"
    description = "encoder, a recurrent branch a style, decoder; discriminator with attention; content and style labels"
    traits = Traits(needs_content_label=True, needs_style_label=True, designed_input_frames=1, look_ahead_frames=0)
    variant: ClassVar[Mapping[str, Any]] = {}
    """fields of the config in which a row differs from the paper's form"""

    def configs(self) -> type[StyleErdConfig]:
        from bench.methods.style_erd.style_erd import StyleErdConfig

        return StyleErdConfig

    def build(self, config: StyleErdConfig) -> StyleErdNetwork:
        from bench.methods.style_erd.style_erd import StyleErdNetwork

        return StyleErdNetwork(config)

    def train(self, request: FitRequest) -> tuple[StyleErdConfig, StyleErdNetwork, Curves]:
        from bench.methods.style_erd.style_erd import StyleErdConfig, train_style_erd

        return train_style_erd(StyleErdConfig(**self.variant).at(request.budget), request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate(content, [(style, 1.0)], rng=rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        from bench.methods.style_erd.streaming import transfer

        mixture = [(take.style, weight) for take, weight in styles]
        return transfer(self.network, content.clip, content.content, mixture)

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        from bench.methods.style_erd.streaming import StyleErdStream

        return StyleErdStream(self.network, content_label, [(style.style, 1.0)])

    def bytes_per_style(self) -> int:
        from bench.methods.layers import n_parameters

        return 4 * n_parameters(self.network.generator.styles[0])


class StyleErdReleased(StyleErd):
    """What the released code does: 4 neutral and 6 style layers, a decoder without labels, other weights of losses.

    The code's rotation loss is summed over the 24 frames and the joints of a window, with weight 0.05.
    """

    name = "style_erd-released"
    title = "Style-ERD 2022, as released"
    description = "Style-ERD as its released code has it: 4 neutral and 6 style layers, decoder without labels"
    variant: ClassVar[Mapping[str, Any]] = {
        "neutral_layers": 4, "style_layers": 6, "rotation": 0.05 * 24 * N_JOINTS, "decoder_labels": False,
        "penalty_of_mean": True,
    }  # fmt: skip


class StyleErdContent(StyleErd):
    """Not in the paper: the same networks taught what content and style are."""

    name = "style_erd-content"
    title = "Style-ERD 2022 + own classifiers"
    description = "Style-ERD with residual rotations, any pairs and cross entropies of own fit-part classifiers"
    variant: ClassVar[Mapping[str, Any]] = {
        "any_pairs": True, "residual": True, "content_class": 0.5, "style_class": 0.5, "n_frames": 32,
    }  # fmt: skip


class ReconstructionOnly(StyleErd):
    """Ablation of Table 1."""

    name = "style_erd-rec"
    title = "Style-ERD 2022, L_rec"
    description = "Style-ERD trained with the reconstruction loss alone"
    variant: ClassVar[Mapping[str, Any]] = {"adversarial": 0.0, "perceptual": 0.0}


class WithoutPerceptual(StyleErd):
    """Ablation of Table 1."""

    name = "style_erd-rec-adv"
    title = "Style-ERD 2022, L_rec + L_adv"
    description = "Style-ERD trained without the perceptual loss"
    variant: ClassVar[Mapping[str, Any]] = {"perceptual": 0.0}


class WithoutAdversarial(StyleErd):
    """Ablation of Table 1."""

    name = "style_erd-rec-per"
    title = "Style-ERD 2022, L_rec + L_per"
    description = "Style-ERD trained without the discriminator"
    variant: ClassVar[Mapping[str, Any]] = {"adversarial": 0.0}


class WithoutAttention(StyleErd):
    """Ablation of Table 1."""

    name = "style_erd-no-attention"
    title = "Style-ERD 2022 w/o attention"
    description = "Style-ERD with a discriminator of one score a style instead of FT-Att"
    variant: ClassVar[Mapping[str, Any]] = {"attention": False}


class WithoutLearnedStates(StyleErd):
    """Ablation of Table 1."""

    name = "style_erd-zero-states"
    title = "Style-ERD 2022 w/o learnt initial states"
    description = "Style-ERD whose recurrent branches begin with zeros"
    variant: ClassVar[Mapping[str, Any]] = {"learned_states": False}


STYLE_ERD = (
    StyleErd,
    StyleErdReleased,
    StyleErdContent,
    ReconstructionOnly,
    WithoutPerceptual,
    WithoutAdversarial,
    WithoutAttention,
    WithoutLearnedStates,
)
"""The paper's form, the released one, a variant of ours, and Table 1's ablations in its order."""
