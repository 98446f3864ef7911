"""Waiting for other processes, as long as a busy machine needs."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import TypeVar

Found = TypeVar("Found")

PATIENCE_S = 600.0


def wait_for(condition: Callable[[], Found | None], what: str, patience_s: float = PATIENCE_S) -> Found:
    """What a condition gives, once it gives something; ``patience_s`` is a bound where the time is ours to keep."""
    deadline = time.monotonic() + patience_s
    while not (found := condition()):
        assert time.monotonic() < deadline, what
        time.sleep(0.1)
    return found


@contextmanager
def started(
    command: Sequence[str], stdout: int | None = None, env: Mapping[str, str] | None = None
) -> Iterator[subprocess.Popen[bytes]]:
    """A process that is gone at the end, whatever a test that failed left of it."""
    with subprocess.Popen(command, stdout=stdout, env=env) as process:
        try:
            yield process
        finally:
            process.kill()
