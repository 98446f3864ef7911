"""A tiny benchmark that is killed, repeated, changed and moved: what is stored is never lost, repeated or half-read."""

from __future__ import annotations

import random
import shutil
import subprocess
import sys
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path

import psutil
import pytest

from bench.suite.output import write_report
from bench.suite.run import RunResult
from tests.suite.tiny import METHODS, contents, tiny_run
from tests.waiting import started, wait_for

pytestmark = pytest.mark.slow

N_KILLS = 20
MOODY = """
from pathlib import Path
from bench.adapters.base import Adapter

class Moody(Adapter):
    name = "moody"

    def transfer(self, content, style, *, rng):
        folder = Path(__file__).parent
        if not (folder / "good mood").exists():
            with (folder / "refused").open("a") as file:
                file.write("x")
            raise ValueError("not today")
        return content.clip
"""


def again(folder: Path, name: str, versions: dict[str, int] | None = None) -> RunResult:
    return tiny_run(folder / name, folder / "store", versions)


def test_a_second_run_does_nothing_and_says_the_same(undisturbed: Path) -> None:
    result = again(undisturbed, "second")
    assert (result.generated, result.scored) == (0, 0)
    assert contents(undisturbed / "second") == contents(undisturbed / "out")


def test_a_new_metric_version_recomputes_that_metric_alone(
    undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from bench.metrics import METRICS

    monkeypatch.setitem(METRICS, "cra", METRICS["cra"])
    shutil.copytree(undisturbed / "store", tmp_path / "store")
    result = again(tmp_path, "version", {"cra": 2})
    assert (result.generated, result.scored) == (0, len(METHODS))


def test_a_moved_run_goes_on(undisturbed: Path, tmp_path: Path) -> None:
    """All but two cells are there; nothing that is there is done again, wherever it now lies."""
    shutil.copytree(undisturbed, tmp_path / "runs")
    motions = sorted((tmp_path / "runs" / "store" / "motions").iterdir())
    for folder in motions[:2]:
        shutil.rmtree(folder)
    (tmp_path / "elsewhere").mkdir()
    moved = (tmp_path / "runs").rename(tmp_path / "elsewhere" / "moved")
    result = again(moved, "out")
    assert (result.generated, result.scored) == (2, 0)
    assert contents(moved / "out") == contents(undisturbed / "out")


def test_failures_are_tried_again_unless_kept(undisturbed: Path, tmp_path: Path) -> None:
    shutil.copytree(undisturbed / "store", tmp_path / "store")
    file = tmp_path / "moody.py"
    file.write_text(MOODY)

    def run(*, keep_failures: bool) -> tuple[RunResult, str, str]:
        result = tiny_run(tmp_path / "out", tmp_path / "store", adapter_files=(str(file),), keep_failures=keep_failures)
        assert [record.status for record in result.records[:-1]] == ["ok"] * len(METHODS)
        return result, result.records[-1].status, result.records[-1].reason

    first, status, reason = run(keep_failures=True)
    assert (first.generated, status, reason) == (0, "failed", "ValueError: not today")
    assert (tmp_path / "out" / first.records[-1].log).is_file()
    assert run(keep_failures=False)[1:] == ("failed", "ValueError: not today")
    (tmp_path / "good mood").touch()
    kept, status, reason = run(keep_failures=True)
    assert (status, reason) == ("failed", "ValueError: not today")
    assert (tmp_path / "out" / kept.records[-1].log).is_file()
    assert (tmp_path / "refused").read_text() == "xx"
    second, status, _ = run(keep_failures=False)
    assert (second.generated, status) == (1, "ok")
    assert run(keep_failures=True)[1] == "ok"

    file.write_text(MOODY.replace("return content.clip", "return content.clip  # changed"))
    changed, status, _ = run(keep_failures=False)
    assert (changed.generated, changed.scored, status) == (1, 0, "ok")


def test_killed_runs_resume_and_end_the_same(undisturbed: Path, tmp_path: Path) -> None:
    """SIGKILL for the main process or one that it started, at random moments; finished work stays as it is."""
    out, store = tmp_path / "out", tmp_path / "store"
    command = [sys.executable, "-m", "tests.suite.tiny", str(out), str(store)]
    chance = random.Random(0)
    finished: dict[tuple[str, str], int] = {}
    kills = workers_killed = 0
    with ExitStack() as stack:
        main = stack.enter_context(started(command))
        while kills < N_KILLS:
            kills_a_worker = chance.random() < 0.5
            if kills_a_worker:
                wait_for(partial(_has_ended_or_works, main), "a worker of the run")
            try:
                assert main.wait(timeout=chance.uniform(0.5, 10.0)) == 0
                lives = False
            except subprocess.TimeoutExpired:
                kills += 1
                lives = kills_a_worker and _worker_killed(main, chance)
                workers_killed += lives
                if not lives:
                    main.kill()
                    main.wait()
            if not lives:
                main = stack.enter_context(started(command))
            now = results(store)
            assert finished.items() <= now.items()
            finished = now
        assert main.wait() == 0
    assert subprocess.run(command, check=False).returncode == 0

    assert 0 < workers_killed < N_KILLS
    assert contents(out) == contents(undisturbed / "out")
    assert results(store).keys() == results(undisturbed / "store").keys()
    assert list((store / "tmp").iterdir()) == []
    shutil.copytree(undisturbed / "out", tmp_path / "undisturbed")
    assert write_report(out) == write_report(tmp_path / "undisturbed")
    pgrep = ["pgrep", "-f", str(tmp_path)]
    wait_for(lambda: subprocess.run(pgrep, capture_output=True).returncode == 1, "the end of orphaned workers", 60.0)


def _has_ended_or_works(main: subprocess.Popen[bytes]) -> bool:
    return main.poll() is not None or bool(psutil.Process(main.pid).children(recursive=True))


def _worker_killed(main: subprocess.Popen[bytes], chance: random.Random) -> bool:
    """Kill one of the processes that the main one started; False where there is none."""
    workers = psutil.Process(main.pid).children(recursive=True)
    if workers:
        with suppress(psutil.NoSuchProcess):
            chance.choice(workers).kill()
    return bool(workers)


def results(store: Path) -> dict[tuple[str, str], int]:
    """Stage and key of everything that is finished in a store, with the time in ns; drafts do not count."""
    return {
        (path.parent.parent.name, path.parent.name): path.stat().st_mtime_ns
        for path in store.glob("*/*/done.json")
        if path.parent.parent.name != "tmp"
    }
