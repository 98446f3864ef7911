"""The check in a process of its own: an adapter that hangs, floods, dies or leaves children costs a row, no more.

Started as ``python -m bench.adapters.check_run ADAPTER``; rows travel as JSON lines on its stdout, what the adapter
prints goes to a log file.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path

from bench.adapters.answers import CheckRow
from bench.adapters.check import check_adapter
from bench.adapters.guarded import GuardedModule
from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.adapters.session import one_line
from bench.errors import BenchError

ROW_LIMIT_S = 300.0
"""Seconds that one check may take before the adapter counts as hanging."""


def check_option(option: str, *, log: Path, row_limit_s: float = ROW_LIMIT_S) -> Iterator[CheckRow]:
    """Rows of the check of ``FILE.py``, ``FILE.py:Class``, ``FOLDER/adapter.toml`` or the name of a method.

    Parameters
    ----------
    log : file that gets what the adapter prints.
    row_limit_s : how long one check may take.
    """
    root = Path(__file__).resolve().parents[2]
    environment = {**os.environ, "PYTHONUNBUFFERED": "1", "PYTHONPATH": _path_with(root)}
    with GuardedModule("bench.adapters.check_run", option, environment=environment, log=log) as checking:
        yield from _rows(checking, row_limit_s, log)


def _rows(checking: GuardedModule, row_limit_s: float, log: Path) -> Iterator[CheckRow]:
    buffer, expected = b"", "an answer to every check"
    deadline = time.monotonic() + row_limit_s
    while True:
        while b"\n" in buffer:
            line, buffer = buffer.split(b"\n", 1)
            row = json.loads(line)
            if row is None:
                return
            yield CheckRow(**row)
            deadline = time.monotonic() + row_limit_s
        left = deadline - time.monotonic()
        if left <= 0.0:
            remedy = f"run its calls by hand; what it printed is in {log}"
            yield CheckRow("answers in time", False, expected, f"nothing for {row_limit_s:g} s", "it hangs", remedy)
            return
        if select.select([checking.answers], [], [], left)[0]:
            data = os.read(checking.answers, 65536)
            if not data:
                yield CheckRow("stays alive", False, expected, _end_of(checking.process), remedy=f"see its log, {log}")
                return
            buffer += data


def _end_of(process: subprocess.Popen[bytes]) -> str:
    try:
        code = process.wait(5.0)
    except subprocess.TimeoutExpired:
        return "it closed all its files"
    return f"killed by signal {code - 128}" if code > 128 else f"it ended with exit code {code}"


def _path_with(root: Path) -> str:
    return os.pathsep.join([str(root), *filter(None, [os.environ.get("PYTHONPATH")])])


def main(arguments: list[str]) -> int:
    """Check one adapter; every outcome is a row."""
    out = os.dup(1)
    os.dup2(2, 1)

    def send(row: CheckRow | None) -> None:
        os.write(out, (json.dumps(None if row is None else asdict(row)) + "\n").encode())

    from bench.datasets.procedural import load

    option = arguments[0]
    try:
        is_path = "/" in option or option.partition(":")[0].endswith((".py", ".toml"))
        adapter = find_adapter(source_from_option(option) if is_path else AdapterSource(option))
        for row in check_adapter(adapter, load(None).takes):
            send(row)
    except BenchError as error:
        where = f"{error.where}: " if error.where else ""
        send(CheckRow("loads", False, "one adapter", one_line(where + error.problem), error.cause, error.remedy))
    send(None)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
