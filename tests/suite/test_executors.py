"""Local processes that are killed, hang on a dead parent, or do their work."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import psutil
import pytest

from bench.errors import BadConfig
from bench.suite import executors
from bench.suite.executors import workers_of
from tests.waiting import started, wait_for


@dataclass(frozen=True)
class Square:
    """A call that kills its process, always or once."""

    number: int
    dies: str = ""
    folder: str = ""

    def run(self) -> str:
        if self.dies == "always" or (self.dies == "once" and self._first()):
            os.kill(os.getpid(), signal.SIGKILL)
        return str(self.number**2)

    def lost(self, reason: str) -> str:
        return f"lost: {reason}"

    def _first(self) -> bool:
        mark = Path(self.folder) / str(self.number)
        if mark.exists():
            return False
        mark.touch()
        return True


@pytest.mark.slow
def test_answers_keep_their_order_and_a_killed_process_costs_one_more_try(tmp_path: Path) -> None:
    calls = [Square(2), Square(3, "once", str(tmp_path)), Square(4, "always"), Square(5), Square(6)]
    counts: list[int] = []
    with workers_of("", 2) as workers:
        answers = workers.run(calls, done=counts.append)
    assert answers[:2] == ["4", "9"] and answers[3:] == ["25", "36"]
    assert answers[2].startswith("lost: its worker was lost twice")
    assert counts == [1, 2, 3, 4, 5]


@pytest.mark.slow
def test_an_error_of_a_call_is_no_loss() -> None:
    with workers_of("", 1) as workers, pytest.raises(TypeError):
        workers.run([Square("text")])  # type: ignore[arg-type]


@pytest.mark.slow
def test_processes_leave_when_the_one_that_started_them_is_killed() -> None:
    code = (
        "import time\nfrom bench.suite.executors import LocalProcesses\n"
        "if __name__ == '__main__':\n"
        "    processes = LocalProcesses(1)\n    print(processes.submit(abs, -1).result(), flush=True)\n"
        "    time.sleep(60)"
    )
    with started([sys.executable, "-c", code], stdout=subprocess.PIPE) as main:
        assert main.stdout is not None and main.stdout.readline() == b"1\n"
        children = psutil.Process(main.pid).children(recursive=True)
        assert children
    wait_for(lambda: not any(_lives(child) for child in children), "the end of the processes", 20.0)


def _lives(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.NoSuchProcess:
        return False


def test_no_scheduler_there_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(executors, "CONNECT_S", 1)
    for scheduler, problem in (
        ("tcp://127.0.0.1:1", "no Dask scheduler answers at tcp://127"),
        (str(tmp_path / "no.json"), "no file .*no.json"),
    ):
        with pytest.raises(BadConfig, match=problem), workers_of(scheduler, 1):
            pass
