"""A study with people: pairs of clips in a fixed camera, in an order that tells nothing, and what came of it.

The page knows clips by random ids; which row a clip is of stands in ``key.json``, which participants do not get.
"""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import binomtest

from reports.page import ASSETS, PlayerTable, body_data, script_json
from reports.records import BadRecord, write_text_atomically
from reports.render import environment

KEY_FILE, PAGE_FILE = "key.json", "study.html"
COLUMNS = ("participant", "trial", "question", "answer")
QUESTIONS = {
    "style": "Which one moves more in the style of the reference?",
    "content": "Which one does more of what the source does?",
    "natural": "Which one looks more like a person moving?",
}
LEVEL = 0.95


@dataclass(frozen=True)
class Preference:
    """How often one row was preferred to another on one question."""

    question: str
    row: str
    other: str
    preferred: int
    answers: int
    low: float
    high: float
    p: float

    @property
    def share(self) -> float:
        return self.preferred / self.answers


def write_study(folder: Path, player: PlayerTable, rows: Sequence[str], n_trials: int, seed: int) -> Path:
    """Write the page and its key; returns the page.

    Trials go through all pairs of rows in turn, sides and order drawn with ``seed``.

    Raises
    ------
    BadRecord : fewer than two rows, a row that is not there, or no trial.
    """
    missing = [row for row in rows if row not in player.bodies]
    if missing:
        raise BadRecord(f"no row {missing[0]!r}; there are {', '.join(player.bodies)}")
    if len(set(rows)) < 2 or n_trials < 1:
        raise BadRecord(f"a study needs two rows and one trial, got {len(set(rows))} rows and {n_trials} trials")
    rng = np.random.default_rng(seed)
    pairs = list(combinations(dict.fromkeys(rows), 2))
    key: list[dict[str, Any]] = []
    for trial in range(n_trials):
        pair = list(pairs[trial % len(pairs)])
        rng.shuffle(pair)
        key.append({"sample": int(rng.integers(len(player.samples))), "a": pair[0], "b": pair[1]})
    order = rng.permutation(n_trials)
    trials = [{**key[place], "id": f"t{number:03d}"} for number, place in enumerate(order)]
    shown = [
        {
            "id": trial["id"],
            "bodies": {
                "source": body_data(player.bodies["content"], trial["sample"], "source"),
                "reference": body_data(player.bodies["style"], trial["sample"], "style reference"),
                "a": body_data(player.bodies[trial["a"]], trial["sample"], "A"),
                "b": body_data(player.bodies[trial["b"]], trial["sample"], "B"),
            },
        }
        for trial in trials
    ]
    data = {
        "fps": player.fps, "parents": list(player.parents), "sides": list(player.sides), "head": player.head,
        "trials": shown, "questions": QUESTIONS,
    }  # fmt: skip
    page = environment().get_template("study.html").render(title="Which motion?", n_trials=n_trials)
    write_text_atomically(folder / PAGE_FILE, page)
    write_text_atomically(folder / "study.js", (ASSETS / "study.js").read_text(encoding="utf-8"))
    write_text_atomically(folder / "page.css", (ASSETS / "page.css").read_text(encoding="utf-8"))
    write_text_atomically(folder / "trials.js", f"window.study = {script_json(data)};\n")
    samples = [name for name, _ in player.samples]
    kept = {t["id"]: {"sample": samples[t["sample"]], "a": t["a"], "b": t["b"]} for t in trials}
    write_text_atomically(
        folder / KEY_FILE, json.dumps({"seed": seed, "trials": kept}, indent=1, sort_keys=True) + "\n"
    )
    return folder / PAGE_FILE


def score_study(folder: Path, answers: Sequence[Path]) -> list[Preference]:
    """Preferences by question and pair of rows, with exact binomial intervals and two-sided p against a coin.

    Raises
    ------
    BadRecord : no key, a file that is not of this study, an answer twice, or no answers.
    """
    key = _read_key(folder / KEY_FILE)
    wins: dict[tuple[str, str, str], list[bool]] = {}
    seen: set[tuple[str, str, str]] = set()
    for path in answers:
        for place, line in _lines(path):
            participant, trial, question, answer = (line[column] for column in COLUMNS)
            if trial not in key or question not in QUESTIONS or answer not in ("a", "b"):
                raise BadRecord(f"{path}:{place}: not an answer of this study: {trial}, {question}, {answer}")
            if (participant, trial, question) in seen:
                raise BadRecord(f"{path}:{place}: {participant} answers {question} of {trial} twice")
            seen.add((participant, trial, question))
            better, worse = (key[trial][side] for side in (answer, "b" if answer == "a" else "a"))
            first, second = sorted((better, worse))
            wins.setdefault((question, first, second), []).append(better == first)
    if not wins:
        raise BadRecord("no answers to score")
    found = []
    for (question, first, second), won in sorted(wins.items()):
        test = binomtest(sum(won), len(won))
        bounds = test.proportion_ci(LEVEL)
        found.append(
            Preference(question, first, second, sum(won), len(won), float(bounds.low), float(bounds.high), test.pvalue)
        )
    return found


def _read_key(path: Path) -> dict[str, dict[str, str]]:
    try:
        trials: dict[str, dict[str, str]] = json.loads(path.read_text(encoding="utf-8"))["trials"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BadRecord(f"{path}: no key of a study: {error}") from error
    return trials


def _lines(path: Path) -> list[tuple[int, dict[str, str]]]:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise BadRecord(f"{path}: answers cannot be read: {error}") from error
    reader = csv.DictReader(io.StringIO(text))
    if tuple(reader.fieldnames or ()) != COLUMNS:
        raise BadRecord(
            f"{path}:1: expected the columns {', '.join(COLUMNS)}, got {', '.join(reader.fieldnames or ())}"
        )
    return [(reader.line_num, {k: v or "" for k, v in line.items() if k}) for line in reader]
