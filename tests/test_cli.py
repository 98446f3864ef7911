from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench import __version__
from bench.cli import app
from bench.command_options import command_line
from tests.reports.factory import FakeMethod, write_run

runner = CliRunner()
COMMANDS = (
    ["run"], ["new-adapter"], ["check"], ["export-tasks"], ["score"], ["list"], ["data", "info"],
    ["data", "verify"], ["data", "fetch"], ["data", "skeleton"], ["report"],
    ["leaderboard"], ["ladder"], ["clean"], ["fit"], ["movie"], ["study"], ["study-score"], ["nightly"], ["trust"],
    ["table"], ["pack"], ["verify"], ["reproduce"], ["diff"],
)  # fmt: skip


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
        (["run", "--protocols", "park2021@9"], "error: unknown protocol 'park2021@9'"),
        (["report", "nowhere"], "error: nowhere"),
        (["new-adapter", "My Method"], "cannot name an adapter file"),
        (["check", "nowhere.py"], "error: no file nowhere.py"),
        (["export-tasks", "out", "--protocol", "nope@1"], "error: unknown protocol 'nope@1'"),
        (["export-tasks", "out", "--labels", "actor"], "error: --labels: unknown label actor"),
        (["score", "nowhere"], "nowhere"),
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


def test_a_new_adapter_is_not_written_over(tmp_path: Path) -> None:
    first = stylebench("new-adapter", "mine", cwd=tmp_path)
    assert first.stdout == "wrote mine.py; now: stylebench check mine.py\n"
    outside = stylebench("new-adapter", "other", "--outside", cwd=tmp_path)
    assert outside.stdout == "wrote other/adapter.toml; now: stylebench check other/adapter.toml\n"
    again = stylebench("new-adapter", "mine", cwd=tmp_path)
    assert again.returncode == 2 and "is already there" in again.stderr


@pytest.mark.slow
def test_from_nothing_to_a_checked_adapter(tmp_path: Path) -> None:
    stylebench("new-adapter", "mine", cwd=tmp_path)
    checked = stylebench("check", "mine.py", "--json", cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout
    assert all(row["ok"] is not False for row in json.loads(checked.stdout))
    text = (tmp_path / "mine.py").read_text()
    (tmp_path / "bad.py").write_text(text.replace("def transfer(", "def transfer_(", 1))
    bad = stylebench("check", "bad.py", cwd=tmp_path)
    assert bad.returncode == 1 and "remedy" in bad.stderr


@pytest.mark.slow
def test_from_exported_tasks_to_a_row_without_code(tmp_path: Path) -> None:
    assert stylebench("export-tasks", "out", "--profile", "smoke", "--motions", "npz", cwd=tmp_path).returncode == 0
    manifest = json.loads((tmp_path / "out" / "manifest.json").read_text())
    incomplete = stylebench("score", "out", cwd=tmp_path)
    assert incomplete.returncode == 2 and "100 of 100 answers are missing" in incomplete.stderr
    for task in manifest["tasks"]:
        content = tmp_path / "out" / task["content"]
        (tmp_path / "out" / task["answer"]).write_bytes(content.read_bytes())
    assert stylebench("check", "out", cwd=tmp_path).returncode == 0
    scored = stylebench("score", "out", "--out", "run", cwd=tmp_path)
    assert scored.returncode == 0, scored.stderr
    assert "my method" in scored.stdout
    [record] = [json.loads(path.read_text()) for path in (tmp_path / "run" / "records").glob("*.json")]
    assert record["copies"] and record["method"]["trained_on"] == "not said"


def test_a_paper_table_is_explained_and_runs_are_compared(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "records", [FakeMethod("park2021", "Park 2021"), FakeMethod("mine", "Mine")])
    shown = runner.invoke(app, ["table", "park2021.table2", "--records", str(folder), "--format", "md"])
    assert shown.exit_code == 0 and "42.81 ± 2.53" in shown.output
    told = runner.invoke(app, ["table", "park2021.table2", "--records", str(folder), "--explain", "park2021:CRA"])
    assert "published: 60.86 ± 2.06 %" in told.output and "ours: none; no record" in told.output
    same = runner.invoke(app, ["diff", str(folder), str(folder)])
    assert same.exit_code == 0 and "separable at 0.05" in same.output


def test_verify_fails_with_exit_code_1_and_names_the_record(tmp_path: Path) -> None:
    folder = write_run(tmp_path / "records", [FakeMethod("mine", "Mine")])
    [path] = folder.glob("*.json")
    path.write_text(path.read_text().replace('"status": "ok"', '"status": "fine"'))
    out = ["--out", str(tmp_path / "out"), "--store", str(tmp_path / "store")]
    result = runner.invoke(app, ["verify", str(folder), "--json", *out])
    [claim] = json.loads(result.stdout)
    assert result.exit_code == 1 and claim["verdict"] == "fail" and path.name in claim["record"]


def test_commands_in_records_name_no_folder_of_this_machine() -> None:
    typed = [
        "run",
        "--data",
        "bandai-namco=/home/me/data/bandai.zip",
        "--tracks",
        "transfer,parts",
        "--out",
        "/tmp/x/out",
    ]
    said = command_line([*typed, "--protocols", "park2021@1/table2", "--store=/a/b/store", "mine/records"])
    assert said == (
        "stylebench run --data bandai-namco=bandai.zip --tracks transfer,parts --out out "
        "--protocols park2021@1/table2 --store=store mine/records"
    )
