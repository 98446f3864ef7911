"""Motion packs: the motions behind one record in one zip, so that others can score them again without the method.

A pack holds ``pack.json`` (what the motions are and under which licence), ``tasks.json`` (what was asked) and one
``.npy`` an array of :class:`bench.suite.motions.Motions`. The same motions give the same bytes.
"""

from __future__ import annotations

import io
import json
import urllib.error
import urllib.request
import zipfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bench.errors import BadConfig, BadFile
from bench.suite.motions import Motions
from bench.suite.store import Store
from bench.suite.trust import motions_folders
from reports.records import Record, digest_of_bytes, write_bytes_atomically, write_record
from reports.rows import StoredRecord, load_run

PACK_VERSION = 1
FACTS_FILE, TASKS_FILE = "pack.json", "tasks.json"
PACKS_FOLDER = "packs"
LIMIT_BYTES = 2**30
"""No pack is larger, packed or unpacked."""
TIMEOUT_S = 60.0
_WHEN = (1980, 1, 1, 0, 0, 0)


@dataclass(frozen=True, eq=False)
class MotionPack:
    """A pack as read: its facts, the tasks as dictionaries and the motions."""

    facts: dict[str, Any]
    tasks: list[dict[str, Any]]
    motions: Motions


@dataclass(frozen=True)
class Packed:
    """A pack that was written: of which record, where, how large; or why there is none."""

    record: str
    file: Path | None
    size_bytes: int
    reason: str = ""


def pack_name(record: Record) -> str:
    """File name of a record's pack."""
    condition = "" if record.condition == "standard" else f"-{record.condition}"
    return (
        f"{record.method.row_name}-{record.protocol_id}{condition}-{record.dataset}-{record.profile}-s{record.seed}.zip"
    )


def pack_run(
    run_folder: Path, store: Store, methods: Sequence[str] = (), progress: Callable[[int, int], None] | None = None
) -> list[Packed]:
    """Write one pack for every finished record of a run folder, and its digest into the record.

    Raises
    ------
    BadRecord : no records there.
    BadConfig : none of them is of the named methods.
    """
    stored = [item for item in load_run(run_folder) if not methods or item.record.method.name in methods]
    if not stored:
        raise BadConfig(f"no records of {', '.join(methods)}", where=str(run_folder), remedy="check --methods")
    folders = motions_folders(store)
    packed = []
    for place, item in enumerate(stored):
        if progress:
            progress(place, len(stored))
        packed.append(_pack(run_folder, item, store, folders))
    return packed


def _pack(run_folder: Path, item: StoredRecord, store: Store, folders: dict[str, Path]) -> Packed:
    record, path = item
    if record.status != "ok":
        return Packed(path.name, None, 0, f"{record.status}: {record.reason}")
    tasks_file = store.root / "tasks" / f"{record.protocol_facts.get('tasks digest', '')}.json"
    if record.motions_digest not in folders or not tasks_file.is_file():
        return Packed(path.name, None, 0, "the store has no motions of it (durations have none)")
    data = pack_bytes(record, json.loads(tasks_file.read_text()), Motions.load(folders[record.motions_digest]))
    file = run_folder / PACKS_FOLDER / pack_name(record)
    write_bytes_atomically(file, data)
    write_record(path, record.model_copy(update={"pack_digest": digest_of_bytes(data)}))
    return Packed(path.name, file, len(data))


def pack_bytes(record: Record, tasks: Sequence[dict[str, Any]], motions: Motions) -> bytes:
    """The zip file of a record's motions."""
    facts = {
        "pack_version": PACK_VERSION,
        "method": record.method.name,
        "title": record.method.title,
        "protocol": record.protocol_id,
        "condition": record.condition,
        "profile": record.profile,
        "dataset": record.dataset,
        "dataset_digest": record.dataset_digest,
        "seed": record.seed,
        "tasks_digest": record.protocol_facts.get("tasks digest", ""),
        "motions_digest": motions.digest,
        "licence": record.protocol_facts.get("licence", ""),
        "citation": record.protocol_facts.get("citation", ""),
        "rotations": "local quaternions w, x, y, z; metres; Y up",
    }
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED, compresslevel=9) as archive:
        _add(archive, FACTS_FILE, json.dumps(facts, indent=1, sort_keys=True).encode())
        _add(archive, TASKS_FILE, json.dumps(list(tasks), sort_keys=True).encode())
        for name, array in motions.arrays().items():
            one = io.BytesIO()
            np.lib.format.write_array(one, np.asarray(array), allow_pickle=False)
            _add(archive, f"{name}.npy", one.getvalue())
    return buffer.getvalue()


def _add(archive: zipfile.ZipFile, name: str, data: bytes) -> None:
    entry = zipfile.ZipInfo(name, _WHEN)
    entry.compress_type = zipfile.ZIP_DEFLATED
    entry.external_attr = 0o644 << 16
    archive.writestr(entry, data)


def fetch(address: str) -> bytes:
    """The bytes of a pack from a path or a ``https://``, ``http://`` or ``file://`` address.

    Raises
    ------
    BadFile : it cannot be read, or is larger than a pack may be.
    """
    try:
        if address.startswith(("https://", "http://", "file://")):
            with urllib.request.urlopen(address, timeout=TIMEOUT_S) as answer:
                data = bytes(answer.read(LIMIT_BYTES + 1))
        else:
            data = Path(address).read_bytes()
    except (OSError, urllib.error.URLError, ValueError) as error:
        raise BadFile(f"the pack cannot be read: {error}", where=address) from error
    if len(data) > LIMIT_BYTES:
        raise BadFile(f"a pack may have {LIMIT_BYTES} bytes at most", where=address)
    return data


def read_pack(data: bytes, where: str) -> MotionPack:
    """A pack from its bytes; nothing in it is executed.

    Raises
    ------
    BadFile : no pack, or a damaged one.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > LIMIT_BYTES:
                raise BadFile(f"unpacks to more than {LIMIT_BYTES} bytes", where=where)
            facts = json.loads(archive.read(FACTS_FILE))
            tasks = json.loads(archive.read(TASKS_FILE))
            arrays = {
                name.removesuffix(".npy"): np.load(io.BytesIO(archive.read(name)), allow_pickle=False)
                for name in archive.namelist()
                if name.endswith(".npy")
            }
        fps = float(arrays.pop("fps"))
        motions = Motions(**arrays, fps=fps)
    except (zipfile.BadZipFile, KeyError, ValueError, TypeError, EOFError, OSError) as error:
        raise BadFile(f"is no motion pack: {error}", where=where, remedy="make it with stylebench pack") from error
    if facts.get("pack_version") != PACK_VERSION:
        raise BadFile(f"pack version {facts.get('pack_version')}, this reads {PACK_VERSION}", where=where)
    return MotionPack(facts, tasks, motions)
