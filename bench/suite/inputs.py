"""What a run was asked, kept beside its records: so that motions can be shown later, from the store alone."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bench.suite.plan import Cell
from bench.suite.setting import Setting
from reports.records import write_text_atomically

FOLDER = "inputs"


def note_inputs(run_folder: Path, setting: Setting, truth_key: str, cells: Sequence[Cell]) -> Path:
    """Write down where in the store a table's takes, tasks, true answers and trainings are."""
    path = run_folder / FOLDER / f"{setting.tasks_digest}.json"
    facts = {
        "protocol": setting.protocol.label,
        "fps": setting.protocol.fps,
        "takes": setting.pack_folder.name,
        "truth": truth_key,
        "licence": setting.dataset.licence,
        "fits": {f"{cell.facts.title}, seed {cell.seed}": cell.fit_key for cell in cells if cell.fit_key},
    }
    write_text_atomically(path, json.dumps(facts, indent=1, sort_keys=True) + "\n")
    return path


def read_inputs(run_folder: Path, tasks_digest: str) -> dict[str, Any] | None:
    """What :func:`note_inputs` wrote; None where the run did not leave it."""
    path = run_folder / FOLDER / f"{tasks_digest}.json"
    if not path.is_file():
        return None
    found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
    return found
