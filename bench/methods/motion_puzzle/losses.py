"""Losses and style mixing of Motion Puzzle (Jang et al. 2022, section 5, eq. 15-20 and algorithm 1)."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor
from torch.nn import functional

from bench.methods.motion_puzzle.network import PartStyles, PuzzleNetwork, StyleFeatures, whole_body

N_PARTS = 5
GROUPS_OF_CODE = ((0, 1), (2,), (3, 4))
"""The released code mixes legs, spine and arms, not five parts."""


def losses_of(
    network: PuzzleNetwork, source: Tensor, target: Tensor, from_source: tuple[int, ...], *, faithful_to_code: bool
) -> dict[str, Tensor]:
    """The terms of eq. 20 for normalised motions ``[B, C, T, 21]``; parts in ``from_source`` keep the source's style.

    The released code has no root loss, halves the cycle terms, and has no style cycle where styles were mixed.
    """
    content, other_content = network.content(torch.cat([source, target])).chunk(2)
    style, other_style = halves(network.style(torch.cat([source, target])))
    style_cycle = not (faithful_to_code and from_source)
    pairs = [
        (content, whole_body(style)),
        (other_content, whole_body(other_style)),
        (content, mixed_styles(style, other_style, from_source)),
    ]
    if style_cycle and from_source:
        pairs.append((content, whole_body(other_style)))
    rebuilt, other_rebuilt, mixed, *more = network.decode_together(pairs)
    transferred = more[0] if more else mixed
    cycles = [(network.content(mixed), whole_body(style))]
    if style_cycle:
        cycles.append((other_content, whole_body(network.style(transferred))))
    outputs = [rebuilt, other_rebuilt, *network.decode_together(cycles)]
    wanted = [source, target, source, target][: len(outputs)]
    errors = [functional.l1_loss(output, motion) for output, motion in zip(outputs, wanted, strict=True)]
    losses = {
        "rec": errors[0] + errors[1],
        "cyc": torch.stack(errors[2:]).sum(),
        "sm": torch.stack([smoothness(output, motion) for output, motion in zip(outputs, wanted, strict=True)]).sum(),
    }
    if not faithful_to_code:
        losses["root"] = root_loss(mixed, source)
    return losses


def weights_of(*, faithful_to_code: bool) -> Mapping[str, float]:
    """Lambdas of eq. 20: all 1 in the paper."""
    return {"rec": 1.0, "cyc": 0.5 if faithful_to_code else 1.0, "root": 1.0, "sm": 1.0}


def root_loss(output: Tensor, source: Tensor) -> Tensor:
    """Eq. 17: root velocities, the last three of 15 channels, stay the source's."""
    return functional.l1_loss(output[:, 12:], source[:, 12:])


def smoothness(output: Tensor, motion: Tensor) -> Tensor:
    """Eq. 18: differences of successive frames."""
    return functional.l1_loss(output.diff(dim=2), motion.diff(dim=2))


def halves(features: StyleFeatures) -> tuple[StyleFeatures, StyleFeatures]:
    """Style features of two batches that were encoded as one."""
    joint, mid, part, last = (level.chunk(2) for level in features)
    return (joint[0], mid[0], part[0], last[0]), (joint[1], mid[1], part[1], last[1])


def mixed_styles(style: StyleFeatures, other: StyleFeatures, from_source: tuple[int, ...]) -> PartStyles:
    """Algorithm 1, its result: the source's style for the chosen parts, the target's for the rest."""
    return [[(style if part in from_source else other, 1.0)] for part in range(N_PARTS)]


def drawn_parts(probability: float, generator: torch.Generator, *, faithful_to_code: bool) -> tuple[int, ...]:
    """Algorithm 1, its draw: with ``probability`` 1 to 5 parts (1 to 3 groups in the released code), else none."""
    if float(torch.rand(1, generator=generator)) >= probability:
        return ()
    choices = GROUPS_OF_CODE if faithful_to_code else tuple((part,) for part in range(N_PARTS))
    n = int(torch.randint(1, len(choices) + 1, (1,), generator=generator))
    order = torch.randperm(len(choices), generator=generator)[:n].tolist()
    return tuple(sorted(part for place in order for part in choices[place]))
