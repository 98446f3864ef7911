"""Each loss of Park 2021 against its equation."""

from __future__ import annotations

import math

import pytest
import torch

from bench.methods.park2021.losses import (
    adversarial_of_discriminator,
    adversarial_of_stylizer,
    diversity,
    motion_distance,
    style_distance,
)


def probability(logit: float) -> float:
    return 1.0 / (1.0 + math.exp(-logit))


def test_adversarial_losses_are_cross_entropies() -> None:
    real, fake = [0.3, -1.2], [2.0, -0.5]
    expected = -sum(math.log(probability(x)) for x in real) / 2 - sum(math.log(1 - probability(x)) for x in fake) / 2
    assert float(adversarial_of_discriminator(torch.tensor(real), torch.tensor(fake))) == pytest.approx(expected)
    expected = -sum(math.log(probability(x)) for x in fake) / 2
    assert float(adversarial_of_stylizer(torch.tensor(fake))) == pytest.approx(expected)


def test_distance_of_motions_is_euclidean_over_joints() -> None:
    one, other = torch.zeros(1, 7, 2, 21), torch.zeros(1, 7, 2, 21)
    other[0, 3, 1, 4], other[0, 3, 1, 5] = 3.0, 4.0
    assert float(motion_distance(one, other)) == pytest.approx(5.0 / 14.0)
    assert float(motion_distance(one, one)) == 0.0


def test_distance_of_codes_is_the_mean_absolute_difference() -> None:
    assert float(style_distance(torch.tensor([[1.0, -2.0]]), torch.tensor([[0.0, 1.0]]))) == pytest.approx(2.0)


def test_diversity_has_no_gradient_through_the_second_output() -> None:
    one = torch.ones(1, 7, 4, 21, requires_grad=True)
    other = torch.full((1, 7, 4, 21), 3.0, requires_grad=True)
    loss = diversity(one, other)
    loss.backward()  # type: ignore[no-untyped-call]
    assert loss.item() == pytest.approx(2.0)
    assert one.grad is not None and other.grad is None
