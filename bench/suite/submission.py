"""No code at all: tasks written as motion files, answers read back as data.

Reading a submission executes nothing of it: TOML, JSON, .bvh and .npz without pickles, sizes bounded by what the task
list allows, links refused, paths kept inside the folder. What is scored, and under which labels, comes from the task
list of the setting, never from the submission.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from bench.adapters import ADAPTERS
from bench.adapters.answers import CheckRow, check_answer, checked_answer
from bench.adapters.base import ProgressCallback, Traits
from bench.adapters.motion_files import npz_bytes, read_bounded, read_motion
from bench.adapters.program import MAX_TOML_BYTES, Name, Sentence, Table, Title, bad_key, parse_toml, traits_of
from bench.datasets.pack import Pack
from bench.datasets.take import Take
from bench.errors import BadConfig, BadFile, BadOutput, BenchError
from bench.motion.bvh import write_bvh
from bench.motion.clip import Clip
from bench.protocols.base import Task
from bench.suite.answering import source_of
from bench.suite.motions import Motions
from bench.suite.setting import Setting

FORMAT = 1
TRACKS = ("transfer", "latent", "gesture", "parts", "interpolation")
"""Tracks whose answers are motions of the content's length. The others measure a running method."""
MANIFEST, SUBMISSION, ANSWERS = "manifest.json", "submission.toml", "answers"
MANIFEST_BYTES, ROW_BYTES = 65536, 1024
OTHER_SUFFIX = {".bvh": ".npz", ".npz": ".bvh"}

SUBMISSION_TEXT = """\
# Who you are in the table. Letters in the name: a-z, 0-9 and . _ + -
name = "my-method"
title = "my method"
description = ""

[traits]
# What was used; it stands in the table and is never punished.
{traits}
trained_on = ""
uses_judge = false
"""

README_TEXT = """\
{n} tasks of {label} on {dataset}.

For each entry of "tasks" in manifest.json: read the motion "content" and the style reference "style", and write the
content's motion in that style to "answer" (.bvh or .npz), with as many frames, the same frame rate and the same bones.
{extra}
.bvh: centimetres; keep the HIERARCHY of the content's file. .npz: rotations_wxyz [T, 21, 4] local unit quaternions,
w first, and root_xyz_m [T, 3] metres, Y up; plain floats, no pickles.

Then fill in submission.toml and run:  stylebench score FOLDER
"""


@dataclass(frozen=True, eq=False)
class Submission:
    """Outputs of a method that ran elsewhere.

    Attributes
    ----------
    name, title, description, traits : what its authors say, not verified.
    motions : the answers to all tasks of the setting, in its order, under its labels.
    """

    name: str
    title: str
    description: str
    traits: Traits
    motions: Motions


class _Entry(Table):
    name: Name
    title: Title = ""
    description: Sentence = ""


def export_tasks(
    setting: Setting,
    folder: Path,
    *,
    traits: Traits | None = None,
    motions: str = "bvh",
    with_fit: bool = False,
    progress: ProgressCallback | None = None,
) -> Path:
    """Write the tasks of a setting into a new or empty folder; the path of its manifest.

    Parameters
    ----------
    traits : which labels the method needs; others are not written.
    motions : ``bvh`` or ``npz``.
    with_fit : also write the fit part with its labels, to train on.

    Raises
    ------
    BadConfig : the folder is not empty, or the track measures a running method.
    """
    _require_track(setting)
    if motions not in ("bvh", "npz"):
        raise BadConfig(f"expected bvh or npz, got {motions!r}", where="motions")
    if folder.is_dir() and any(folder.iterdir()):
        raise BadConfig(f"{folder} is not empty", remedy="give a new folder")
    try:
        for name in ("content", "style", ANSWERS, *(("fit",) if with_fit else ())):
            (folder / name).mkdir(parents=True)
        writer = _Writer(setting, folder, traits or Traits(), motions)
        total = len(setting.tasks)
        rows = []
        for done, task in enumerate(setting.tasks, start=1):
            rows.append(writer.task(task))
            if progress:
                progress("writing tasks", done, total)
        manifest = {
            "format": FORMAT,
            "protocol": setting.protocol.label,
            "dataset": setting.dataset.dataset_id,
            "profile": setting.profile,
            "tasks_digest": setting.tasks_digest,
            "tasks": rows,
            "fit": writer.fit() if with_fit else [],
        }
        (folder / SUBMISSION).write_text(SUBMISSION_TEXT.format(traits=_trait_lines(writer.traits)), encoding="utf-8")
        extra = 'Train on nothing but the files that "fit" lists, each with its labels.\n' if with_fit else ""
        text = README_TEXT.format(
            n=total, label=setting.protocol.label, dataset=setting.dataset.dataset_id, extra=extra
        )
        (folder / "README.txt").write_text(text, encoding="utf-8")
        path = folder / MANIFEST
        path.write_text(json.dumps(manifest, indent=1), encoding="utf-8")
    except OSError as error:
        raise BadConfig(f"cannot be written ({error.strerror})", where=str(folder)) from error
    return path


def read_submission(folder: Path, setting: Setting, *, progress: ProgressCallback | None = None) -> Submission:
    """The answers in a folder, as data that may be scored.

    Raises
    ------
    BadConfig : ``submission.toml`` is not right, or the track measures a running method.
    BadFile : the manifest or an answer cannot be read, or the answers belong to other tasks.
    BadOutput : an answer is missing or cannot be scored.
    """
    entry, traits = _entry(folder)
    answers = []
    for done, (task, source, name) in enumerate(_answer_files(folder, setting), start=1):
        clip = read_motion(folder, name, source, max_frames=source.n_frames)
        answers.append(Take(checked_answer(clip, source, name), content=task.content, style=task.target_style))
        if progress:
            progress("reading answers", done, len(setting.tasks))
    return Submission(entry.name, entry.title, entry.description, traits, Motions.of(answers))


def check_submission(folder: Path, setting: Setting) -> Iterator[CheckRow]:
    """Rows of a conformance table for a folder of answers; every answer is looked at."""
    expected = "submission.toml with a name"
    try:
        entry, _ = _entry(folder)
    except BenchError as error:
        yield CheckRow("who", False, expected, error.problem, error.cause, error.remedy)
    else:
        yield CheckRow("who", True, expected, entry.name)
    expected = f"an answer to each of {len(setting.tasks)} tasks"
    try:
        files = list(_answer_files(folder, setting))
    except BenchError as error:
        yield CheckRow("complete", False, expected, error.problem, error.cause, error.remedy)
        return
    yield CheckRow("complete", True, expected, f"{len(files)} answers")
    found: dict[str, CheckRow] = {}
    for _, source, name in files:
        try:
            rows = check_answer(read_motion(folder, name, source, max_frames=source.n_frames), source)
        except BenchError as error:
            got = f"{name}: {error.problem}"
            rows = [CheckRow("readable", False, "a motion of the content's joints", got, error.cause, error.remedy)]
        for row in rows:
            if row.name not in found or (found[row.name].ok and not row.ok):
                told = row if row.ok else CheckRow(row.name, False, row.expected, f"{name}: {row.got}", row.cause)
                found[row.name] = told
    yield from found.values()


class _Writer:
    """Writes motions under names that tell nothing, each style once."""

    def __init__(self, setting: Setting, folder: Path, traits: Traits, motions: str) -> None:
        self.setting = setting
        self.folder = folder
        self.traits = traits
        self.motions = motions
        self.pack = Pack.open(setting.pack_folder)
        self.styles: dict[str, str] = {}

    def task(self, task: Task) -> dict[str, Any]:
        """One row of the manifest."""
        source = source_of(task, self.pack, self.setting.protocol.fps)
        content = self._write(f"content/{task.sample_id}", source.clip)
        row: dict[str, Any] = {
            "sample_id": task.sample_id,
            "content": content,
            "style": self._style(task.style_take_id),
            "answer": f"{ANSWERS}/{task.sample_id}.{self.motions}",
            "frames": source.clip.n_frames,
            "fps": source.clip.fps,
            "seed": task.seed,
        }
        if self.traits.needs_content_label:
            row["content_label"] = source.content
        if self.traits.needs_source_style_label:
            row["source_style_label"] = source.style
        if self.traits.needs_style_label or self.setting.protocol.track == "latent":
            row["style_label"] = task.target_style
        if task.part:
            row["part"] = task.part
        if self.setting.protocol.track == "interpolation":
            row["weight"] = task.weight
            row["start_style"] = self._style(task.start_take_id) if task.start_take_id else content
        return row

    def fit(self) -> list[dict[str, Any]]:
        """Rows of the fit part."""
        takes = [self.pack.take(take_id) for take_id in self.setting.fit_take_ids]
        return [
            {"file": self._write(f"fit/t{n:04d}", take.clip), "content": take.content, "style": take.style}
            for n, take in enumerate(takes)
        ]

    def _style(self, take_id: str) -> str:
        if take_id not in self.styles:
            self.styles[take_id] = self._write(f"style/r{len(self.styles):04d}", self.pack.take(take_id).clip)
        return self.styles[take_id]

    def _write(self, stem: str, clip: Clip) -> str:
        name = f"{stem}.{self.motions}"
        if self.motions == "bvh":
            write_bvh(self.folder / name, clip)
        else:
            arrays = {"rotations_wxyz": clip.rotations_wxyz, "root_xyz_m": clip.root_xyz_m}
            arrays |= {"offsets_m": clip.skeleton.offsets_m, "fps": np.array(clip.fps)}
            (self.folder / name).write_bytes(npz_bytes(arrays))
        return name


def _trait_lines(traits: Traits) -> str:
    asked = ("needs_content_label", "needs_source_style_label", "needs_style_label")
    return "\n".join(f"{name} = {str(getattr(traits, name)).lower()}" for name in asked)


def _require_track(setting: Setting) -> None:
    if setting.protocol.track not in TRACKS:
        raise BadConfig(
            f"the {setting.protocol.track} track measures a running method, not its outputs",
            remedy="choose a protocol of another track, or write an adapter",
        )


def _entry(folder: Path) -> tuple[_Entry, Traits]:
    where = str(folder / SUBMISSION)
    table = dict(parse_toml(read_bounded(folder, SUBMISSION, MAX_TOML_BYTES), where))
    traits = traits_of(table.pop("traits", {}), where)
    try:
        entry = _Entry.model_validate(table)
    except ValidationError as error:
        raise bad_key(error, Path(where), [*_Entry.model_fields, "traits"]) from None
    if entry.name in ADAPTERS:
        raise BadConfig(f"there is a row {entry.name!r} already", where=where, remedy="choose another name")
    return entry, traits


def _answer_files(folder: Path, setting: Setting) -> list[tuple[Task, Clip, str]]:
    """Each task with its source and the name of its answer's file; every one exists."""
    _require_track(setting)
    names = _answer_names(folder, setting)
    pack = Pack.open(setting.pack_folder)
    found, missing = [], []
    for task in setting.tasks:
        name = names[task.sample_id]
        stem, suffix = name[:-4], name[-4:]
        there = [one for one in (name, stem + OTHER_SUFFIX.get(suffix, suffix)) if (folder / one).is_file()]
        if there:
            found.append((task, source_of(task, pack, setting.protocol.fps).clip, there[0]))
        else:
            missing.append(name)
    if missing:
        raise BadOutput(
            f"{len(missing)} of {len(setting.tasks)} answers are missing, {missing[0]} first",
            where=str(folder),
            remedy="answer every task; a part of them cannot be compared",
        )
    return found


def _answer_names(folder: Path, setting: Setting) -> dict[str, str]:
    """Sample id -> path of the answer inside the folder, as the manifest says."""
    where = str(folder / MANIFEST)
    limit = MANIFEST_BYTES + ROW_BYTES * (len(setting.tasks) + len(setting.fit_take_ids))
    try:
        manifest = json.loads(read_bounded(folder, MANIFEST, limit))
    except (ValueError, RecursionError):
        raise BadFile("is not JSON", where=where, remedy="export the tasks again") from None
    if (
        not isinstance(manifest, dict)
        or manifest.get("format") != FORMAT
        or not isinstance(manifest.get("tasks"), list)
    ):
        raise BadFile("is no manifest of exported tasks", where=where, remedy="export the tasks again")
    if manifest.get("tasks_digest") != setting.tasks_digest:
        raise BadFile(
            f"the tasks are not those of {setting.protocol.label} on {setting.dataset.dataset_id}, {setting.profile}",
            where=where,
            cause="exported from other data, another split, profile or version",
            remedy="score with the options of the export, or export again",
        )
    names = {
        row["sample_id"]: row["answer"]
        for row in manifest["tasks"]
        if isinstance(row, dict) and isinstance(row.get("sample_id"), str) and isinstance(row.get("answer"), str)
    }
    for task in setting.tasks:
        name = names.get(task.sample_id)
        if name is None:
            raise BadFile(f"says no answer for {task.sample_id}", where=where, remedy="export the tasks again")
        parts = name.split("/")
        if len(name) > 200 or "\0" in name or any(part in ("", ".", "..") for part in parts):
            raise BadFile(f"the answer of {task.sample_id} lies outside the folder: {name[:80]!r}", where=where)
    return names
