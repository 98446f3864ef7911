"""Jang et al. 2022, Motion Puzzle: the rows ``motion-puzzle*``."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from bench.adapters.base import Traits
from bench.adapters.learned import LearnedAdapter
from bench.datasets.take import Take
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.motion_puzzle.motion_puzzle import MotionPuzzle, PuzzleConfig
    from bench.methods.training import Curves, FitRequest

GROUPS = {
    "legs": ("left_leg", "right_leg"),
    "arms": ("left_arm", "right_arm"),
    "all": ("left_leg", "right_leg", "spine", "left_arm", "right_arm"),
}
"""Parts of the benchmark that are several of the method's."""


class Puzzle(LearnedAdapter["PuzzleConfig", "MotionPuzzle"]):
    """BP-StyleNets with BP-AdaIN and BP-ATN, trained without labels."""

    name = "motion-puzzle"
    title = "Motion Puzzle 2022"
    description = "graph encoders and decoder, style injected part by part with AdaIN and attention; no labels"
    traits = Traits(designed_input_frames=64)
    variant: ClassVar[Mapping[str, Any]] = {}
    """fields of the config in which a row differs from the paper's form"""

    def configs(self) -> type[PuzzleConfig]:
        from bench.methods.motion_puzzle.motion_puzzle import PuzzleConfig

        return PuzzleConfig

    def build(self, config: PuzzleConfig) -> MotionPuzzle:
        from bench.methods.motion_puzzle.motion_puzzle import MotionPuzzle

        return MotionPuzzle(config)

    def train(self, request: FitRequest) -> tuple[PuzzleConfig, MotionPuzzle, Curves]:
        from bench.methods.motion_puzzle.motion_puzzle import PuzzleConfig, train_puzzle

        return train_puzzle(PuzzleConfig(**self.variant).at(request.budget), request)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.interpolate_parts(content, "all", [(style, 1.0)], rng=rng)

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        return self.interpolate_parts(content, "all", styles, rng=rng)

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        mixture = [(take.clip, weight) for take, weight in styles]
        return self.network.transfer(content.clip, dict.fromkeys(GROUPS.get(part, (part,)), mixture))

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        mixtures = {one: [(take.clip, 1.0)] for part, take in styles.items() for one in GROUPS.get(part, (part,))}
        return self.network.transfer(content.clip, mixtures)


class PuzzleReleased(Puzzle):
    """What the released code does: 12 channels, pooling that shares joints, no root loss, no temporal cropping."""

    name = "motion-puzzle-released"
    title = "Motion Puzzle 2022, as released"
    description = "Motion Puzzle as its released code has it: no root features, shared pooling, other weights"
    variant: ClassVar[Mapping[str, Any]] = {"faithful_to_code": True, "betas": (0.9, 0.999), "cropping": 0.0}


class PuzzleWithoutAttention(Puzzle):
    """Ablation of figure 17."""

    name = "motion-puzzle-no-attention"
    title = "Motion Puzzle 2022 w/o BP-ATN"
    description = "Motion Puzzle with BP-AdaIN alone"
    variant: ClassVar[Mapping[str, Any]] = {"attention": False}


class PuzzleWholeBody(Puzzle):
    """Ablation of figure 17."""

    name = "motion-puzzle-stgcn-adain"
    title = "Motion Puzzle 2022, STGCN+AdaIN"
    description = "Motion Puzzle's graphs with one AdaIN for the whole body and no attention"
    variant: ClassVar[Mapping[str, Any]] = {"attention": False, "by_part": False}


class PuzzleRealTime(Puzzle):
    """The smaller network of section 7.3."""

    name = "motion-puzzle-real-time"
    title = "Motion Puzzle 2022, real-time"
    description = "Motion Puzzle without residual blocks, BP-StyleNets on the 5- and 10-node graphs only"
    variant: ClassVar[Mapping[str, Any]] = {"real_time": True}


MOTION_PUZZLE = (Puzzle, PuzzleReleased, PuzzleWithoutAttention, PuzzleWholeBody, PuzzleRealTime)
