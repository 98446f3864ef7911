"""Standardisation and the checks at the door."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from classifiers.data import (
    DEVIATION_FLOOR,
    BadArray,
    Standardise,
    checked_features,
    checked_labels,
    mean_rotations,
    one_hemisphere,
)


def some_features(n: int = 6) -> torch.Tensor:
    generator = torch.Generator().manual_seed(0)
    rotations = torch.randn(n, 8, 3, 4, generator=generator) * 0.1 + torch.tensor([1.0, 0.5, 0.0, 0.0])
    rotations = rotations / rotations.norm(dim=-1, keepdim=True)
    return torch.cat([torch.randn(n, 8, 3, 3, generator=generator), rotations], dim=-1)


def test_standardised_features_have_mean_zero_and_deviation_one_or_less() -> None:
    features = some_features(40)
    features[..., 0] = 7.0
    layer = Standardise(3, 7)
    layer.fit(features)
    result = layer(features)
    assert torch.allclose(result.mean(dim=(0, 1)), torch.zeros(3, 7), atol=1e-4)
    assert torch.allclose(result[..., 1].std(), torch.tensor(1.0), atol=0.05)
    assert torch.all(result[..., 0] == 0.0) and float(layer.deviation.min()) == pytest.approx(DEVIATION_FLOOR)


def test_signs_of_rotations_do_not_matter() -> None:
    features = some_features()
    layer = Standardise(3, 7)
    layer.fit(features)
    flipped = features.clone()
    flipped[::2, ..., 3:] *= -1.0
    assert torch.equal(layer(features), layer(flipped))
    other = Standardise(3, 7)
    other.fit(flipped)
    assert torch.allclose(other.reference_wxyz, layer.reference_wxyz, atol=1e-6)


def test_mean_rotation_lies_between() -> None:
    half = np.deg2rad([10.0, -10.0]) / 2.0
    pair = torch.tensor(np.stack([np.cos(half), np.sin(half), 0 * half, 0 * half], axis=-1), dtype=torch.float32)
    mean = mean_rotations(pair[:, None, None, :] * torch.tensor([1.0, -1.0])[:, None, None, None])
    assert torch.allclose(mean, torch.tensor([[1.0, 0.0, 0.0, 0.0]]), atol=1e-6)
    assert torch.equal(one_hemisphere(-mean, mean), mean)


@pytest.mark.parametrize("shape", [(4, 8, 3), (0, 8, 3, 7), (4, 8, 3, 6)])
def test_features_of_another_shape_are_refused(shape: tuple[int, ...]) -> None:
    with pytest.raises(BadArray, match=r"must have shape \[n, 8, 3, 7\]"):
        checked_features(np.zeros(shape), (8, 3, 7))


def test_read_only_features_are_taken() -> None:
    features = np.zeros((2, 8, 3, 7))
    features.flags.writeable = False
    checked_features(features, (8, 3, 7))[0] = 1.0
    assert not features.any()


def test_nan_is_refused() -> None:
    features = np.zeros((2, 8, 3, 7))
    features[1, 2, 0, 0] = np.nan
    with pytest.raises(BadArray, match="1 NaN or Inf"):
        checked_features(features, (8, 3, 7))


def test_labels_must_cover_all_classes() -> None:
    assert checked_labels(np.array([0, 1, 1]), 3, 2).tolist() == [0, 1, 1]
    with pytest.raises(BadArray, match="cover the classes 0 to 2"):
        checked_labels(np.array([0, 1, 1]), 3, 3)
    with pytest.raises(BadArray, match="3 integers"):
        checked_labels(np.array([0.0, 1.0, 1.0]), 3, 2)
