"""Kuriyama et al. 2022: gestures transferred by swapping tokens; the paper's comparison and its ablations."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.kuriyama2022.method import GestureTransfer, KuriyamaConfig
    from bench.methods.training import Curves, FitRequest


class SoftSwap(LearnedAdapter["KuriyamaConfig", "GestureTransfer"]):
    """Every content token becomes a blend of style tokens."""

    name = "kuriyama-soft-swap"
    title = "Kuriyama 2022 soft swap"
    description = "gesture tokens blended by a style transformer (soft swap)"
    traits = Traits(designed_input_frames=640)
    swap: ClassVar[str] = "soft"
    without: ClassVar[str] = ""
    """loss that is left out"""
    positions: ClassVar[bool] = True

    def configs(self) -> type[KuriyamaConfig]:
        from bench.methods.kuriyama2022.method import KuriyamaConfig

        return KuriyamaConfig

    def build(self, config: KuriyamaConfig) -> GestureTransfer:
        from bench.methods.kuriyama2022.method import GestureTransfer

        return GestureTransfer(config)

    def train(self, request: FitRequest) -> tuple[KuriyamaConfig, GestureTransfer, Curves]:
        from bench.methods.kuriyama2022.losses import LOSSES
        from bench.methods.kuriyama2022.method import KuriyamaConfig, train_gestures

        losses = tuple(loss for loss in LOSSES if loss != self.without)
        return train_gestures(KuriyamaConfig(self.swap, losses, self.positions).at(request.budget), request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.network.transfer(content.clip, style.clip)


class WithoutPositions(SoftSwap):
    """Soft swap that finds style tokens by what they show, not by when; not in the paper."""

    name = "kuriyama-soft-swap-no-positions"
    title = "soft swap w/o position codes"
    description = "soft swap without position codes, which otherwise answer the identity loss; not in the paper"
    positions = False


class HardSwap(SoftSwap):
    """Every content token becomes the most similar style token."""

    name = "kuriyama-hard-swap"
    title = "Kuriyama 2022 hard swap"
    description = "gesture tokens replaced by the style token of largest learned similarity (eq. 19)"
    swap = "hard"


class AvatarNet(SoftSwap):
    """Every content token becomes the nearest style token, statistics taken out before and put in after."""

    name = "kuriyama-avatar-net"
    title = "Kuriyama 2022 Avatar-net"
    description = "whitened gesture tokens replaced by the style token of largest cosine (eq. 18)"
    swap = "avatar-net"


class LatentAdain(SoftSwap):
    """Mean and deviation over time of the latents are the style's."""

    name = "kuriyama-adain"
    title = "Kuriyama 2022 latent AdaIN"
    description = "latents of the gesture auto-encoder with the style's mean and deviation over time (eq. 17)"
    swap = "adain"


class WithoutIdentity(SoftSwap):
    """Ablation of Table 4."""

    name = "kuriyama-soft-swap-no-identity"
    title = "Kuriyama 2022 soft swap w/o identity loss"
    description = "soft swap trained without the identity loss"
    without = "identity"


class WithoutCyclic(SoftSwap):
    """Ablation of Table 4."""

    name = "kuriyama-soft-swap-no-cyclic"
    title = "Kuriyama 2022 soft swap w/o cyclic loss"
    description = "soft swap trained without the cyclic loss"
    without = "cyclic"


class WithoutStructure(SoftSwap):
    """Ablation of Table 4."""

    name = "kuriyama-soft-swap-no-structure"
    title = "Kuriyama 2022 soft swap w/o structure loss"
    description = "soft swap trained without the structure loss"
    without = "structure"


class WithoutAppearance(SoftSwap):
    """Ablation of Table 4."""

    name = "kuriyama-soft-swap-no-appearance"
    title = "Kuriyama 2022 soft swap w/o appearance loss"
    description = "soft swap trained without the appearance loss"
    without = "appearance"


KURIYAMA = (
    SoftSwap,
    WithoutPositions,
    HardSwap,
    AvatarNet,
    LatentAdain,
    WithoutIdentity,
    WithoutCyclic,
    WithoutStructure,
    WithoutAppearance,
)
