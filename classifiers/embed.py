"""Judging: windows in, features and log-probabilities out. Float32 inside, float64 outside, on one CPU thread.

Batches always have the same size, the last one filled up, so a sample's numbers depend neither on how many others are
judged with it nor on the number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from classifiers.autoencoder import Autoencoder, Encoder, squared_half_angles
from classifiers.data import checked_features
from classifiers.stgcn import Stgcn
from classifiers.temporal import Temporal

FloatArray = NDArray[np.float64]
BATCH_SIZE = 64


@dataclass(frozen=True, eq=False)
class Classified:
    """Output of a classifier.

    Attributes
    ----------
    features : ``[n, 64]`` global mean before the last layer.
    log_probabilities : ``[n, K]``.
    """

    features: FloatArray
    log_probabilities: FloatArray

    @property
    def predicted(self) -> NDArray[np.int64]:
        """Most probable class of each sample, ``[n]``."""
        return np.asarray(self.log_probabilities.argmax(axis=1), dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Encoded:
    """Output of an auto-encoder: ``activations`` ``[n, 512]`` and their leading ``components`` ``[n, 32]``."""

    activations: FloatArray
    components: FloatArray


def classify(model: Stgcn | Temporal, windows: NDArray[np.floating]) -> Classified:
    """Judge windows ``[n, T, V, C]``; those of the second family hold positions only, C = 3.

    Raises
    ------
    BadArray : windows that do not fit the network.
    """
    features = _in_batches(model.features, checked_features(windows, model.config.input_shape))
    with torch.inference_mode():
        logits = features.double() @ model.last.weight.double().T + model.last.bias.double()
        return Classified(features.double().numpy(), torch.log_softmax(logits, dim=1).numpy())


def encode(model: Encoder, rotations_wxyz: NDArray[np.floating]) -> Encoded:
    """Encode local rotations ``[n, 24, V, 4]``.

    Raises
    ------
    BadArray : rotations that do not fit the network.
    """
    activations = _in_batches(model, checked_features(rotations_wxyz, model.config.input_shape)).double().numpy()
    mean, components = (part.double().numpy() for part in (model.mean, model.components))
    return Encoded(activations, (activations - mean) @ components.T)


def reconstruction_angle_deg(model: Autoencoder, rotations_wxyz: NDArray[np.floating]) -> float:
    """Root mean square rotation between clean input ``[n, 24, V, 4]`` and the auto-encoder's output, degrees."""
    clean = checked_features(rotations_wxyz, model.config.input_shape)
    decoded = _in_batches(model, clean)
    return float(np.degrees(2.0 * squared_half_angles(decoded, clean).double().mean().sqrt().item()))


def _in_batches(function: Callable[[Tensor], Tensor], samples: Tensor) -> Tensor:
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        with torch.inference_mode():
            parts = [function(_filled(part))[: len(part)] for part in torch.split(samples, BATCH_SIZE)]
    finally:
        torch.set_num_threads(threads)
    return torch.cat(parts)


def _filled(part: Tensor) -> Tensor:
    missing = BATCH_SIZE - len(part)
    return torch.cat([part, part[-1:].expand(missing, *part.shape[1:])]) if missing else part
