from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench import __version__
from bench.cli import app

runner = CliRunner()
COMMANDS = (["run"], ["list"], ["data", "info"], ["report"], ["leaderboard"], ["clean"])


def stylebench(*arguments: str, cwd: Path) -> subprocess.CompletedProcess[str]:
    """The command as a user types it."""
    code = "from bench.cli import main; main()"
    return subprocess.run(
        [sys.executable, "-c", code, *arguments], cwd=cwd, capture_output=True, text=True, check=False
    )


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_every_command_helps_with_an_example(command: list[str]) -> None:
    result = runner.invoke(app, [*command, "--help"])
    assert result.exit_code == 0 and "Example: stylebench" in result.output


def test_version() -> None:
    assert runner.invoke(app, ["--version"]).output == f"stylebench {__version__}\n"


@pytest.mark.parametrize("what", ["datasets", "methods", "protocols", "metrics"])
def test_lists_as_table_and_json(what: str) -> None:
    rows = json.loads(runner.invoke(app, ["list", what, "--json"]).output)
    assert rows and rows[0]["name"]
    assert rows[0]["name"] in runner.invoke(app, ["list", what]).output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["list", "nothing"], "error: nothing called 'nothing' to list; remedy: choose from"),
        (["run", "--data", "nope"], "error: unknown dataset 'nope'; remedy: choose from procedural"),
        (["run", "--data", "bandai-namco=missing.zip"], "no such file or folder"),
        (["report", "nowhere"], "error: nowhere"),
        (["leaderboard", "--records", "nowhere"], "error: no folder of records at nowhere"),
    ],
)
def test_user_errors_are_one_line_and_exit_code_2(arguments: list[str], message: str, tmp_path: Path) -> None:
    result = stylebench(*arguments, cwd=tmp_path)
    assert result.returncode == 2 and result.stdout == ""
    assert message in result.stderr and result.stderr.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_clean_removes_the_store_and_only_a_folder_of_runs(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    (runs / "store" / "tmp").mkdir(parents=True)
    (runs / "20260101-000000").mkdir()
    assert runner.invoke(app, ["clean", "--runs", str(runs)]).exit_code == 0
    assert [path.name for path in runs.iterdir()] == ["20260101-000000"]
    other = tmp_path / "thesis"
    other.mkdir()
    result = stylebench("clean", "--all", "--runs", str(other), cwd=tmp_path)
    assert result.returncode == 2 and "does not look like a folder of runs" in result.stderr and other.is_dir()
