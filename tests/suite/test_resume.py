"""A tiny benchmark that is killed, repeated and changed: what is stored is never lost, repeated or half-read."""

from __future__ import annotations

import json
import random
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bench.suite.run import RunResult
from tests.suite.tiny import METHODS, tiny_run

pytestmark = pytest.mark.slow

N_KILLS = 10


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a finished run in ``out`` and its ``store``."""
    folder = tmp_path_factory.mktemp("undisturbed")
    result = tiny_run(folder / "out", folder / "store")
    assert result.generated == len(METHODS) and [r.status for r in result.records] == ["ok"] * len(METHODS)
    return folder


def contents(out: Path) -> dict[str, Any]:
    """Records without times, memory and host facts, and the arrays of the samples files, by file name."""
    found: dict[str, Any] = {}
    for path in sorted((out / "records").iterdir()):
        if path.suffix == ".json":
            record = json.loads(path.read_text())
            del record["provenance"], record["log"]
            found[path.name] = record
        else:
            with np.load(path, allow_pickle=False) as arrays:
                found[path.name] = {name: arrays[name].tobytes() for name in arrays.files}
    return found


def again(folder: Path, name: str, versions: dict[str, int] | None = None) -> RunResult:
    return tiny_run(folder / name, folder / "store", versions)


def test_a_second_run_does_nothing_and_says_the_same(undisturbed: Path) -> None:
    result = again(undisturbed, "second")
    assert (result.generated, result.scored) == (0, 0)
    assert contents(undisturbed / "second") == contents(undisturbed / "out")


def test_a_new_metric_version_recomputes_that_metric_alone(undisturbed: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from bench.metrics import METRICS

    monkeypatch.setitem(METRICS, "cra", METRICS["cra"])
    result = again(undisturbed, "version", {"cra": 2})
    assert (result.generated, result.scored) == (0, len(METHODS))


def test_from_scratch_gives_the_same_numbers(undisturbed: Path, tmp_path: Path) -> None:
    tiny_run(tmp_path / "out", tmp_path / "store")
    assert contents(tmp_path / "out") == contents(undisturbed / "out")


def test_killed_runs_resume_and_end_the_same(undisturbed: Path, tmp_path: Path) -> None:
    """SIGKILL at random moments; finished work is kept, nothing half-written is ever read."""
    command = [sys.executable, "-m", "tests.suite.tiny", str(tmp_path / "out"), str(tmp_path / "store")]
    moments = random.Random(0)
    for _ in range(N_KILLS):
        process = subprocess.Popen(command)
        try:
            process.wait(timeout=moments.uniform(2.0, 12.0))
        except subprocess.TimeoutExpired:
            process.send_signal(signal.SIGKILL)
            process.wait()
    assert subprocess.run(command, check=False).returncode == 0
    assert contents(tmp_path / "out") == contents(undisturbed / "out")
    assert list((tmp_path / "store" / "tmp").iterdir()) == []
    _wait_for_orphans(str(tmp_path))


def _wait_for_orphans(marker: str) -> None:
    """Workers of killed runs end by themselves within seconds."""
    deadline = time.monotonic() + 10.0
    while time.monotonic() < deadline:
        found = subprocess.run(["pgrep", "-f", marker], capture_output=True, text=True, check=False).stdout.split()
        if not found:
            return
        time.sleep(0.5)
    pytest.fail(f"processes of killed runs still live: {found}")
