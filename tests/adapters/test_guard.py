from __future__ import annotations

import os
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest

from bench.adapters.guarded import end_guarded, start_guarded
from tests.adapters.outside import left_behind

ROOT = Path(__file__).resolve().parents[2]


def started(code: str, folder: Path) -> tuple[subprocess.Popen[bytes], int]:
    """A guarded Python program that is told of ``folder``, once it has said that it is ready."""
    exchange = folder / "exchange"
    exchange.mkdir()
    command = [sys.executable, "-c", textwrap.dedent(code), str(folder)]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process, lifeline = start_guarded(command, exchange, working_folder=folder, environment=environment)
    assert process.stdout is not None
    assert process.stdout.readline() == b"ready\n"
    return process, lifeline


def ended(process: subprocess.Popen[bytes], lifeline: int) -> int:
    nothing_to_pump = threading.Thread(target=int)
    nothing_to_pump.start()
    end_guarded(process, lifeline, nothing_to_pump)
    return process.returncode


def test_letting_go_ends_the_program_and_removes_its_folder(tmp_path: Path) -> None:
    process, lifeline = started("import time; print('ready', flush=True); time.sleep(600)", tmp_path)
    assert left_behind(tmp_path)
    assert ended(process, lifeline) == 0
    assert left_behind(tmp_path) == []
    assert not (tmp_path / "exchange").exists()


@pytest.mark.parametrize(("end", "code"), [("sys.exit(3)", 3), ("os.kill(os.getpid(), 9)", 137)])
def test_exit_code_is_the_programs(tmp_path: Path, end: str, code: int) -> None:
    process, lifeline = started(f"import os, sys; print('ready', flush=True); {end}", tmp_path)
    assert process.wait(20.0) == code
    assert not (tmp_path / "exchange").exists()
    ended(process, lifeline)


def test_signals_meant_for_the_harness_do_not_stop_the_guard(tmp_path: Path) -> None:
    process, lifeline = started("import time; print('ready', flush=True); time.sleep(600)", tmp_path)
    for number in (1, 2, 15):
        process.send_signal(number)
    time.sleep(0.3)
    assert process.poll() is None
    ended(process, lifeline)
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
    process, lifeline = started(code, tmp_path)
    deadline = time.monotonic() + 20.0
    while len(left_behind(tmp_path)) < 9 and time.monotonic() < deadline:
        time.sleep(0.1)
    assert len(left_behind(tmp_path)) == 9, "eight programs and their guard"
    ended(process, lifeline)
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
    process, lifeline = started(code, tmp_path)
    ended(process, lifeline)
    assert left_behind(tmp_path) == []
    assert not inner.exists()
