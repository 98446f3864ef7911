from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bench.adapters.check import check_adapter
from bench.adapters.loading import find_adapter, source_from_option
from bench.adapters.scaffold import new_adapter_text, write_new_adapter, write_new_program
from bench.datasets.procedural import load
from bench.errors import BadConfig


def test_new_adapter_passes_every_check_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.adapters.check.GROWTH_CALLS", 60)
    path = write_new_adapter("my_method", tmp_path)
    source = source_from_option(str(path))
    assert (source.name, source.class_name) == ("my_method", "MyMethod")
    rows = list(check_adapter(find_adapter(source), load(None).takes))
    assert [row for row in rows if row.ok is False] == []
    assert len([row for row in rows if row.ok]) >= 10


def test_new_adapter_is_clean_code(tmp_path: Path) -> None:
    path = write_new_adapter("my_method", tmp_path)
    ruff = Path(sys.executable).parent / "ruff"
    for command in (["check"], ["format", "--check"]):
        root = Path(__file__).resolve().parents[2]
        subprocess.run([ruff, *command, "--config", root / "pyproject.toml", path], check=True)


@pytest.mark.parametrize("name", ["", "My", "1st", "a-b", "class", "../x", "a" * 50, "x.py"])
def test_names_that_are_no_module_are_refused(name: str) -> None:
    with pytest.raises(BadConfig, match="cannot name an adapter file"):
        new_adapter_text(name)


def test_nothing_is_overwritten(tmp_path: Path) -> None:
    write_new_adapter("mine", tmp_path).write_text("precious")
    with pytest.raises(BadConfig, match="is already there"):
        write_new_adapter("mine", tmp_path)
    assert (tmp_path / "mine.py").read_text() == "precious"
    with pytest.raises(BadConfig, match="cannot be written"):
        write_new_adapter("mine", tmp_path / "none")


def test_new_program_passes_every_check_unchanged(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.adapters.check.GROWTH_CALLS", 60)
    source = source_from_option(str(write_new_program("my_method", tmp_path)))
    assert source.name == "my_method"
    rows = list(check_adapter(find_adapter(source), load(None).takes))
    assert [row for row in rows if row.ok is False] == []
    with pytest.raises(BadConfig, match="is already there"):
        write_new_program("my_method", tmp_path)
