"""Park et al. 2021, Diverse Motion Stylization: the rows ``park2021*``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.park2021.park2021 import Park2021, ParkConfig
    from bench.methods.training import Curves, FitRequest


class Park(LearnedAdapter["ParkConfig", "Park2021"]):
    """All losses of the paper: adv, cyc, id, sty and ds."""

    name = "park2021"
    title = "Park 2021"
    description = "graph stylizer with AdaIN, style codes of a motion or of noise, one discriminator branch a style"
    traits = Traits(needs_style_label=True, designed_input_frames=64)
    variant: ClassVar[Mapping[str, Any]] = {}
    """fields of the config in which a row differs from the paper's form"""

    def configs(self) -> type[ParkConfig]:
        from bench.methods.park2021.park2021 import ParkConfig

        return ParkConfig

    def build(self, config: ParkConfig) -> Park2021:
        from bench.methods.park2021.park2021 import Park2021

        return Park2021(config)

    def train(self, request: FitRequest) -> tuple[ParkConfig, Park2021, Curves]:
        from bench.methods.park2021.park2021 import ParkConfig, train_park

        return train_park(ParkConfig(**self.variant).at(request.budget), request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate(content, [(style, 1.0)], rng=rng)

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return self.network.transfer(content.clip, [(self.network.code_of_latent(style_label, rng), 1.0)])

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        codes = [(self.network.code_of_reference(take.clip, take.style), weight) for take, weight in styles]
        return self.network.transfer(content.clip, codes)

    def bytes_per_style(self) -> int:
        from bench.methods.layers import n_parameters

        return 4 * n_parameters(self.network.style_encoder.heads[0])


class ParkWithoutStyleAndDiversity(Park):
    """Ablation of Table 1."""

    name = "park2021-adv-cyc-id"
    title = "Park 2021, L_adv + L_cyc + L_id"
    description = "Park 2021 trained without style reconstruction and diversity"
    variant: ClassVar[Mapping[str, Any]] = {"style": 0.0, "diversity": 0.0}


class ParkWithoutDiversity(Park):
    """Ablation of Table 1."""

    name = "park2021-sty"
    title = "Park 2021, L_adv + L_cyc + L_id + L_sty"
    description = "Park 2021 trained without diversity"
    variant: ClassVar[Mapping[str, Any]] = {"diversity": 0.0}


class ParkContent(Park):
    """Not in the paper: the same networks taught what content is."""

    name = "park2021-content"
    title = "Park 2021 + content labels"
    description = "Park 2021; discriminator branch a cell and own classifiers taught with fit content labels"
    variant: ClassVar[Mapping[str, Any]] = {"content": True}


PARK_2021 = (Park, ParkWithoutStyleAndDiversity, ParkWithoutDiversity, ParkContent)
