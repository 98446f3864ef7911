"""The store: results of stages under content keys, one folder each, written whole or not at all."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import shutil
import time
import uuid
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from bench.errors import BadConfig

DONE_FILE = "done.json"
ABANDONED_S = 7 * 24 * 3600.0
"""A draft of another machine that nobody has touched for so long is nobody's."""


class Store:
    """A folder of finished stage results: ``<root>/<stage>/<key>/``.

    A result becomes visible by one rename, so a killed writer leaves at most a folder under ``tmp``, which the next
    :meth:`sweep` removes. Two writers of one key write equal content; the first to finish wins. Several machines may
    share a store: keys hold no paths, so that each may see it under a path of its own.
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        try:
            (root / "tmp").mkdir(parents=True, exist_ok=True)
            if not os.access(root / "tmp", os.W_OK):
                raise PermissionError(13, "Permission denied")
        except OSError as error:
            raise BadConfig(
                f"the store folder cannot be written: {error.strerror}",
                where=str(root),
                remedy="choose a writable folder with --store",
            ) from error

    def folder(self, stage: str, key: str) -> Path:
        """Where a result lies or would lie."""
        return self.root / stage / key

    def has(self, stage: str, key: str) -> bool:
        return (self.folder(stage, key) / DONE_FILE).is_file()

    def facts(self, stage: str, key: str) -> dict[str, Any]:
        """The JSON facts stored with a result."""
        facts: dict[str, Any] = json.loads((self.folder(stage, key) / DONE_FILE).read_text())
        return facts

    def put(self, stage: str, key: str, write: Callable[[Path], dict[str, Any]]) -> Path:
        """Store a result: ``write(folder)`` fills an empty folder and returns the facts about it."""
        draft = self.draft(stage)
        try:
            facts = write(draft)
            (draft / DONE_FILE).write_text(json.dumps(facts, sort_keys=True))
            self._flush(draft)
            return self._place(draft, stage, key)
        finally:
            shutil.rmtree(draft, ignore_errors=True)

    def _place(self, draft: Path, stage: str, key: str) -> Path:
        """Rename a draft to its place, unless the result is there by now; what is left of a broken one goes away."""
        final = self.folder(stage, key)
        final.parent.mkdir(parents=True, exist_ok=True)
        try:
            draft.rename(final)
        except OSError:
            if not self.has(stage, key):
                shutil.rmtree(final, ignore_errors=True)
                with contextlib.suppress(OSError):
                    draft.rename(final)
                if not self.has(stage, key):
                    raise
        return final

    def draft(self, stage: str) -> Path:
        """An empty folder under ``tmp`` that belongs to this process: others sweep it away once this one is gone."""
        folder = self.root / "tmp" / f"{stage}-{os.getpid()}@{_machine()}-{uuid.uuid4().hex}"
        folder.mkdir()
        return folder

    def sweep(self) -> None:
        """Remove drafts of processes that no longer live, and what other machines left long ago."""
        for draft in (self.root / "tmp").iterdir():
            owner = draft.name.split("-")[-2] if draft.name.count("-") >= 2 else ""
            process, _, machine = owner.partition("@")
            if machine not in ("", _machine()):
                gone = _age_s(draft) > ABANDONED_S
            else:
                gone = not (process.isdigit() and Path(f"/proc/{process}").exists())
            if gone:
                shutil.rmtree(draft, ignore_errors=True)

    def missing(self, wanted: Iterable[tuple[str, str]], wait_s: float = 0.0) -> list[tuple[str, str]]:
        """Which of some results, as (stage, key), are not there; a shared folder gets a while to show them."""
        deadline = time.monotonic() + wait_s
        absent = [result for result in wanted if not self.has(*result)]
        while absent and time.monotonic() < deadline:
            time.sleep(0.5)
            absent = [result for result in absent if not self.has(*result)]
        return absent

    @staticmethod
    def _flush(folder: Path) -> None:
        for path in folder.rglob("*"):
            if path.is_file():
                handle = os.open(path, os.O_RDONLY)
                try:
                    os.fsync(handle)
                finally:
                    os.close(handle)


def _machine() -> str:
    return platform.node().replace("-", "_")


def _age_s(path: Path) -> float:
    try:
        return time.time() - path.stat().st_mtime
    except FileNotFoundError:
        return 0.0
