"""What all worker processes have in common: they end with their parent, and say in a status and a line what failed."""

from __future__ import annotations

import os
import threading
import time

from bench.adapters.session import OutOfTime
from bench.errors import BadMotion, BadOutput, BenchError
from reports.records import Status


def leave_with_parent(parent: int) -> None:
    """From now on, end this process soon after ``parent``, which started it, is gone, also in the middle of a call."""
    threading.Thread(target=_watch, args=(parent,), daemon=True).start()


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(1.0)
    os._exit(1)


def leave_if_forked(own: int) -> None:
    """End a process that a method forked and that came back here: it must neither go on nor report for its parent."""
    if os.getpid() != own:
        os._exit(1)


def status_of(error: Exception) -> Status:
    """How a cell ends that an error ends."""
    match error:
        case BadOutput() | BadMotion():
            return "invalid"
        case MemoryError():
            return "oom"
        case OutOfTime():
            return "timeout"
    return "failed"


def reason_of(error: Exception) -> str:
    """An error as one line."""
    text = str(error) if isinstance(error, BenchError) else f"{type(error).__name__}: {error}"
    return " ".join(text.split())
