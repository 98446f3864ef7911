"""Conv1D+AdaIN, a baseline of Jang et al. 2022 (Motion Puzzle): the row ``conv1d-adain``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.conv1d_adain.conv1d_adain import ConvAdainConfig, ConvAdainNetwork
    from bench.methods.training import Curves, FitRequest


class Conv1dAdain(LearnedAdapter["ConvAdainConfig", "ConvAdainNetwork"]):
    """Aberman's encoders and AdaIN decoder, Motion Puzzle's features and losses; no labels, no discriminator."""

    name = "conv1d-adain"
    title = "Conv1D+AdaIN"
    description = "Aberman's convolutions and AdaIN, trained without labels by Motion Puzzle's losses"
    traits = Traits(designed_input_frames=64)

    def configs(self) -> type[ConvAdainConfig]:
        from bench.methods.conv1d_adain.conv1d_adain import ConvAdainConfig

        return ConvAdainConfig

    def build(self, config: ConvAdainConfig) -> ConvAdainNetwork:
        from bench.methods.conv1d_adain.conv1d_adain import ConvAdainNetwork

        return ConvAdainNetwork(config)

    def train(self, request: FitRequest) -> tuple[ConvAdainConfig, ConvAdainNetwork, Curves]:
        from bench.methods.conv1d_adain.conv1d_adain import CONFIGS, train_conv_adain

        return train_conv_adain(CONFIGS[request.budget], request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate(content, [(style, 1.0)], rng=rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        from bench.methods.conv1d_adain.conv1d_adain import transfer

        return transfer(self.network, content.clip, [(take.clip, weight) for take, weight in styles])
