"""Judging does not depend on company, order or threads."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from classifiers.data import BadArray
from classifiers.embed import BATCH_SIZE, classify
from classifiers.stgcn import Stgcn
from classifiers.train import seeded_single_thread

from .conftest import SMALL

Sample = tuple[NDArray[np.float64], NDArray[np.int64]]


@pytest.fixture(scope="module")
def model() -> Stgcn:
    with seeded_single_thread(0):
        return Stgcn(SMALL).eval()


def test_numbers_do_not_depend_on_how_many_are_judged(model: Stgcn, two_classes: Sample) -> None:
    windows = two_classes[0]
    together = classify(model, windows)
    for first, last in ((0, 1), (3, 10), (BATCH_SIZE - 1, BATCH_SIZE + 2), (149, 150)):
        alone = classify(model, windows[first:last])
        assert np.allclose(alone.features, together.features[first:last], rtol=1e-6, atol=1e-7)
        assert np.allclose(alone.log_probabilities, together.log_probabilities[first:last], rtol=1e-6, atol=1e-7)


def test_numbers_do_not_depend_on_threads(model: Stgcn, two_classes: Sample) -> None:
    before = torch.get_num_threads()
    results = []
    for threads in (1, 2):
        torch.set_num_threads(threads)
        results.append(classify(model, two_classes[0]).features)
        assert torch.get_num_threads() == threads
    torch.set_num_threads(before)
    assert np.array_equal(results[0], results[1])


def test_outputs_are_what_they_say(model: Stgcn, two_classes: Sample) -> None:
    out = classify(model, two_classes[0])
    assert out.features.shape == (150, 8) and out.features.dtype == np.float64
    assert np.allclose(np.exp(out.log_probabilities).sum(axis=1), 1.0)
    with torch.inference_mode():
        logits = model(torch.as_tensor(two_classes[0], dtype=torch.float32))
    assert np.array_equal(out.predicted, logits.argmax(dim=1).numpy())


def test_windows_that_do_not_fit_are_refused(model: Stgcn) -> None:
    with pytest.raises(BadArray, match=r"\[n, 16, 5, 7\]"):
        classify(model, np.zeros((3, 64, 21, 7)))


def test_every_second_frame_is_read(model: Stgcn, two_classes: Sample) -> None:
    windows = two_classes[0][:4]
    changed = windows.copy()
    changed[:, 1::2] = 0.0
    assert np.array_equal(classify(model, windows).features, classify(model, changed).features)
