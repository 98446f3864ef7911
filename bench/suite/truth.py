"""True answers of a task list, for the dataset that knows them."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from bench.adapters.gesture_oracles import true_sequence
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.motion.clip import Clip
from bench.protocols.base import Task
from bench.suite.answering import source_of
from bench.suite.motions import Motions
from bench.suite.setting import Setting
from reports.records import digest_of

TRUTH_VERSION = 1
KNOWN_FOR = "procedural"
"""The dataset whose true answers are known."""


def truth_key(setting: Setting) -> str:
    """Key of the stored true answers; empty where the dataset does not know them."""
    if setting.dataset.name != KNOWN_FOR:
        return ""
    facts = {"version": TRUTH_VERSION, "dataset": setting.dataset.digest, "tasks": setting.tasks_digest}
    return digest_of(facts)


def true_answers(setting: Setting, folder: Path) -> dict[str, Any]:
    """Render the true answer of every task into an empty folder."""
    pack = Pack.open(setting.pack_folder)
    answers = [
        Take(_true_answer(task, pack, setting.protocol.fps), content=task.content, style=task.target_style)
        for task in setting.tasks
    ]
    Motions.of(answers).save(folder)
    return {"n": len(answers)}


def _true_answer(task: Task, pack: Pack, fps: float) -> Clip:
    from bench.datasets.procedural import true_answer

    if task.n_frames:
        return true_answer(task.content_take_id, task.start_frame, task.n_frames, task.target_style)
    return true_sequence(source_of(task, pack, fps), task.target_style, pack.by_id, true_answer)
