"""Base class of adapters that learn: fitting by budget, saving, loading and describing, so that a paper's own adapter
holds nothing but its calls."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Generic, TypeVar

from bench.adapters.base import Adapter, Description, ProgressCallback
from bench.datasets.take import Take
from bench.errors import BadConfig

if TYPE_CHECKING:
    from bench.methods.saved import Module
    from bench.methods.training import Curves, FitRequest

Config = TypeVar("Config")
Network = TypeVar("Network", bound="Module")


class LearnedAdapter(Adapter, Generic[Config, Network]):
    """A subclass says what its config is and how to build and to train its network; the rest is here.

    Everything that ``transfer`` needs is a weight or a buffer of ``network`` or a field of ``config``: a frozen
    dataclass of numbers, strings and tuples. What only training needs (discriminators) is not stored. Networks are
    imported inside the calls, so that listing methods does not wait for torch::

        class Mine(LearnedAdapter["MineConfig", "MineNetwork"]):
            name = "mine"

            def configs(self):
                from bench.methods.mine.mine import MineConfig
                return MineConfig

            def build(self, config):
                from bench.methods.mine.mine import MineNetwork
                return MineNetwork(config)

            def train(self, request):
                from bench.methods.mine.mine import CONFIGS, train_mine
                return train_mine(CONFIGS[request.budget], request)

            def transfer(self, content, style, *, rng):
                from bench.methods.mine.mine import transfer_mine
                return transfer_mine(self.network, content.clip, style.clip)
    """

    config: Config
    network: Network
    curves: Curves | None = None

    @abstractmethod
    def configs(self) -> type[Config]:
        """The dataclass of its configs."""
        raise NotImplementedError

    @abstractmethod
    def build(self, config: Config) -> Network:
        """The network with initial weights."""
        raise NotImplementedError

    @abstractmethod
    def train(self, request: FitRequest) -> tuple[Config, Network, Curves]:
        """Train from nothing, or from what an interrupted training left; the same weights in both cases."""
        raise NotImplementedError

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        from bench.methods.training import FitRequest, checked_budget

        request = FitRequest(takes, seed, checked_budget(budget), self.device, self.checkpoints, progress)
        self.config, network, self.curves = self.train(request)
        self.network = network.cpu().eval()

    def save(self, folder: Path) -> None:
        from bench.methods.saved import save_network

        save_network(folder, self.network, self.config, self.curves)

    def load(self, folder: Path) -> None:
        from bench.methods.saved import load_weights, read_config

        self.config = read_config(folder, self.configs())
        self.network = self.build(self.config)
        load_weights(folder, self.network)

    def describe(self) -> Description:
        from bench.methods.layers import n_parameters

        if not hasattr(self, "network"):
            raise BadConfig(f"{self.name} describes itself once it is trained", remedy="call fit or load first")
        return Description(
            parameters=n_parameters(self.network),
            bytes_per_style=self.bytes_per_style(),
            designed_input_frames=self.traits.designed_input_frames,
            look_ahead_frames=self.traits.look_ahead_frames,
        )

    def bytes_per_style(self) -> int:
        """What has to be kept of a style to transfer it, bytes; 0 where the style is read off a reference."""
        return 0
