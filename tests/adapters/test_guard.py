from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from bench.adapters.guarded import end_guarded, start_guarded
from tests.adapters.outside import left_behind
from tests.waiting import wait_for

ROOT = Path(__file__).resolve().parents[2]


@contextmanager
def started(code: str, folder: Path) -> Iterator[tuple[subprocess.Popen[bytes], Callable[[], None]]]:
    """A guarded Python program that is told of ``folder``, once it has said that it is ready; and how to let it go."""
    exchange = folder / "exchange"
    exchange.mkdir()
    command = [sys.executable, "-c", textwrap.dedent(code), str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process, lifeline = start_guarded(command, exchange, working_folder=folder, environment=environment)
    nothing_to_pump = threading.Thread(target=int)
    nothing_to_pump.start()
    with ExitStack() as stack:
        stack.callback(end_guarded, process, lifeline, nothing_to_pump)
        assert process.stdout is not None
        assert process.stdout.readline() == b"ready\n"
        yield process, stack.close


def test_letting_go_ends_the_program_and_removes_its_folder(tmp_path: Path) -> None:
    with started("import time; print('ready', flush=True); time.sleep(600)", tmp_path) as (process, let_go):
        assert left_behind(tmp_path)
        let_go()
        assert process.returncode == 0
    assert left_behind(tmp_path) == []
    assert not (tmp_path / "exchange").exists()


@pytest.mark.parametrize(("end", "code"), [("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", 137)])
def test_exit_code_is_the_programs(tmp_path: Path, end: str, code: int) -> None:
    with started(f"import os, sys; print('ready', flush=True); {end}", tmp_path) as (process, _):
        assert process.wait(20.0) == code
        assert not (tmp_path / "exchange").exists()


def test_signals_meant_for_the_harness_do_not_stop_the_guard(tmp_path: Path) -> None:
    with started("import time; print('ready', flush=True); time.sleep(600)", tmp_path) as (process, _):
        for number in (1, 2, 15):
            process.send_signal(number)
        time.sleep(0.3)
        assert process.poll() is None
    assert left_behind(tmp_path) == []


def test_programs_that_multiply_are_all_ended(tmp_path: Path) -> None:
    code = """
    import os, sys, time
    first = os.getpid()
    for _ in range(3):
        if os.fork() == 0:
            os.setsid()
    if os.getpid() == first:
        print('ready', flush=True)
    time.sleep(600)
    """
    with started(code, tmp_path):
        wait_for(lambda: len(left_behind(tmp_path)) == 9, "eight programs and their guard")
    assert left_behind(tmp_path) == []


@pytest.mark.parametrize("wait_s", [0.0, 0.5])
def test_a_guard_within_a_guard_cleans_up_too(tmp_path: Path, wait_s: float) -> None:
    """Also where it is so slow to start that it has not yet begun when the outer one ends."""
    inner = tmp_path / "inner"
    inner.mkdir()
    code = f"""
    import sys, time
    from pathlib import Path
    from bench.adapters.guarded import start_guarded
    command = [sys.executable, "-c", "import time; time.sleep(600)", sys.argv[1]]
    kept = start_guarded(command, Path({str(inner)!r}), working_folder=Path.cwd(), environment={{}})
    time.sleep({wait_s})
    print('ready', flush=True)
    time.sleep(600)
    """
    with started(code, tmp_path) as (_, let_go):
        let_go()
    assert left_behind(tmp_path) == []
    assert not inner.exists()
