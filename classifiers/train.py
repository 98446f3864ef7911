"""Training of judges: seeded, on one thread, in float32. The same call on the same machine gives the same bytes."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn
from torch.nn import functional

from classifiers.autoencoder import Autoencoder, AutoencoderConfig, squared_half_angles
from classifiers.data import checked_features, checked_labels
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.temporal import Temporal, TemporalConfig

Classifier = TypeVar("Classifier", Stgcn, Temporal)
Progress = Callable[[int, int], None]
"""Called as ``progress(steps done, steps in total)``."""


@dataclass(frozen=True)
class TrainingConfig:
    """How a network is trained (AdamW, one-cycle learning rate).

    Attributes
    ----------
    n_steps : optimiser steps.
    batch_size : samples a step.
    peak_rate : highest learning rate.
    weight_decay : of AdamW.
    label_smoothing : share of the target spread over all classes (classifiers).
    time_scale : windows are slowed down or sped up by up to this share.
    noise : deviation of the noise that the auto-encoder has to take out.
    """

    n_steps: int
    batch_size: int = 64
    peak_rate: float = 4e-3
    weight_decay: float = 1e-3
    label_smoothing: float = 0.05
    time_scale: float = 0.0
    noise: float = 0.03


@dataclass(frozen=True)
class History:
    """What a training run left: mean loss over each tenth of it, and the CPU seconds it took on its one thread."""

    losses: tuple[float, ...]
    seconds: float


@contextmanager
def seeded_single_thread(seed: int) -> Iterator[torch.Generator]:
    """Torch on one thread with its global generator seeded; both are put back. Yields a generator of its own."""
    threads = torch.get_num_threads()
    with torch.random.fork_rng(devices=[]):
        torch.default_generator.manual_seed(seed)
        torch.set_num_threads(1)
        try:
            yield torch.Generator().manual_seed(seed)
        finally:
            torch.set_num_threads(threads)


def train_classifier(
    features: NDArray[np.floating],
    labels: NDArray[np.integer],
    network: StgcnConfig,
    training: TrainingConfig,
    *,
    seed: int,
    progress: Progress | None = None,
) -> tuple[Stgcn, History]:
    """Train an ST-GCN on windows ``[n, T, V, C]`` with class indices ``[n]``; returned in evaluation mode.

    Raises
    ------
    BadArray : shapes or labels that do not fit ``network``.
    """
    return _train_classifier(lambda: Stgcn(network), features, labels, network, training, seed, progress)


def train_temporal(
    positions: NDArray[np.floating],
    labels: NDArray[np.integer],
    network: TemporalConfig,
    training: TrainingConfig,
    *,
    seed: int,
    progress: Progress | None = None,
) -> tuple[Temporal, History]:
    """:func:`train_classifier` for the second family, on joint positions ``[n, T, V, 3]``.

    Raises
    ------
    BadArray : shapes or labels that do not fit ``network``.
    """
    return _train_classifier(lambda: Temporal(network), positions, labels, network, training, seed, progress)


def _train_classifier(
    build: Callable[[], Classifier],
    features: NDArray[np.floating],
    labels: NDArray[np.integer],
    network: StgcnConfig | TemporalConfig,
    training: TrainingConfig,
    seed: int,
    progress: Progress | None,
) -> tuple[Classifier, History]:
    windows = checked_features(features, network.input_shape)
    targets = checked_labels(labels, len(windows), network.n_classes)
    with seeded_single_thread(seed) as generator:
        model = build()
        model.standardise.fit(windows)

        def loss(batch: Tensor) -> Tensor:
            stretched = stretch_time(windows[batch], training.time_scale, generator)
            return functional.cross_entropy(model(stretched), targets[batch], label_smoothing=training.label_smoothing)

        history = _descend(model, loss, len(windows), training, generator, progress)
    return model, history


def train_autoencoder(
    rotations_wxyz: NDArray[np.floating],
    network: AutoencoderConfig,
    training: TrainingConfig,
    *,
    seed: int,
    progress: Progress | None = None,
) -> tuple[Autoencoder, History]:
    """Train the denoising auto-encoder on ``[n, 24, V, 4]``; references and principal components are fitted too.

    The loss is the sum over frames and joints of the squared half angle between output and clean input.

    Raises
    ------
    BadArray : shapes that do not fit ``network``.
    """
    windows = checked_features(rotations_wxyz, network.input_shape)
    with seeded_single_thread(seed) as generator:
        model = Autoencoder(network)
        model.encoder.fit_reference(windows)
        # time innermost in memory, as the convolutions want it: twice as fast as the order the axes have
        clean = model.encoder.settle_signs(windows).permute(0, 2, 3, 1).contiguous()

        def loss(batch: Tensor) -> Tensor:
            target = clean[batch].permute(0, 3, 1, 2)
            noise = training.noise * torch.randn(clean[batch].shape, generator=generator).permute(0, 3, 1, 2)
            return squared_half_angles(model(target + noise), target).sum(dim=(1, 2)).mean()

        history = _descend(model, loss, len(clean), training, generator, progress)
        with torch.inference_mode():
            model.encoder.fit_components(torch.cat([model.encoder(part) for part in torch.split(windows, 256)]))
    return model, history


def stretch_time(windows: Tensor, largest: float, generator: torch.Generator) -> Tensor:
    """Play each window of ``[B, T, V, C]`` up to ``largest`` slower or faster about its middle, the ends held."""
    if largest == 0.0:
        return windows
    batch, n_frames = windows.shape[:2]
    middle = (n_frames - 1) / 2.0
    speed = 1.0 + largest * (2.0 * torch.rand(batch, 1, generator=generator) - 1.0)
    times = (middle + (torch.arange(n_frames) - middle) * speed).clamp(0.0, n_frames - 1.0)
    before = times.floor().long().clamp_max(n_frames - 2)
    weight = (times - before)[..., None, None]
    rows = torch.arange(batch)[:, None]
    return torch.lerp(windows[rows, before], windows[rows, before + 1], weight)


def _descend(
    model: nn.Module,
    loss_of: Callable[[Tensor], Tensor],
    n_samples: int,
    training: TrainingConfig,
    generator: torch.Generator,
    progress: Progress | None,
) -> History:
    optimiser = torch.optim.AdamW(
        model.parameters(), lr=training.peak_rate, weight_decay=training.weight_decay, fused=True
    )
    schedule = torch.optim.lr_scheduler.OneCycleLR(
        optimiser, max_lr=training.peak_rate, total_steps=training.n_steps, cycle_momentum=False
    )
    started = time.thread_time()
    losses: list[float] = []
    model.train()
    for step, batch in enumerate(_batches(n_samples, training, generator)):
        optimiser.zero_grad(set_to_none=True)
        loss = loss_of(batch)
        loss.backward()  # type: ignore[no-untyped-call]
        optimiser.step()
        schedule.step()
        losses.append(float(loss.detach()))
        if progress is not None:
            progress(step + 1, training.n_steps)
    model.eval()
    tenths = np.array_split(np.asarray(losses), min(10, len(losses)))
    return History(tuple(float(tenth.mean()) for tenth in tenths), time.thread_time() - started)


def _batches(n_samples: int, training: TrainingConfig, generator: torch.Generator) -> Iterator[Tensor]:
    """Batches of one shuffled pass after the other; a pass's last, smaller batch is dropped."""
    size = min(training.batch_size, n_samples)
    done = 0
    while True:
        order = torch.randperm(n_samples, generator=generator)
        for first in range(0, n_samples - size + 1, size):
            if done == training.n_steps:
                return
            yield order[first : first + size]
            done += 1
