"""Trained networks on disk: safetensors, a JSON config and loss curves; nothing executable."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any, TypeAlias, TypeVar

from safetensors import SafetensorError
from safetensors.torch import load_file, save_file
from torch import nn

from bench.errors import BadFile
from bench.methods.training import Curves

WEIGHTS_FILE = "weights.safetensors"
CONFIG_FILE = "config.json"
CURVES_FILE = "curves.npz"

Config = TypeVar("Config")
Module: TypeAlias = nn.Module


def save_network(folder: Path, network: nn.Module, config: Any, curves: Curves | None = None) -> None:
    """Write weights and buffers, the frozen dataclass that rebuilds the network, and how the losses fell."""
    tensors = {name: tensor.detach().cpu().contiguous() for name, tensor in network.state_dict().items()}
    save_file(tensors, folder / WEIGHTS_FILE)
    (folder / CONFIG_FILE).write_text(json.dumps(dataclasses.asdict(config), indent=1, sort_keys=True))
    if curves is not None:
        curves.save(folder / CURVES_FILE)


def read_config(folder: Path, config_class: type[Config]) -> Config:
    """The config that :func:`save_network` wrote; lists come back as tuples.

    Raises
    ------
    BadFile : no such file, or not the config of this class.
    """
    try:
        values = json.loads((folder / CONFIG_FILE).read_text())
        return config_class(**{name: _frozen(value) for name, value in values.items()})
    except (OSError, ValueError, TypeError, AttributeError) as error:
        raise BadFile(f"not a config of {config_class.__name__}: {error}", where=str(folder / CONFIG_FILE)) from error


def load_weights(folder: Path, network: nn.Module) -> None:
    """Fill a freshly built network and put it into evaluation mode.

    Raises
    ------
    BadFile : no such file, or weights of another network.
    """
    path = folder / WEIGHTS_FILE
    try:
        network.load_state_dict(load_file(path))
    except (OSError, SafetensorError, RuntimeError) as error:
        raise BadFile(
            f"not the weights of {type(network).__name__}: {' '.join(str(error).split())[:200]}", where=str(path)
        ) from error
    network.eval()


def _frozen(value: Any) -> Any:
    return tuple(_frozen(item) for item in value) if isinstance(value, list) else value
