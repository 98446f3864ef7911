from __future__ import annotations

from pathlib import Path

import pytest

from tests.suite.tiny import METHODS, tiny_run


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run of the tiny benchmark in ``out`` and its ``store``; not to be changed."""
    folder = tmp_path_factory.mktemp("undisturbed")
    result = tiny_run(folder / "out", folder / "store")
    assert result.generated == len(METHODS) and [r.status for r in result.records] == ["ok"] * len(METHODS)
    return folder
