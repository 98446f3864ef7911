"""Small networks and windows of two easy classes."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from classifiers.stgcn import StgcnConfig

PARENTS = (-1, 0, 1, 0, 3)
SMALL = StgcnConfig(PARENTS, 2, n_frames=16, widths=(8, 8), strides=(2, 1))


def windows_of_two_classes(n: int, seed: int = 0) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """``[n, 16, 5, 7]`` windows; class 1 moves joint 2 at twice the pace."""
    rng = np.random.default_rng(seed)
    labels = np.arange(n) % 2
    phase = rng.uniform(0.0, 2.0 * np.pi, n)[:, None] + (1 + labels)[:, None] * np.arange(16) * 0.4
    windows = rng.normal(0.0, 0.005, (n, 16, 5, 7))
    windows[:, :, 2, 0] += np.sin(phase)
    windows[..., 3] += 1.0
    windows[..., 3:] /= np.linalg.norm(windows[..., 3:], axis=-1, keepdims=True)
    return windows, labels


@pytest.fixture(scope="session")
def two_classes() -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    return windows_of_two_classes(150)
