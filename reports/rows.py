"""Records into rows: loading, grouping by table, and the refusal to mix what cannot be compared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, NamedTuple

from numpy.typing import NDArray

from reports.records import BadRecord, Measurement, MethodFacts, Record, read_record, read_samples

Samples = Mapping[str, NDArray[Any]]


class StoredRecord(NamedTuple):
    """A record and the file it came from."""

    record: Record
    path: Path


class GroupKey(NamedTuple):
    """What all rows of one table share."""

    track: str
    protocol: str
    dataset: str
    profile: str
    split: str
    split_seed: int
    condition: str


@dataclass(frozen=True)
class Row:
    """All records of one method and training budget in one table: its seeds and trials."""

    method: MethodFacts
    stored: tuple[StoredRecord, ...]

    @property
    def ok(self) -> tuple[Record, ...]:
        """The records that carry numbers."""
        return tuple(record for record, _ in self.stored if record.status == "ok")

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the records that carry numbers, each once."""
        return tuple(sorted({record.seed for record in self.ok}))

    @property
    def status(self) -> str:
        """``ok`` if any record is, else the status of the first."""
        return "ok" if self.ok else self.stored[0].record.status

    @property
    def reason(self) -> str:
        """Why records are missing, one line; empty if all are ok."""
        bad = [record for record, _ in self.stored if record.status != "ok"]
        if not bad:
            return ""
        if not self.ok:
            return bad[0].reason
        return f"{len(bad)} of {len(self.stored)} cells left out: {bad[0].status}: {bad[0].reason}"

    @property
    def copies(self) -> bool:
        """Whether any record found a copied share over 50 %."""
        return any(record.copies for record in self.ok)

    @property
    def local_judges(self) -> bool:
        """Whether any number comes from judges trained for this run only."""
        return any(judge.origin == "local" for record in self.ok for judge in record.judges)

    @property
    def can_rank(self) -> bool:
        """Only finished rows of kind method that do not copy are ranked."""
        return self.method.kind == "method" and self.status == "ok" and not self.copies

    @cached_property
    def samples(self) -> tuple[Samples, ...]:
        """Samples files of the ok records that have one. Raises BadRecord where one is missing or was changed."""
        return tuple(
            read_samples(path, record)
            for record, path in self.stored
            if record.status == "ok" and record.samples_digest
        )

    def measurements(self, metric: str, slice_name: str) -> list[Measurement]:
        """That measurement of every ok record that has it."""
        found = (record.find(metric, slice_name) for record in self.ok)
        return [measurement for measurement in found if measurement is not None]


def load_run(folder: Path) -> tuple[StoredRecord, ...]:
    """All records under ``folder/records`` if that exists, else under ``folder``, in a fixed order.

    Raises
    ------
    BadRecord : no such folder, or a JSON file in it is not a record.
    """
    stored = [StoredRecord(read_record(path), path) for path in record_paths(folder)]
    return tuple(sorted(stored, key=lambda item: (_order(item.record), item.path.name)))


def record_paths(folder: Path) -> list[Path]:
    """The files of :func:`load_run`, unread and sorted by path.

    Raises
    ------
    BadRecord : no such folder.
    """
    place = folder / "records" if (folder / "records").is_dir() else folder
    if not place.is_dir():
        raise BadRecord(f"{folder}: no such folder; expected a run folder or a folder of records")
    return sorted(path for path in place.rglob("*.json") if not path.name.startswith("."))


def _order(record: Record) -> tuple[str, ...]:
    return (
        *map(str, group_key(record)),
        record.method.row_name,
        f"{record.seed:09d}",
        f"{record.trial:09d}",
        record.key,
    )


def group_key(record: Record) -> GroupKey:
    """The table a record belongs to. The protocol's version is no part of it: versions must not stand side by side."""
    return GroupKey(
        record.track,
        record.protocol,
        record.dataset,
        record.profile,
        record.split,
        record.split_seed,
        record.condition,
    )


def groups(stored: Iterable[StoredRecord]) -> dict[GroupKey, tuple[StoredRecord, ...]]:
    """Records by table, keys sorted, each group checked by :func:`check_comparable`."""
    found: dict[GroupKey, list[StoredRecord]] = {}
    for item in stored:
        found.setdefault(group_key(item.record), []).append(item)
    for items in found.values():
        check_comparable(items)
    return {key: tuple(found[key]) for key in sorted(found)}


def check_comparable(stored: Sequence[StoredRecord]) -> None:
    """Refuse records that must not stand in one table.

    Raises
    ------
    BadRecord : protocol versions, dataset digests, digests of one judge, or versions of one metric differ, or one
        cell is there twice; the message names both files.
    """
    seen: dict[str, tuple[str, Path]] = {}
    for record, path in stored:
        for what, value in _identities(record):
            known, first = seen.setdefault(what, (value, path))
            if known != value:
                raise BadRecord(
                    f"{what} differs: {known} in {first.name}, {value} in {path.name} ({record.method.name}); "
                    "numbers from both cannot stand in one table: run one of them again or move it away"
                )
    cells: dict[tuple[str, int, int], Path] = {}
    for record, path in stored:
        first_path = cells.setdefault((record.method.row_name, record.seed, record.trial), path)
        if first_path != path:
            raise BadRecord(
                f"{record.method.row_name} seed {record.seed} trial {record.trial} is there twice: "
                f"{first_path.name} and {path.name}; move one of them away"
            )


def _identities(record: Record) -> Iterable[tuple[str, str]]:
    yield f"version of protocol {record.protocol}", record.protocol_id
    yield f"digest of dataset {record.dataset}", record.dataset_digest
    for judge in record.judges:
        yield f"digest of judge {judge.id}", f"{judge.digest} ({judge.origin})"
    for measurement in record.measurements:
        yield f"version of metric {measurement.name}", str(measurement.version)


def rows_of(stored: Sequence[StoredRecord]) -> tuple[Row, ...]:
    """One row per method and training budget, sorted by name, from the records of one group."""
    found: dict[str, list[StoredRecord]] = {}
    for item in stored:
        found.setdefault(item.record.method.row_name, []).append(item)
    return tuple(Row(found[name][0].record.method, tuple(found[name])) for name in sorted(found))
