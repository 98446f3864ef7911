"""A small process between the harness and an outside program: whatever happens, nothing of the program stays behind.

Run as ``python -I guard.py LIFELINE_FD FOLDER COMMAND...``; nothing of this package is imported. The harness holds the
other end of the lifeline. When the program ends, or the harness does (killed or not), the guard kills everything that
descends from the program, also what left its process group, removes ``FOLDER`` and leaves.
"""

from __future__ import annotations

import contextlib
import ctypes
import os
import select
import shutil
import signal
import subprocess
import sys
import time

import psutil

POLL_S = 0.05
PR_SET_CHILD_SUBREAPER = 36
GRACE_S = 1.0
INNER_GUARDS_S = 10.0
"""A guard within needs a moment to start, to kill and to remove its folder; on a busy machine, more of it."""
GIVE_UP_S = 10.0
CANNOT_START = 127


def main(arguments: list[str]) -> int:
    """Guard one program; the exit code is the program's, 128 + n where signal n ended it."""
    lifeline, folder, *command = arguments
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # A function, not SIG_IGN: what is ignored would be ignored by the program too.
        signal.signal(number, lambda *_: None)
    _adopt_orphans()
    try:
        program = subprocess.Popen(command, start_new_session=True)
    except OSError as error:
        sys.stderr.write(f"cannot start {command[0]}: {error}\n")
        shutil.rmtree(folder, ignore_errors=True)
        return CANNOT_START
    # Only the program may hold the protocol's ends, else the harness never sees it close them.
    empty = os.open(os.devnull, os.O_RDWR)
    os.dup2(empty, 0)
    os.dup2(empty, 1)
    os.dup2(empty, 2)
    ended = [int(lifeline)]
    while program.poll() is None and not select.select(ended, [], [], POLL_S)[0]:
        pass
    code = program.poll()
    program.kill()
    program.wait()
    _wait_for_inner_guards()
    _kill_descendants()
    shutil.rmtree(folder, ignore_errors=True)
    return 0 if code is None else code if code >= 0 else 128 - code


def _adopt_orphans() -> None:
    """Let processes whose parent died become children of this one, so that they can be found. Linux only."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _wait_for_inner_guards() -> None:
    """What the program itself had guarded is cleaned up by those guards, if they are given a moment."""
    started = time.monotonic()
    while alive := _living_descendants():
        seconds = time.monotonic() - started
        if seconds >= (INNER_GUARDS_S if any(map(_is_guard, alive)) else GRACE_S):
            return
        time.sleep(POLL_S)


def _is_guard(process: psutil.Process) -> bool:
    try:
        return __file__ in process.cmdline()
    except psutil.Error:
        return False


def _kill_descendants() -> None:
    deadline = time.monotonic() + GIVE_UP_S
    while time.monotonic() < deadline:
        alive = _living_descendants()
        if not alive:
            return
        # All are halted before any is killed, so that none can start another meanwhile.
        for action in (psutil.Process.suspend, psutil.Process.kill):
            for process in alive:
                with contextlib.suppress(psutil.Error):
                    action(process)
        psutil.wait_procs(alive, timeout=1.0)


def _living_descendants() -> list[psutil.Process]:
    return [process for process in psutil.Process().children(recursive=True) if _is_alive(process)]


def _is_alive(process: psutil.Process) -> bool:
    try:
        return bool(process.status() != psutil.STATUS_ZOMBIE)
    except psutil.Error:
        return False


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
