"""The auto-encoder's geometry and its loss."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from classifiers.autoencoder import Autoencoder, AutoencoderConfig, squared_half_angles


def about_x(angle_rad: float) -> torch.Tensor:
    return torch.tensor([np.cos(angle_rad / 2), np.sin(angle_rad / 2), 0.0, 0.0], dtype=torch.float64)


@pytest.mark.parametrize("angle_rad", [1e-3, 0.3, 1.5, 3.0])
def test_half_angle_is_arccos_of_the_dot(angle_rad: float) -> None:
    one = about_x(0.0)
    assert float(squared_half_angles(one, about_x(angle_rad))) == pytest.approx((angle_rad / 2.0) ** 2, rel=1e-6)
    assert float(squared_half_angles(one, -about_x(angle_rad))) == pytest.approx((angle_rad / 2.0) ** 2, rel=1e-6)


def test_gradient_is_finite_where_output_equals_input() -> None:
    turned = about_x(0.4).requires_grad_()
    squared_half_angles(turned, about_x(0.4)).backward()  # type: ignore[no-untyped-call]
    assert turned.grad is not None and torch.isfinite(turned.grad).all()


def test_layers_take_24_frames_to_one_vector_and_back() -> None:
    torch.manual_seed(0)
    model = Autoencoder(AutoencoderConfig()).eval()
    rotations = torch.nn.functional.normalize(torch.randn(3, 24, 21, 4), dim=-1)
    assert model.encoder(rotations).shape == (3, 512)
    decoded = model(rotations)
    assert decoded.shape == rotations.shape
    assert torch.allclose(decoded.norm(dim=-1), torch.ones(3, 24, 21), atol=1e-5)


def test_encoder_reads_time_then_joints() -> None:
    """The first layer's window is four frames: a change in frame 5 leaves the first of six steps alone."""
    torch.manual_seed(0)
    encoder = Autoencoder(AutoencoderConfig()).eval().encoder
    first = encoder.layers[0]
    rotations = torch.randn(1, 24, 21, 4)
    changed = rotations.clone()
    changed[:, 5] += 1.0
    steps = [first(x.flatten(start_dim=2).transpose(1, 2)) for x in (rotations, changed)]
    differs = (steps[0] != steps[1]).any(dim=1)[0].tolist()
    assert differs == [False, True, False, False, False, False]
