"""Holden et al. 2016, A Deep Learning Framework for Character Motion Synthesis and Editing: the row ``holden2016``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.holden2016.holden2016 import Holden2016Config
    from bench.methods.holden2016.network import MotionAutoencoder
    from bench.methods.training import Curves, FitRequest


class Holden2016(LearnedAdapter["Holden2016Config", "MotionAutoencoder"]):
    """Every transfer is an optimisation: the content's hidden units, the style's Gram matrix, then constraints."""

    name = "holden2016"
    title = "Holden 2016"
    description = "hidden units of a convolutional autoencoder optimised towards the style's Gram matrix"
    traits = Traits(designed_input_frames=120)

    def configs(self) -> type[Holden2016Config]:
        from bench.methods.holden2016.holden2016 import Holden2016Config

        return Holden2016Config

    def build(self, config: Holden2016Config) -> MotionAutoencoder:
        from bench.methods.holden2016.holden2016 import build

        return build(config)

    def train(self, request: FitRequest) -> tuple[Holden2016Config, MotionAutoencoder, Curves]:
        from bench.methods.holden2016.holden2016 import CONFIGS, train_holden

        return train_holden(CONFIGS[request.budget], request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        from bench.methods.holden2016.holden2016 import transfer

        return transfer(self.network, self.config, content.clip, style.clip, rng)
