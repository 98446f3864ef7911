"""Mason et al. 2022, Real-Time Style Modelling of Human Locomotion: the seven rows of its Table 2."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from bench.adapters.base import Stream, Traits
from bench.adapters.learned import LearnedAdapter
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.mason2022.mason2022 import MasonConfig, MasonNetwork
    from bench.methods.training import Curves, FitRequest

_BY_LABEL = Traits(needs_style_label=True, look_ahead_frames=0)
_BY_CLIP = Traits(look_ahead_frames=0)


class _Mason2022(LearnedAdapter["MasonConfig", "MasonNetwork"]):
    """A model of the next frame; trained on the takes of the fit part that travel."""

    model: ClassVar[str]

    def configs(self) -> type[MasonConfig]:
        from bench.methods.mason2022.mason2022 import MasonConfig

        return MasonConfig

    def build(self, config: MasonConfig) -> MasonNetwork:
        from bench.methods.mason2022.mason2022 import MasonNetwork

        return MasonNetwork(config)

    def train(self, request: FitRequest) -> tuple[MasonConfig, MasonNetwork, Curves]:
        from bench.methods.mason2022.mason2022 import config_of, train_mason

        return train_mason(config_of(self.model, request.budget), request)

    def predict(self, past: Clip, style: Take, trajectory_xz_m: FloatArray) -> Clip:
        from bench.methods.mason2022.streaming import code_of, predict

        return predict(self.network, code_of(self.network, style), past, trajectory_xz_m)

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        from bench.methods.mason2022.streaming import FollowingStream, code_of

        return FollowingStream(self.network, code_of(self.network, style), style.clip.skeleton, style.clip.fps)

    def bytes_per_style(self) -> int:
        from bench.methods.mason2022.network import numbers_per_style

        return 4 * numbers_per_style(self.config.size)


class PfnnOneHot(_Mason2022):
    """Global phase, label beside the input (Holden et al. 2017)."""

    name, title, model = "pfnn-onehot", "PFNN one-hot", "pfnn-onehot"
    description = "next frame by four phase-blended experts; style as a one-hot input"
    traits = _BY_LABEL


class LpnOneHot(_Mason2022):
    """Local phases, label beside the input."""

    name, title, model = "lpn-onehot", "LPN one-hot", "lpn-onehot"
    description = "next frame by eight experts gated by local phases; style as a one-hot input"
    traits = _BY_LABEL


class PfnnResad(_Mason2022):
    """Global phase, residual adapters (Mason et al. 2018)."""

    name, title, model = "pfnn-resad", "PFNN residual adapter", "pfnn-resad"
    description = "next frame by four phase-blended experts; one rank-30 residual adapter a style"
    traits = _BY_LABEL


class LpnResad(_Mason2022):
    """Local phases, residual adapters."""

    name, title, model = "lpn-resad", "LPN residual adapter", "lpn-resad"
    description = "next frame by eight experts gated by local phases; one residual adapter a style"
    traits = _BY_LABEL


class PfnnFilm(_Mason2022):
    """Global phase, FiLM."""

    name, title, model = "pfnn-film", "PFNN FiLM", "pfnn-film"
    description = "next frame by four phase-blended experts; FiLM parameters from a style clip"
    traits = _BY_CLIP


class MannFilm(_Mason2022):
    """No phase, FiLM."""

    name, title, model = "mann-film", "MANN FiLM", "mann-film"
    description = "next frame by eight experts gated by velocities of hands and feet; FiLM from a style clip"
    traits = _BY_CLIP


class LpnFilm(_Mason2022):
    """The paper's model: local phases, FiLM."""

    name, title, model = "lpn-film", "LPN FiLM", "lpn-film"
    description = "next frame by eight experts gated by local phases; FiLM parameters from a style clip"
    traits = _BY_CLIP


MASON_2022: tuple[type[_Mason2022], ...] = (
    PfnnOneHot, LpnOneHot, PfnnResad, LpnResad, PfnnFilm, MannFilm, LpnFilm,
)  # fmt: skip
"""In the order of Table 2."""
