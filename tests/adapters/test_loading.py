from __future__ import annotations

from pathlib import Path

import pytest

from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.errors import BadConfig, MethodFailed

ONE = """
from bench.adapters.base import Adapter

class First(Adapter):
    name = "first"
"""
TWO = (
    ONE
    + """
class Second(Adapter):
    name = "second"
"""
)


def test_only_class_of_a_file_is_found(tmp_path: Path) -> None:
    file = tmp_path / "one.py"
    file.write_text(ONE)
    source = source_from_option(str(file))
    assert (source.name, source.class_name) == ("first", "First")
    assert find_adapter(source).name == "first"


def test_named_class_is_found_among_several(tmp_path: Path) -> None:
    file = tmp_path / "two.py"
    file.write_text(TWO)
    assert source_from_option(f"{file}:Second").name == "second"
    with pytest.raises(BadConfig, match=r"found First, Second.*FILE.py:Class"):
        source_from_option(str(file))
    with pytest.raises(BadConfig, match="no adapter class 'Third'"):
        source_from_option(f"{file}:Third")


def test_file_that_raises_is_a_failed_method(tmp_path: Path) -> None:
    file = tmp_path / "bad.py"
    file.write_text("raise RuntimeError('at import')")
    with pytest.raises(MethodFailed, match="importing it raised RuntimeError: at import"):
        source_from_option(str(file))


def test_missing_files_and_unknown_names_are_refused(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match=r"no Python file and no adapter\.toml at"):
        source_from_option(str(tmp_path / "none.py"))
    with pytest.raises(BadConfig, match=r"unknown method 'holden'.*copy-content"):
        find_adapter(AdapterSource("holden"))


def test_path_to_a_toml_file_is_an_outside_program(tmp_path: Path) -> None:
    file = tmp_path / "adapter.toml"
    file.write_text('name = "outside"\ncommand = ["python", "x.py"]\ncapabilities = ["transfers"]\n')
    source = source_from_option(str(file))
    assert (source.name, source.class_name) == ("outside", "")
    adapter = find_adapter(source)
    assert adapter.capabilities() == ("transfers",)
    assert not adapter.fits()
    file.write_text('name = "outside"\ncomand = []')
    with pytest.raises(BadConfig, match=r"no key 'comand'.*did you mean 'command'"):
        source_from_option(str(file))
