"""Importing a stranger's adapter for the first time, in a process of its own: it may crash, hang or leave.

Started as ``python -m bench.adapters.probe OPTION``; one JSON line on what was stdout at the start says how it went.
"""

from __future__ import annotations

import json
import os
import select
import sys
import time
from dataclasses import dataclass

from bench.adapters.guarded import GuardedModule
from bench.adapters.loading import source_from_option
from bench.errors import BadConfig, BenchError

IMPORT_LIMIT_S = 120.0
MAX_ANSWER_BYTES = 2**16


@dataclass(frozen=True)
class ImportFailure:
    """Why an adapter cannot be imported, and the last that the import printed."""

    reason: str
    log: str


def import_failure(option: str, *, limit_s: float = IMPORT_LIMIT_S) -> ImportFailure | None:
    """Why ``FILE.py[:Class]`` or ``adapter.toml`` cannot be imported within ``limit_s``; None where it can.

    Raises
    ------
    BadConfig : the option itself is wrong: no such file, no adapter class in it, or several.
    """
    with GuardedModule("bench.adapters.probe", option, environment=dict(os.environ)) as importing:
        importing.hang_up()
        said = _line(importing.answers, time.monotonic() + limit_s)
    reason = _reason(said, limit_s)
    return ImportFailure(reason, importing.printed.decode("utf-8", "replace")) if reason else None


def _reason(said: bytes | None, limit_s: float) -> str:
    if said is None:
        return f"importing it took more than {limit_s:g} s"
    try:
        answer = json.loads(said)
        kind, text = str(answer["kind"]), str(answer["text"])
    except (ValueError, KeyError, TypeError, RecursionError):
        return "the process that imported it ended without a word"
    if kind == "bad":
        raise BadConfig(text, where="--adapter")
    return text


def _line(pipe: int, deadline: float) -> bytes | None:
    """What comes through a pipe up to the first line end or its close; None where that takes too long."""
    data = b""
    while b"\n" not in data and len(data) < MAX_ANSWER_BYTES:
        left = deadline - time.monotonic()
        if left <= 0.0 or not select.select([pipe], [], [], left)[0]:
            return None
        more = os.read(pipe, 65536)
        if not more:
            break
        data += more
    return data


def main(arguments: list[str]) -> int:
    """Import the adapter and say how it went."""
    line = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    try:
        source_from_option(arguments[0])
        kind, text = "ok", ""
    except BadConfig as error:
        kind, text = "bad", error.problem
    except BenchError as error:
        kind, text = "failed", error.problem
    line.write(json.dumps({"kind": kind, "text": " ".join(text.split())[:400]}) + "\n")
    line.flush()
    # What the import started, threads above all, does not keep this process.
    os._exit(0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
