"""Style-ERD: sizes as printed, streams that equal whole clips, copies that go on alone, mixtures of styles."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import torch

from bench.datasets.procedural.dataset import load as load_procedural
from bench.errors import BadInput
from bench.methods.layers import n_parameters
from bench.methods.style_erd.network import Shape, StyleErd
from bench.methods.style_erd.streaming import StyleErdStream, transfer
from bench.methods.style_erd.style_erd import StyleErdConfig, StyleErdNetwork
from bench.motion.clip import Clip

XIA = Shape(n_rotations=124, n_positions=60, n_styles=7, n_contents=5)


def test_parameter_counts_as_printed_and_as_released() -> None:
    paper, released = StyleErd(XIA), StyleErd(replace(XIA, neutral_layers=4, style_layers=6, decoder_labels=False))
    assert n_parameters(paper) == 377_604
    assert n_parameters(released) == 479_236
    assert n_parameters(paper.styles[0]) == 34_048
    assert n_parameters(released.styles[0]) == 51_072


@cache
def network() -> StyleErdNetwork:
    torch.manual_seed(0)
    config = StyleErdConfig().with_labels(("neutral", "old", "proud"), ("run", "walk"))
    return StyleErdNetwork(config).eval()


@cache
def clip() -> Clip:
    return next(take.clip for take in load_procedural(None).takes if take.content == "walk")


def stepped(stream: StyleErdStream, first: int, last: int) -> list[np.ndarray[tuple[int, ...], np.dtype[np.float64]]]:
    frames = zip(clip().rotations_wxyz[first:last], clip().root_xyz_m[first:last], strict=True)
    return [stream.step(rotations, root)[0] for rotations, root in frames]


def test_a_stream_equals_the_whole_clip() -> None:
    whole = transfer(network(), clip(), "walk", [("old", 1.0)])
    stream = StyleErdStream(network(), "walk", [("old", 1.0)])
    assert np.allclose(np.stack(stepped(stream, 0, 30)), whole.rotations_wxyz[:30], atol=1e-5)


def test_streams_do_not_share_states_and_a_copy_goes_on_by_itself() -> None:
    alone = stepped(StyleErdStream(network(), "walk", [("old", 1.0)]), 0, 20)
    one, other = (StyleErdStream(network(), "walk", [(style, 1.0)]) for style in ("old", "proud"))
    first = stepped(one, 0, 10)
    stepped(other, 5, 15)
    twin = one.copy()
    stepped(twin, 30, 35)
    assert all(np.array_equal(a, b) for a, b in zip(first + stepped(one, 10, 20), alone, strict=True))


def test_weights_are_intensities_and_mixtures_and_neutral_is_the_rest() -> None:
    weights = network().style_weights([("old", 0.25), ("neutral", 0.75)])
    assert weights.tolist() == [[0.25, 0.0]]
    assert network().style_weights([("old", 0.5), ("proud", 0.5)]).tolist() == [[0.5, 0.5]]
    with pytest.raises(BadInput, match="the model knows the styles neutral, old, proud, got 'sad'"):
        network().style_weights([("sad", 1.0)])


def test_a_content_that_is_not_known_is_a_little_of_each() -> None:
    assert network().content_weights("walk").tolist() == [[0.0, 1.0]]
    assert network().content_weights(None).tolist() == [[0.5, 0.5]]
