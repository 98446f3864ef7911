"""Submissions without code: which setting a folder of answers belongs to, and its row."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

from bench.adapters.base import Traits
from bench.adapters.loading import AdapterSource
from bench.adapters.motion_files import read_bounded
from bench.datasets.reading import Overrides
from bench.datasets.table import load_dataset
from bench.errors import BadConfig, BadFile
from bench.suite.keys import generate_key
from bench.suite.motions import put_given
from bench.suite.plan import Cell
from bench.suite.request import RunRequest, check_profile, check_request, protocol_called
from bench.suite.run import fresh_records_folder
from bench.suite.session import Progress, session_of
from bench.suite.setting import Setting, prepare
from bench.suite.setting_run import SettingRun
from bench.suite.store import Store
from bench.suite.submission import MANIFEST, Submission, read_submission
from reports.records import MethodFacts, Record

MANIFEST_LIMIT_BYTES = 2**23
LABELS = ("style", "content", "source-style")


@dataclass(frozen=True)
class Data:
    """A dataset as asked for on the command line, with what is given of its files."""

    name: str
    path: Path | None = None
    overrides: Overrides | None = None


def setting_of(data: Data, label: str, profile: str, store: Path, progress: Progress) -> Setting:
    """One protocol on one dataset.

    Raises
    ------
    BadConfig : no such protocol or profile.
    """
    protocol = protocol_called(label)
    check_profile(protocol, profile)
    dataset = load_dataset(
        data.name, data.path, lambda what, done, total: progress("data", what, done, total), data.overrides
    )
    return prepare(dataset, protocol, profile, Store(store))


def exported_setting(folder: Path, data: Data, store: Path, progress: Progress) -> Setting:
    """The setting that a folder's tasks were exported from, as its manifest says; nothing else of it is believed.

    Raises
    ------
    BadFile : no manifest of exported tasks.
    BadConfig : it names a protocol or profile that there is not.
    """
    where = str(folder / MANIFEST)
    try:
        manifest = json.loads(read_bounded(folder, MANIFEST, MANIFEST_LIMIT_BYTES))
        label, profile = manifest["protocol"], manifest["profile"]
    except (ValueError, RecursionError, KeyError, TypeError):
        raise BadFile("is no manifest of exported tasks", where=where, remedy="export the tasks again") from None
    return setting_of(data, str(label), str(profile), store, progress)


def traits_of_labels(labels: tuple[str, ...]) -> Traits:
    """Which labels a method without code needs.

    Raises
    ------
    BadConfig : another word than ``style``, ``content`` and ``source-style``.
    """
    unknown = sorted(set(labels) - set(LABELS))
    if unknown:
        raise BadConfig(
            f"unknown label {', '.join(unknown)}", where="--labels", remedy=f"choose from {', '.join(LABELS)}"
        )
    return Traits(
        needs_style_label="style" in labels,
        needs_content_label="content" in labels,
        needs_source_style_label="source-style" in labels,
    )


def score_submission(folder: Path, setting: Setting, request: RunRequest, progress: Progress) -> Record:
    """Score the answers in a folder like any row, and write its record; nothing of it is executed.

    Raises
    ------
    BenchError : the folder does not hold an answer to every task that may be scored.
    """
    check_request(request)
    store = Store(request.store)
    found = read_submission(folder, setting, progress=lambda what, done, total: progress("data", what, done, total))
    cell = _cell(found, setting)
    put_given(store, cell.motions_key, found.motions)
    with session_of(request, progress) as session:
        [record] = SettingRun(session, setting).run([cell], fresh_records_folder(request.out)).records
    return record


def _cell(found: Submission, setting: Setting) -> Cell:
    digest = found.motions.digest
    traits = found.traits
    return Cell(
        source=AdapterSource(found.name),
        facts=MethodFacts(
            name=found.name,
            title=found.title or found.name,
            kind="method",
            description=found.description,
            digest=digest,
            needs_content_label=traits.needs_content_label,
            needs_style_label=traits.needs_style_label,
            uses_judge=traits.uses_judge,
            trained_on=traits.trained_on or "not said",
        ),
        seed=0,
        budget="",
        fit_key="",
        motions_key=generate_key(digest, setting.tasks_digest, 0),
        given=True,
    )
