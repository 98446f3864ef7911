"""Judge files: safetensors with a JSON header, a digest over every byte that matters, and nothing executable."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from safetensors import SafetensorError, safe_open
from safetensors.torch import save
from torch import Tensor

FORMAT = "stylebench-judge/1"


class BadCheckpoint(ValueError):
    """A file is not a judge, not the judge asked for, or was changed since it was written."""


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A judge as stored.

    Attributes
    ----------
    kind : ``stgcn`` or ``autoencoder``.
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
    header = {
        "format": FORMAT,
        "kind": checkpoint.kind,
        "settings": _canonical(checkpoint.settings),
        "digest": checkpoint.digest,
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
    if header.get("format") != FORMAT:
        raise BadCheckpoint(f"{path}: expected a judge file of format {FORMAT}, got {header.get('format', 'none')}")
    if header.get("kind") != kind:
        raise BadCheckpoint(f"{path}: expected a judge of kind {kind}, got {header.get('kind')}")
    try:
        checkpoint = Checkpoint(kind, json.loads(header["settings"]), tensors)
    except (KeyError, json.JSONDecodeError) as error:
        raise BadCheckpoint(f"{path}: its header holds no readable settings") from error
    if checkpoint.digest != header.get("digest"):
        raise BadCheckpoint(
            f"{path}: its bytes give digest {checkpoint.digest}, its header says {header.get('digest')}; "
            "the file was changed or damaged, fetch it again"
        )
    return checkpoint


def load_weights(model: torch.nn.Module, checkpoint: Checkpoint, path: Path) -> None:
    """Put a checkpoint's tensors into a network built from its settings, and set evaluation mode.

    Raises
    ------
    BadCheckpoint : names or shapes that do not fit.
    """
    try:
        model.load_state_dict(dict(checkpoint.tensors))
    except RuntimeError as error:
        raise BadCheckpoint(f"{path}: its weights do not fit its settings ({' '.join(str(error).split())})") from error
    model.eval()


def _canonical(value: object) -> str:
    return json.dumps(value, sort_keys=True, separators=(",", ":"))
