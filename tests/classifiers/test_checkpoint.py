"""Judge files: what goes in comes out, and nothing else is taken for a judge."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from safetensors.torch import save_file

from classifiers.autoencoder import AutoencoderConfig, Encoder
from classifiers.checkpoint import (
    BadCheckpoint,
    Checkpoint,
    checkpoint_of,
    load_classifier,
    load_encoder,
    load_temporal,
    read_checkpoint,
    write_checkpoint,
)
from classifiers.stgcn import Stgcn
from classifiers.temporal import Temporal, TemporalConfig

from .conftest import SMALL


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    torch.manual_seed(1)
    path = tmp_path / "judge.safetensors"
    write_checkpoint(path, checkpoint_of(Stgcn(SMALL), "stgcn-content/0"))
    return path


def test_round_trip_keeps_network_and_digest(stored: Path) -> None:
    torch.manual_seed(1)
    original = Stgcn(SMALL).eval()
    state = torch.random.get_rng_state()
    model, digest = load_classifier(stored)
    assert torch.equal(torch.random.get_rng_state(), state)
    windows = torch.randn(3, 16, 5, 7)
    assert torch.equal(model(windows), original(windows)) and not model.training
    assert digest == checkpoint_of(original, "stgcn-content/0").digest
    assert [path.name for path in stored.parent.iterdir()] == ["judge.safetensors"]


def test_encoder_round_trip(tmp_path: Path) -> None:
    encoder = Encoder(AutoencoderConfig(n_joints=2, widths=(4, 5, 6), n_components=2))
    path = tmp_path / "auto.safetensors"
    digest = write_checkpoint(path, checkpoint_of(encoder, "autoencoder/0"))
    again, found = load_encoder(path)
    assert found == digest and again.config == encoder.config


def test_second_family_round_trip(tmp_path: Path, stored: Path) -> None:
    original = Temporal(TemporalConfig(5, 2, n_frames=16, widths=(4, 4), strides=(2, 1))).eval()
    path = tmp_path / "temporal.safetensors"
    digest = write_checkpoint(path, checkpoint_of(original, "temporal-style/0"))
    again, found = load_temporal(path)
    windows = torch.randn(3, 16, 5, 3)
    assert found == digest and torch.equal(again(windows), original(windows))
    with pytest.raises(BadCheckpoint, match="expected a judge of kind temporal, got stgcn"):
        load_temporal(stored)
    with pytest.raises(BadCheckpoint, match="expected a judge of kind stgcn, got temporal"):
        load_classifier(path)


def test_one_changed_byte_is_noticed(stored: Path) -> None:
    data = bytearray(stored.read_bytes())
    data[-1] ^= 1
    stored.write_bytes(bytes(data))
    with pytest.raises(BadCheckpoint, match="the file was changed or damaged"):
        load_classifier(stored)


def test_digest_covers_settings(stored: Path) -> None:
    checkpoint = read_checkpoint(stored, "stgcn")
    other = Checkpoint("stgcn", {**checkpoint.settings, "id": "stgcn-content/1"}, checkpoint.tensors)
    assert other.digest != checkpoint.digest


@pytest.mark.parametrize("content", [b"", b"HIERARCHY\nROOT Hips\n", b"\x00" * 64])
def test_other_files_are_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "other.safetensors"
    path.write_bytes(content)
    with pytest.raises(BadCheckpoint, match="cannot be read as a judge file"):
        load_classifier(path)


def test_missing_file_foreign_weights_and_other_kind_are_refused(tmp_path: Path, stored: Path) -> None:
    with pytest.raises(BadCheckpoint, match="cannot be read"):
        load_classifier(tmp_path / "missing.safetensors")
    foreign = tmp_path / "foreign.safetensors"
    save_file({"weight": torch.zeros(2)}, foreign)
    with pytest.raises(BadCheckpoint, match="expected a judge file of format stylebench-judge/1, got no header"):
        load_classifier(foreign)
    with pytest.raises(BadCheckpoint, match="expected a judge of kind autoencoder, got stgcn"):
        load_encoder(stored)


def test_weights_that_do_not_fit_the_settings_are_refused(tmp_path: Path) -> None:
    checkpoint = checkpoint_of(Stgcn(SMALL), "x")
    network = {**checkpoint.settings["network"], "widths": [4, 4]}
    path = tmp_path / "wrong.safetensors"
    write_checkpoint(path, Checkpoint("stgcn", {"id": "x", "network": network}, checkpoint.tensors))
    with pytest.raises(BadCheckpoint, match="weights do not fit its settings"):
        load_classifier(path)
