from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor, nn

from bench.errors import BadConfig, MethodFailed
from bench.methods.layers import Average
from bench.methods.training import Curves, Losses, Stateful, Trainable, checked_budget, seeded, train


class Killed(Exception):
    pass


class Toy(Trainable):
    """A network with dropout, an optimiser with memory, and an average: all that a checkpoint has to hold."""

    def __init__(self, generator: torch.Generator, killed_at: int = -1) -> None:
        self.generator = generator
        self.network = nn.Sequential(nn.Linear(3, 8), nn.Dropout(0.5), nn.Linear(8, 1))
        self.optimiser = torch.optim.Adam(self.network.parameters(), lr=1e-2)
        self.average = Average(self.network, 0.9)
        self.killed_at = killed_at

    def step(self, index: int) -> Losses:
        if index == self.killed_at:
            raise Killed
        x = torch.randn(4, 3, generator=self.generator)
        loss = (self.network(x) - x.sum(dim=1, keepdim=True)).square().mean()
        self.optimiser.zero_grad()
        loss.backward()
        self.optimiser.step()
        self.average.update(self.network)
        return {"error": loss} | ({"seldom": 1.0} if index % 10 == 0 else {})

    def parts(self) -> Mapping[str, Stateful]:
        return {"network": self.network, "optimiser": self.optimiser, "average": self.average}


def quiet(what: str, done: int, total: int) -> None:
    pass


def trained(checkpoints: Path | None, killed_at: int = -1, n_steps: int = 40) -> tuple[dict[str, Tensor], Curves]:
    with seeded(3) as generator:
        toy = Toy(generator, killed_at)
        curves = train(toy, n_steps, progress=quiet, checkpoints=checkpoints, checkpoint_every_s=0.0)
    return dict(toy.average.network.state_dict()), curves


@pytest.mark.parametrize("killed_at", [1, 21, 39])
def test_a_killed_training_ends_with_the_same_weights(tmp_path: Path, killed_at: int) -> None:
    whole, curves = trained(None)
    with pytest.raises(Killed):
        trained(tmp_path, killed_at)
    resumed, resumed_curves = trained(tmp_path)
    assert all(torch.equal(whole[name], resumed[name]) for name in whole)
    assert resumed_curves.names == curves.names
    np.testing.assert_allclose(resumed_curves.values, curves.values, rtol=1e-5)


def test_a_finished_training_is_not_done_again(tmp_path: Path) -> None:
    first, _ = trained(tmp_path)
    again, _ = trained(tmp_path, killed_at=0)
    assert all(torch.equal(first[name], again[name]) for name in first)


def test_seeding_leaves_the_callers_random_numbers_alone() -> None:
    torch.default_generator.manual_seed(1)
    expected = torch.rand(2)
    torch.default_generator.manual_seed(1)
    trained(None)
    assert torch.equal(torch.rand(2), expected)


def test_curves_hold_means_over_stretches_and_come_back(tmp_path: Path) -> None:
    _, curves = trained(None, n_steps=600)
    assert curves.names == ("error", "seldom") and len(curves.steps) == 200 and curves.steps[-1] == 600
    assert np.isnan(curves.values[1, 1]) and curves.values[0, 1] == 1.0
    assert curves.values[-20:, 0].mean() < curves.values[:20, 0].mean()
    curves.save(tmp_path / "curves.npz")
    back = Curves.load(tmp_path / "curves.npz")
    assert back.names == curves.names and back.seconds == curves.seconds
    np.testing.assert_array_equal(back.values, curves.values)


def test_a_diverging_training_is_a_failure_with_its_place() -> None:
    class Diverging(Toy):
        def step(self, index: int) -> Losses:
            return {"error": float("nan") if index == 7 else 0.0}

    with seeded(0) as generator, pytest.raises(MethodFailed, match="error is nan"):
        train(Diverging(generator), 20, progress=quiet)


def test_a_checkpoint_of_another_training_is_refused(tmp_path: Path) -> None:
    trained(tmp_path)
    with seeded(3) as generator, pytest.raises(BadConfig, match="of 40 steps, this one has 5"):
        train(Toy(generator), 5, progress=quiet, checkpoints=tmp_path)


def test_budgets_are_known_by_name() -> None:
    assert checked_budget("small") == "small"
    with pytest.raises(BadConfig, match="choose from smoke, small, paper"):
        checked_budget("huge")
