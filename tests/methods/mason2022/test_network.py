"""Networks of Mason 2022: sizes as printed, splines, experts and modulations against plain loops."""

from __future__ import annotations

import pytest
import torch

from bench.methods.layers import n_parameters
from bench.methods.mason2022.network import (
    Backbone,
    BlendedLinear,
    Film,
    ModelSize,
    Modulation,
    PhaseResidualAdapter,
    ResidualAdapter,
    StyleModel,
    catmull_rom,
    layer_norm,
    modulation_of,
    numbers_per_style,
)

N_OUTPUT = {"pfnn": 327, "mann": 326, "lpn": 342}


def paper_size(backbone: Backbone, modulation: Modulation) -> ModelSize:
    return ModelSize(backbone, modulation, n_input=348, n_output=N_OUTPUT[backbone], n_styles=95)


def small(backbone: Backbone, modulation: Modulation) -> ModelSize:
    return ModelSize(
        backbone, modulation, n_input=7, n_output=5, n_styles=3, hidden=6, clip_frames=16, clip_features=4,
        film_hidden=8, rank=2, dropout=0.0,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("backbone", "modulation", "synthesis", "styles", "per_style"),
    [
        ("pfnn", "onehot", 2_436_380, 194_560, 2_048),
        ("lpn", "onehot", 4_935_928, 389_120, 4_096),
        ("pfnn", "resad", 2_436_380, 2_978_440, 31_352),
        ("lpn", "resad", 4_935_928, 24_952_320, 262_656),
        # The published 35,668,530 counts each convolution as 256 x 25 + 25 numbers (protocols, Mason Table 2).
        ("pfnn", "film", 2_436_380, 39_214_592, 2_048),
        ("mann", "film", 4_870_392, 39_214_592, 2_048),
        ("lpn", "film", 4_935_928, 39_214_592, 2_048),
    ],
)
def test_parameter_counts_of_table_2(
    backbone: Backbone, modulation: Modulation, synthesis: int, styles: int, per_style: int
) -> None:
    size = paper_size(backbone, modulation)
    with torch.device("meta"):
        model = StyleModel(size)
    assert n_parameters(model.synthesis) == synthesis
    assert n_parameters(model.modulation) == styles
    assert numbers_per_style(size) == per_style


def test_published_film_count_is_a_slip_of_the_convolutions() -> None:
    with torch.device("meta"):
        film = Film(paper_size("lpn", "film"))
    kernels = (300 * 256 + 256 * 256) * 25 + 2 * 256
    slip = 2 * (256 * 25 + 25)
    assert n_parameters(film) - kernels + slip == 35_668_530


def test_spline_passes_its_control_points_and_is_smooth() -> None:
    assert torch.allclose(catmull_rom(torch.tensor([0.0, 0.25, 0.5, 0.75, 1.0])), torch.eye(4)[[0, 1, 2, 3, 0]])
    assert torch.allclose(catmull_rom(torch.tensor([0.125])), torch.tensor([[9.0, 9.0, -1.0, -1.0]]) / 16.0)
    phase = torch.linspace(-1.0, 2.0, 3001, dtype=torch.float64)
    weights = catmull_rom(phase)
    assert torch.allclose(weights.sum(dim=1), torch.ones_like(phase))
    slope = (weights[1:] - weights[:-1]) / (phase[1] - phase[0])
    assert (slope[1:] - slope[:-1]).abs().max() < 0.1


def test_blended_layer_is_one_affine_map_a_sample() -> None:
    layer = BlendedLinear(3, 4, 2)
    torch.nn.init.normal_(layer.bias)
    x, blend = torch.randn(5, 4), torch.rand(5, 3)
    for sample in range(5):
        weight = torch.stack([blend[sample, e] * layer.weight[e] for e in range(3)]).sum(dim=0)
        bias = torch.stack([blend[sample, e] * layer.bias[e] for e in range(3)]).sum(dim=0)
        assert torch.allclose(layer(x, blend)[sample], weight @ x[sample] + bias, atol=1e-6)


def test_layer_norm_uses_the_sample_deviation() -> None:
    assert torch.allclose(layer_norm(torch.tensor([[1.0, 2.0, 3.0]])), torch.tensor([[-1.0, 0.0, 1.0]]), atol=1e-5)


def test_adapter_adds_the_wanted_style_s_own_map() -> None:
    adapter = ResidualAdapter(small("lpn", "resad"))
    torch.nn.init.normal_(adapter.bias)
    features, below, code = torch.randn(2, 6), torch.randn(2, 6), torch.tensor([[0.0, 1.0, 0.0], [0.25, 0.0, 0.75]])
    found = adapter.second(features, below, code, torch.ones(2, 8) / 8)
    for sample in range(2):
        own = [code[sample, s] * (adapter.weight[s] @ below[sample] + adapter.bias[s]) for s in range(3)]
        added = torch.stack(own).sum(dim=0)
        assert torch.allclose(found[sample], torch.nn.functional.elu(features[sample] + added), atol=1e-6)


def test_phase_adapter_is_a_product_with_a_diagonal_that_follows_the_phase() -> None:
    adapter = PhaseResidualAdapter(small("pfnn", "resad"))
    torch.nn.init.normal_(adapter.middle)
    features, below, code = torch.randn(1, 6), torch.randn(1, 6), torch.tensor([[0.0, 0.0, 1.0]])
    blend = catmull_rom(torch.tensor([0.4]))
    diagonal = torch.diag((blend @ adapter.middle[2])[0])
    added = adapter.up[2] @ diagonal @ adapter.down[2] @ below[0] + adapter.bias[2]
    found = adapter.second(features, below, code, blend)
    assert torch.allclose(found[0], torch.nn.functional.elu(features[0] + added), atol=1e-6)


@pytest.mark.parametrize("backbone", ["pfnn", "mann", "lpn"])
@pytest.mark.parametrize("modulation", ["onehot", "resad", "film"])
def test_style_changes_the_next_frame_and_samples_do_not_mix(backbone: Backbone, modulation: Modulation) -> None:
    torch.manual_seed(0)
    model = StyleModel(small(backbone, modulation)).eval()
    x, signal = torch.randn(4, 7), torch.rand(4, model.size.n_gate)
    one = torch.eye(3)[[0, 0, 1, 1]]
    clip = torch.randn(4, 16, 4)
    code = model.code(one, clip)
    together = model(x, signal, code)
    assert together.shape == (4, 5)
    alone = torch.cat([model(x[i : i + 1], signal[i : i + 1], code[i : i + 1]) for i in range(4)])
    assert torch.allclose(together, alone, atol=1e-6)
    assert not torch.allclose(model(x, signal, code.flip(0)), together, atol=1e-4)


def test_a_model_without_what_tells_the_style_refuses() -> None:
    with pytest.raises(ValueError, match="FiLM reads a style off a clip"):
        StyleModel(small("lpn", "film")).code(torch.eye(3)[:1], None)
    with pytest.raises(ValueError, match="onehot knows styles by label"):
        StyleModel(small("lpn", "onehot")).code(None, torch.zeros(1, 16, 4))


def test_film_scales_and_shifts_both_layers() -> None:
    film = modulation_of(small("lpn", "film"))
    features, code = torch.randn(2, 6), torch.randn(2, 24)
    expected = torch.nn.functional.elu(code[:, 12:18] * layer_norm(features) + code[:, 18:])
    assert torch.allclose(film.second(features, torch.zeros(2, 6), code, torch.ones(2, 8)), expected)
