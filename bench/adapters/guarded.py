"""Starting processes under a guard, so that nothing of them outlives this one, and ending them again."""

from __future__ import annotations

import contextlib
import os
import shutil
import subprocess
import sys
import tempfile
import threading
import weakref
from pathlib import Path
from types import TracebackType
from typing import IO, Self

from bench.adapters import guard

LOG_BYTES = 4 << 20
"""How much of a program's chatter is kept; the rest is read and dropped."""


class Guarded:
    """A command under a guard. It ends with :meth:`end`, with this object, or with this process, however that ends.

    Attributes
    ----------
    process : the guard; the command and its children descend from it.
    requests, answers : descriptors of the pipes to its stdin and from its stdout.
    printed : the last that it wrote to stderr.
    """

    def __init__(
        self, command: list[str], folder: Path, *, working_folder: Path, environment: dict[str, str], log_fd: int | None
    ) -> None:
        """Start a command; ``folder`` is removed when it ends, ``log_fd`` gets what it writes to stderr."""
        try:
            self.process, lifeline = start_guarded(
                command, folder, working_folder=working_folder, environment=environment
            )
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise
        pipes = (self.process.stdin, self.process.stdout, self.process.stderr)
        self.requests, self.answers, errors = (-1 if pipe is None else pipe.fileno() for pipe in pipes)
        self.printed = bytearray()
        self._pump = threading.Thread(target=copy_log, args=(errors, log_fd, self.printed), daemon=True)
        self._pump.start()
        self._end = weakref.finalize(self, end_guarded, self.process, lifeline, self._pump)

    @property
    def is_open(self) -> bool:
        """False once it has been ended from here."""
        return self._end.alive

    def last_words(self) -> str:
        """The last line that it wrote to stderr; where it has ended, all of that has been read."""
        if self.process.poll() is not None:
            self._pump.join(2.0)
        lines = [line.strip() for line in bytes(self.printed).decode("utf-8", "replace").splitlines()]
        return next((line for line in reversed(lines) if line), "")

    def hang_up(self) -> None:
        """Close the line to it: it hears nothing more."""
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()

    def end(self) -> None:
        """Kill what is left of it."""
        self._end()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self.end()


class GuardedModule(Guarded):
    """A module of ours, ``python -m MODULE ARGUMENT``, with a temporary folder of its own that ends with it."""

    def __init__(self, module: str, argument: str, *, environment: dict[str, str], log: Path | None = None) -> None:
        """Start it; ``log`` is the file that gets what it writes to stderr."""
        self._log: IO[bytes] | None = log.open("wb") if log else None
        folder = Path(tempfile.mkdtemp(prefix="stylebench-module-"))
        super().__init__(
            [sys.executable, "-m", module, argument],
            folder,
            working_folder=Path.cwd(),
            environment=environment | {"TMPDIR": str(folder)},
            log_fd=self._log.fileno() if self._log else None,
        )

    def end(self) -> None:
        """Kill what is left of it, and close its log."""
        super().end()
        if self._log:
            self._log.close()


def start_guarded(
    command: list[str], exchange: Path, *, working_folder: Path, environment: dict[str, str]
) -> tuple[subprocess.Popen[bytes], int]:
    """Start a command, its three standard streams as pipes, so that nothing of it outlives this process.

    Once the second value, a file descriptor, is closed, the command and all that descends from it are killed and the
    folder ``exchange`` is removed.
    """
    lifeline_read, lifeline = os.pipe()
    try:
        process = subprocess.Popen(
            [sys.executable, "-I", guard.__file__, str(lifeline_read), str(exchange), *command],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            bufsize=0,
            pass_fds=(lifeline_read,),
            start_new_session=True,
            cwd=working_folder,
            env=environment,
        )
    except BaseException:
        os.close(lifeline)
        raise
    finally:
        os.close(lifeline_read)
    return process, lifeline


def copy_log(source: int, target: int | None, tail: bytearray) -> None:
    """Copy a program's stderr to the log up to a limit, and keep its last words."""
    left = LOG_BYTES
    while True:
        try:
            data = os.read(source, 65536)
            if not data:
                return
            tail += data
            del tail[:-4000]
            if target is not None and left > 0:
                os.write(target, data[:left])
                left -= len(data)
                if left <= 0:
                    os.write(target, b"\n[the rest of the log is dropped]\n")
        except OSError:
            return


def end_guarded(process: subprocess.Popen[bytes], lifeline: int, pump: threading.Thread) -> None:
    """Let go of the lifeline: the guard kills what is left and leaves."""
    os.close(lifeline)
    try:
        process.wait(guard.INNER_GUARDS_S + guard.GIVE_UP_S + 5.0)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
    pump.join(1.0)
    for pipe in (process.stdin, process.stdout, process.stderr):
        if pipe is not None:
            with contextlib.suppress(OSError):
                pipe.close()
