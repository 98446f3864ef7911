"""Training: it learns, repeats itself, and leaves torch as it was."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from classifiers.autoencoder import AutoencoderConfig
from classifiers.checkpoint import checkpoint_of
from classifiers.data import BadArray
from classifiers.embed import classify, encode, reconstruction_angle_deg
from classifiers.temporal import TemporalConfig
from classifiers.train import TrainingConfig, stretch_time, train_autoencoder, train_classifier, train_temporal

from .conftest import SMALL, windows_of_two_classes

QUICK = TrainingConfig(n_steps=60, batch_size=32, peak_rate=1e-2)
Sample = tuple[NDArray[np.float64], NDArray[np.int64]]


def test_classifier_learns_and_history_falls(two_classes: Sample) -> None:
    model, history = train_classifier(*two_classes, SMALL, QUICK, seed=0)
    windows, labels = windows_of_two_classes(100, seed=1)
    assert np.mean(classify(model, windows).predicted == labels) > 0.9
    assert history.losses[-1] < 0.6 * history.losses[0] and len(history.losses) == 10
    assert not model.training


def test_same_seed_same_bytes_other_seed_others(two_classes: Sample) -> None:
    short = replace(QUICK, n_steps=5, time_scale=0.1)
    first, again, other = (
        checkpoint_of(train_classifier(*two_classes, SMALL, short, seed=seed)[0], "x").digest for seed in (3, 3, 4)
    )
    assert first == again != other


def test_second_family_learns_repeats_itself_and_reads_positions_only(two_classes: Sample) -> None:
    windows, labels = two_classes
    network = TemporalConfig(5, 2, n_frames=16, widths=(8, 8), strides=(2, 1))
    models = [train_temporal(windows[..., :3], labels, network, QUICK, seed=seed)[0] for seed in (3, 3, 4)]
    first, again, other = (checkpoint_of(model, "x").digest for model in models)
    assert first == again != other
    unseen, true = windows_of_two_classes(100, seed=1)
    judged = classify(models[0], unseen[..., :3])
    assert np.mean(judged.predicted == true) > 0.9 and judged.features.shape == (100, 8)
    with pytest.raises(BadArray, match=r"\[n, 16, 5, 3\]"):
        classify(models[0], unseen)


def test_threads_and_global_generator_are_put_back(two_classes: Sample) -> None:
    before, threads = torch.random.get_rng_state(), torch.get_num_threads()
    seen: list[int] = []
    train_classifier(
        *two_classes, SMALL, replace(QUICK, n_steps=2), seed=0,
        progress=lambda done, total: seen.append(torch.get_num_threads()),
    )  # fmt: skip
    assert torch.equal(torch.random.get_rng_state(), before)
    assert torch.get_num_threads() == threads and seen == [1, 1]


def test_labels_that_do_not_fit_are_refused(two_classes: Sample) -> None:
    windows, labels = two_classes
    with pytest.raises(BadArray, match="labels must be 150 integers"):
        train_classifier(windows, labels[:-1], SMALL, QUICK, seed=0)


def test_stretching_holds_the_middle_and_the_ends() -> None:
    windows = torch.arange(9.0).reshape(1, 9, 1, 1).repeat(50, 1, 1, 1)
    stretched = stretch_time(windows, 0.2, torch.Generator().manual_seed(0))
    assert torch.allclose(stretched[:, 4], windows[:, 4])
    assert float(stretched.min()) >= 0.0 and float(stretched.max()) <= 8.0
    steps = stretched[:, 5] - stretched[:, 4]
    assert float(steps.min()) > 0.79 and float(steps.max()) < 1.21 and float(steps.std()) > 0.05
    assert stretch_time(windows, 0.0, torch.Generator()) is windows


def test_autoencoder_learns_to_take_noise_out() -> None:
    rng = np.random.default_rng(0)
    angle = 0.3 * np.sin(rng.uniform(0.0, 6.0, (64, 1, 1)) + 0.2 * np.arange(24)[:, None] + np.arange(3))
    rotations = np.stack([np.cos(angle), np.sin(angle), 0 * angle, 0 * angle], axis=-1)
    config = AutoencoderConfig(n_joints=3, widths=(32, 32, 48), n_components=4)
    model, history = train_autoencoder(rotations, config, TrainingConfig(n_steps=150, peak_rate=4e-3), seed=0)
    assert history.losses[-1] < 0.2 * history.losses[0]
    assert reconstruction_angle_deg(model, rotations) < 15.0
    encoded = encode(model.encoder, rotations)
    assert encoded.activations.shape == (64, 48) and encoded.components.shape == (64, 4)
    assert np.allclose(encoded.components.mean(axis=0), 0.0, atol=1e-4)
    assert np.all(np.diff(encoded.components.var(axis=0)) < 0.0)
    covariance = np.cov(encoded.components.T)
    assert np.allclose(covariance, np.diag(np.diag(covariance)), atol=1e-3 * covariance.max())
