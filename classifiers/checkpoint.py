"""Judge files: safetensors with a JSON header, a digest over every byte that matters, and nothing executable."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, TypeVar

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor, nn

from classifiers.autoencoder import AutoencoderConfig, Encoder
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.temporal import Temporal, TemporalConfig

FORMAT = "stylebench-judge/1"
Model = TypeVar("Model", bound=nn.Module)
_KINDS: Mapping[type[nn.Module], str] = {Stgcn: "stgcn", Temporal: "temporal", Encoder: "autoencoder"}


class BadCheckpoint(ValueError):
    """A file is not a judge, not the judge asked for, or was changed since it was written."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A judge as stored.

    Attributes
    ----------
    kind : ``stgcn``, ``temporal`` or ``autoencoder``.
    settings : whatever JSON the writer needs to rebuild and name the judge.
    tensors : name -> weights or buffers.
    """

    kind: str
    settings: Mapping[str, Any]
    tensors: Mapping[str, Tensor]

    @property
    def digest(self) -> str:
        """blake2b over kind, settings, and each tensor's name, type, shape and bytes; 32 hexadecimal digits."""
        state = hashlib.blake2b(_canonical([FORMAT, self.kind, self.settings]).encode(), digest_size=16)
        for name, tensor in sorted(self.tensors.items()):
            array = tensor.detach().contiguous().numpy()
            state.update(_canonical([name, str(array.dtype), list(array.shape)]).encode())
            state.update(array.tobytes())
        return state.hexdigest()


def write_checkpoint(path: Path, checkpoint: Checkpoint) -> str:
    """Write a judge file, whole or not at all; returns its digest."""
    # one entry only: safetensors writes several in an order that changes from run to run
    header = {
        FORMAT: _canonical({"kind": checkpoint.kind, "settings": checkpoint.settings, "digest": checkpoint.digest})
    }
    tensors = {name: tensor.detach().contiguous() for name, tensor in checkpoint.tensors.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    temporary = path.with_suffix(".partial")
    temporary.write_bytes(save(tensors, header))
    temporary.replace(path)
    return checkpoint.digest


def read_checkpoint(path: Path, kind: str) -> Checkpoint:
    """Read a judge file.

    Raises
    ------
    BadCheckpoint : no such file, not a judge file, another kind, or bytes that do not give the digest in its header.
    """
    try:
        with safe_open(path, framework="pt") as file:
            header = file.metadata() or {}
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118 - not a mapping
    except (SafetensorError, OSError) as error:
        raise BadCheckpoint(f"{path}: cannot be read as a judge file ({error})") from error
    if FORMAT not in header:
        raise BadCheckpoint(f"{path}: expected a judge file of format {FORMAT}, got {', '.join(header) or 'no header'}")
    try:
        facts = json.loads(header[FORMAT])
        checkpoint = Checkpoint(facts["kind"], facts["settings"], tensors)
        stored_digest = facts["digest"]
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise BadCheckpoint(f"{path}: its header holds no readable settings") from error
    if checkpoint.kind != kind:
        raise BadCheckpoint(f"{path}: expected a judge of kind {kind}, got {checkpoint.kind}")
    if checkpoint.digest != stored_digest:
        raise BadCheckpoint(
            f"{path}: its bytes give digest {checkpoint.digest}, its header says {header.get('digest')}; "
            "the file was changed or damaged, fetch it again"
        )
    return checkpoint


def checkpoint_of(model: Stgcn | Temporal | Encoder, judge_id: str) -> Checkpoint:
    """What is stored of a trained network."""
    return Checkpoint(_KINDS[type(model)], {"id": judge_id, "network": asdict(model.config)}, model.state_dict())


def load_classifier(path: Path) -> tuple[Stgcn, str]:
    """A classifier in evaluation mode and its digest.

    Raises
    ------
    BadCheckpoint : see :func:`read_checkpoint`; also settings or weights that do not fit each other.
    """
    checkpoint = read_checkpoint(path, "stgcn")
    model = _fitting(path, checkpoint, lambda network: Stgcn(StgcnConfig(**network)))
    return model, checkpoint.digest


def load_temporal(path: Path) -> tuple[Temporal, str]:
    """A classifier of the second family in evaluation mode and its digest.

    Raises
    ------
    BadCheckpoint : see :func:`read_checkpoint`; also settings or weights that do not fit each other.
    """
    checkpoint = read_checkpoint(path, "temporal")
    model = _fitting(path, checkpoint, lambda network: Temporal(TemporalConfig(**network)))
    return model, checkpoint.digest


def load_encoder(path: Path) -> tuple[Encoder, str]:
    """An auto-encoder's encoder in evaluation mode and its digest.

    Raises
    ------
    BadCheckpoint : see :func:`read_checkpoint`; also settings or weights that do not fit each other.
    """
    checkpoint = read_checkpoint(path, "autoencoder")
    model = _fitting(path, checkpoint, lambda network: Encoder(AutoencoderConfig(**network)))
    return model, checkpoint.digest


def _fitting(path: Path, checkpoint: Checkpoint, build: Callable[[dict[str, Any]], Model]) -> Model:
    try:
        network = checkpoint.settings["network"]
        # drawing initial weights must not move the caller's random numbers
        with torch.random.fork_rng(devices=[]):
            model = build({key: tuple(value) if isinstance(value, list) else value for key, value in network.items()})
        model.load_state_dict(dict(checkpoint.tensors))
    except (KeyError, TypeError, ValueError, RuntimeError) as error:
        raise BadCheckpoint(f"{path}: its weights do not fit its settings ({' '.join(str(error).split())})") from error
    return model.eval()


def _canonical(value: object) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"))
