from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from bench.errors import BadConfig
from bench.suite.store import Store


def write_text(text: str) -> Any:
    def write(folder: Path) -> dict[str, Any]:
        (folder / "text").write_text(text)
        return {"length": len(text)}

    return write


def test_put_then_read(tmp_path: Path) -> None:
    store = Store(tmp_path)
    assert not store.has("stage", "key")
    folder = store.put("stage", "key", write_text("abc"))
    assert store.has("stage", "key") and (folder / "text").read_text() == "abc"
    assert store.facts("stage", "key") == {"length": 3}


def test_failed_write_leaves_nothing(tmp_path: Path) -> None:
    def write(folder: Path) -> dict[str, Any]:
        (folder / "half").write_text("x")
        raise RuntimeError("stop")

    store = Store(tmp_path)
    with pytest.raises(RuntimeError, match="stop"):
        store.put("stage", "key", write)
    assert not store.has("stage", "key") and list((tmp_path / "tmp").iterdir()) == []


def test_first_of_two_writers_wins(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.put("stage", "key", write_text("first"))
    folder = store.put("stage", "key", write_text("second"))
    assert (folder / "text").read_text() == "first"


def test_folder_without_done_mark_is_written_again(tmp_path: Path) -> None:
    store = Store(tmp_path)
    store.folder("stage", "key").mkdir(parents=True)
    store.put("stage", "key", write_text("whole"))
    assert store.has("stage", "key")


def test_sweep_removes_drafts_of_the_dead_only(tmp_path: Path) -> None:
    store = Store(tmp_path)
    ended = subprocess.Popen([sys.executable, "-c", ""])
    ended.wait()
    dead, alive = tmp_path / "tmp" / f"s-{ended.pid}-x", tmp_path / "tmp" / f"s-{os.getpid()}-x"
    dead.mkdir()
    alive.mkdir()
    store.sweep()
    assert not dead.exists() and alive.exists()


def test_unwritable_root_is_refused(tmp_path: Path) -> None:
    blocker = tmp_path / "file"
    blocker.write_text("")
    with pytest.raises(BadConfig, match="store folder cannot be written"):
        Store(blocker / "store")
