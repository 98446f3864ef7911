"""Aberman et al. 2020, Unpaired Motion Style Transfer from Video to Animation: the rows ``aberman2020*``."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.aberman2020.aberman2020 import AbermanConfig, AbermanNetwork
    from bench.methods.aberman2020.content import ContentConfig, ContentNetwork
    from bench.methods.training import Curves, FitRequest


class Aberman2020(LearnedAdapter["AbermanConfig", "AbermanNetwork"]):
    """The paper's method: style labels in training, none at transfer."""

    name = "aberman2020"
    title = "Aberman 2020"
    description = "content and style encoders, AdaIN decoder, one discriminator head a style"
    traits = Traits(designed_input_frames=32)

    def configs(self) -> type[AbermanConfig]:
        from bench.methods.aberman2020.aberman2020 import AbermanConfig

        return AbermanConfig

    def build(self, config: AbermanConfig) -> AbermanNetwork:
        from bench.methods.aberman2020.aberman2020 import AbermanNetwork

        return AbermanNetwork(config)

    def train(self, request: FitRequest) -> tuple[AbermanConfig, AbermanNetwork, Curves]:
        from bench.methods.aberman2020.aberman2020 import CONFIGS, train_aberman

        return train_aberman(CONFIGS[request.budget], request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate(content, [(style, 1.0)], rng=rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        from bench.methods.aberman2020.aberman2020 import transfer

        return transfer(self.network, content.clip, [(take.clip, weight) for take, weight in styles])


class Aberman2020Content(LearnedAdapter["ContentConfig", "ContentNetwork"]):
    """Aberman's encoders and AdaIN decoder with losses that know the content labels of the fit part."""

    name = "aberman2020-content"
    title = "Aberman 2020 + content labels"
    description = "Aberman's networks; cell discriminator and own classifiers taught with fit content labels"
    traits = Traits(designed_input_frames=64)

    def configs(self) -> type[ContentConfig]:
        from bench.methods.aberman2020.content import ContentConfig

        return ContentConfig

    def build(self, config: ContentConfig) -> ContentNetwork:
        from bench.methods.aberman2020.content import ContentNetwork

        return ContentNetwork(config)

    def train(self, request: FitRequest) -> tuple[ContentConfig, ContentNetwork, Curves]:
        from bench.methods.aberman2020.content import CONFIGS, train_content

        return train_content(CONFIGS[request.budget], request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate(content, [(style, 1.0)], rng=rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        from bench.methods.aberman2020.content import transfer

        return transfer(self.network, self.config, content.clip, [(take.clip, weight) for take, weight in styles])
