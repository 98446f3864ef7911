"""What BP-ATN looks at (Jang et al. 2022, Figure 9): which frames of the style a frame of the content uses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

import numpy as np
from torch import Tensor, nn

from bench.arrays import FloatArray
from bench.errors import BadConfig
from bench.methods.motion_puzzle.graphs import PART_NAMES
from bench.methods.motion_puzzle.motion_puzzle import MotionPuzzle, Styles
from bench.methods.motion_puzzle.network import PartAttention
from bench.methods.windows import FPS
from bench.motion.clip import Clip
from bench.motion.edit import resample

AttentionInput: TypeAlias = tuple[Tensor, Sequence[tuple[Tensor, float]]]
"""What a PartAttention layer is called with: ``[1, C, T, V]`` and a mixture of ``[1, C, T', V]``."""


def attention_maps(model: MotionPuzzle, content: Clip, style: Clip) -> dict[str, FloatArray]:
    """Body part -> ``[T, T']`` at 30 fps: attention on the finest graph from content frames to style frames.

    Summed over the style's joints in the part and averaged over the content's, so that a row sums to 1, but for what
    falls on padding.

    Raises
    ------
    BadConfig : a variant without attention on that graph.
    """
    attention = getattr(model.network.decoder.joint, "attention", None)
    layers = [layer for layer in attention or () if isinstance(layer, PartAttention)]
    if not layers:
        raise BadConfig(
            "this variant of Motion Puzzle has no attention on the graph of joints",
            remedy="ask motion-puzzle or motion-puzzle-released",
        )
    found: list[Tensor] = []
    hooks = [layer.register_forward_pre_hook(_kept_in(found, layer)) for layer in layers]
    styles: Styles = [(style, 1.0)]
    try:
        model.transfer(content, {part: styles for part in PART_NAMES})
    finally:
        for hook in hooks:
            hook.remove()
    n_content, n_style = resample(content, FPS).n_frames, resample(style, FPS).n_frames
    maps = zip(PART_NAMES, found, strict=True)
    return {part: shares.numpy().astype(np.float64)[:n_content, :n_style] for part, shares in maps}


def _kept_in(found: list[Tensor], layer: PartAttention) -> Callable[[nn.Module, AttentionInput], None]:
    def keep(_: nn.Module, given: AttentionInput) -> None:
        x, [(style, _weight)] = given
        by_place = layer.attention_map(x, style)[0]
        by_node = by_place.view(x.shape[2], x.shape[3], style.shape[2], style.shape[3])  # [T, V, T', V]
        found.append(by_node.sum(dim=3).mean(dim=1))

    return keep
