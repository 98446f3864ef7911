"""Failures of earlier runs, kept in the store beside what answers keys: for ``--keep-failures`` only."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from bench.suite.store import Store
from bench.suite.workers import Outcome
from reports.records import write_text_atomically


class Failures:
    """The last outcome of each cell that failed, by the key of its record; a success forgets it."""

    def __init__(self, store: Store, out: Path) -> None:
        self.folder = store.root / "failures"
        self.out = out

    def recall(self, record_key: str) -> Outcome | None:
        """How the cell failed last time; its log is named where this run folder has it."""
        try:
            outcome = Outcome(**json.loads(self._file(record_key).read_text()))
        except FileNotFoundError:
            return None
        has_log = outcome.log and (self.out / outcome.log).is_file()
        return Outcome(outcome.status, outcome.reason, outcome.log if has_log else "")

    def note(self, record_key: str, outcome: Outcome) -> None:
        """Remember a failure, or that there is none any more."""
        if outcome.status in ("ok", "unsupported"):
            self._file(record_key).unlink(missing_ok=True)
        else:
            write_text_atomically(self._file(record_key), json.dumps(asdict(outcome)))

    def _file(self, record_key: str) -> Path:
        return self.folder / f"{record_key}.json"
