"""Loaded takes on disk, so that parsing and generating happen once per machine.

The folder is ``$STYLEBENCH_CACHE``, or ``~/.cache/stylebench``. An entry is a pack under a key that says where it came
from and which version of the reader made it; it becomes visible by one rename, and a damaged one is made again.
"""

from __future__ import annotations

import json
import os
import shutil
import uuid
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bench.datasets.pack import Pack, write_pack
from bench.datasets.take import Take
from bench.errors import BenchError

FACTS_FILE = "facts.json"

Made = tuple[Sequence[Take], dict[str, Any]]


def cache_root() -> Path:
    """Where cached takes lie."""
    named = os.environ.get("STYLEBENCH_CACHE")
    return Path(named) if named else Path.home() / ".cache" / "stylebench"


def cached_takes(key: str, make: Callable[[], Made]) -> tuple[tuple[Take, ...], dict[str, Any]]:
    """The takes and JSON facts stored under ``key``; made, stored and returned where there are none.

    A cache that cannot be written is not an error: the takes are then made again next time.
    """
    folder = cache_root() / key
    found = _read(folder)
    if found is not None:
        return found
    takes, facts = make()
    _store(folder, takes, facts)
    return tuple(takes), facts


def _read(folder: Path) -> tuple[tuple[Take, ...], dict[str, Any]] | None:
    try:
        facts: dict[str, Any] = json.loads((folder / FACTS_FILE).read_text())
        return Pack.open(folder).takes(), facts
    except (OSError, EOFError, ValueError, KeyError, TypeError, BenchError):
        return None


def _store(folder: Path, takes: Sequence[Take], facts: dict[str, Any]) -> None:
    draft = folder.parent / f".{folder.name}-{uuid.uuid4().hex}"
    try:
        draft.mkdir(parents=True)
        write_pack(draft, takes)
        (draft / FACTS_FILE).write_text(json.dumps(facts))
        _flush(draft)
        _publish(draft, folder)
    except OSError:
        pass
    finally:
        shutil.rmtree(draft, ignore_errors=True)


def _flush(folder: Path) -> None:
    """Put the files on the disk before their folder gets its name: a power cut must not leave zeros under it."""
    for file in folder.iterdir():
        with file.open("rb") as handle:
            os.fsync(handle.fileno())


def _publish(draft: Path, folder: Path) -> None:
    try:
        draft.rename(folder)
    except OSError:
        # Something is there: what another process has stored meanwhile stays, a damaged entry is replaced.
        if _read(folder) is None:
            shutil.rmtree(folder, ignore_errors=True)
            draft.rename(folder)
