"""One table per track, protocol and dataset: columns, ranked rows, anchors set apart, footnotes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from reports.aggregate import Estimate, estimate, sorted_rows, tie_groups
from reports.columns import ColumnChoice, Part, columns_of
from reports.formatting import ARROWS, one_line
from reports.records import Better, JudgeFacts, Measurement
from reports.rows import GroupKey, Row, StoredRecord, groups, load_run, rows_of

Section = Literal["methods", "anchors", "unfinished"]
SECTION_TITLES: dict[Section, str] = {
    "methods": "Methods",
    "anchors": "Anchor rows and rows that copy (no rank)",
    "unfinished": "Not finished",
}


@dataclass(frozen=True)
class Column:
    """A column of one table."""

    metric: str
    slice: str
    title: str
    unit: str
    better: Better
    part: Part
    interval: bool

    @property
    def key(self) -> str:
        """``metric|slice``, unique in a table."""
        return f"{self.metric}|{self.slice}"

    @property
    def header(self) -> str:
        """Title, unit (if it has one) and good direction: ``joint recognition, % ↑``."""
        unit = "" if self.unit in ("1", "distance", "") else f", {self.unit}"
        return f"{self.title}{unit} {ARROWS[self.better]}".strip()


@dataclass(frozen=True)
class TableRow:
    """A row with everything a renderer needs."""

    section: Section
    rank: int | None
    row: Row
    marks: tuple[str, ...]
    estimates: Mapping[str, Estimate]
    """by column key; missing where the record has no such measurement"""

    @property
    def title(self) -> str:
        return one_line(self.row.method.row_title)


@dataclass(frozen=True)
class Table:
    """One table: rows of methods first, then anchors, then what did not finish; best first within each."""

    key: GroupKey
    protocol_id: str
    columns: tuple[Column, ...]
    rows: tuple[TableRow, ...]
    judges: tuple[JudgeFacts, ...]
    facts: Mapping[str, str]
    n: int | None
    """samples behind the primary column; None without a finished row"""

    @property
    def primary(self) -> Column | None:
        """The column that ranks; None without a finished row."""
        return self.columns[0] if self.columns else None

    @property
    def title(self) -> str:
        """Track, protocol, dataset, profile and what is not the default."""
        parts = [self.key.track, self.protocol_id, self.key.dataset, self.key.profile]
        if self.key.condition != "standard":
            parts.append(self.key.condition)
        if (self.key.split, self.key.split_seed) != ("default", 0):
            parts.append(f"split {self.key.split}, seed {self.key.split_seed}")
        return " · ".join(parts)

    def of(self, section: Section) -> tuple[TableRow, ...]:
        """The rows of one section, in order."""
        return tuple(row for row in self.rows if row.section == section)

    def columns_of(self, part: Part) -> tuple[Column, ...]:
        """The columns of one part, in order."""
        return tuple(column for column in self.columns if column.part == part)


def build_tables(stored: Sequence[StoredRecord]) -> tuple[Table, ...]:
    """All tables of a run, in a fixed order. Raises BadRecord where records must not stand in one table."""
    return tuple(build_table(key, items) for key, items in groups(stored).items())


def tables_of_run(folder: Path) -> tuple[Table, ...]:
    """:func:`build_tables` of a run folder or a folder of records."""
    return build_tables(load_run(folder))


def build_table(key: GroupKey, stored: Sequence[StoredRecord]) -> Table:
    """The table of one group of records (see :func:`reports.rows.groups`)."""
    rows = rows_of(stored)
    columns = _columns(key, rows)
    ranks: dict[str, int] = {}
    if columns:
        rows = tuple(sorted_rows(rows, columns[0].metric, columns[0].slice))
        ranks = tie_groups(rows, columns[0].metric, columns[0].slice)
    table_rows = [_table_row(row, columns, ranks.get(row.method.row_name)) for row in rows]
    order: dict[Section, int] = {"methods": 0, "anchors": 1, "unfinished": 2}
    table_rows.sort(key=lambda row: order[row.section])
    found = [row.estimates[columns[0].key].n for row in table_rows if columns and columns[0].key in row.estimates]
    return Table(
        key=key,
        protocol_id=stored[0].record.protocol_id,
        columns=columns,
        rows=tuple(table_rows),
        judges=_judges(stored),
        facts=_shared_facts(stored),
        n=max(found) if found else None,
    )


def _columns(key: GroupKey, rows: Sequence[Row]) -> tuple[Column, ...]:
    found: dict[tuple[str, str], list[Measurement]] = {}
    for row in rows:
        for record in row.ok:
            for measurement in record.measurements:
                found.setdefault((measurement.name, measurement.slice), []).append(measurement)
    columns = []
    for choice in columns_of(key.track, key.protocol, key.condition) or _every_measurement(list(found)):
        slice_name = next((name for name in choice.slices if (choice.metric, name) in found), None)
        if slice_name is None:
            continue
        measurements = found[choice.metric, slice_name]
        facts = (choice.title, measurements[0].unit, measurements[0].better, choice.part, choice.interval)
        columns.append(Column(choice.metric, slice_name, *facts))
    return tuple(columns)


def _every_measurement(names: Sequence[tuple[str, str]]) -> tuple[ColumnChoice, ...]:
    """For tracks without a chosen list: the first eight measurements in the main part, the first with its interval."""
    return tuple(
        ColumnChoice(
            metric,
            metric.replace("_", " ") + ("" if slice_name == "all" else f" ({slice_name.replace('_', ' ')})"),
            "main" if place < 8 else "details",
            (slice_name,),
            interval=place == 0,
        )
        for place, (metric, slice_name) in enumerate(name for name in names if not name[1].startswith("content="))
    )


def _table_row(row: Row, columns: Sequence[Column], rank: int | None) -> TableRow:
    section: Section = "methods" if row.can_rank else "anchors" if row.status == "ok" else "unfinished"
    found = {column.key: estimate(row, column.metric, column.slice) for column in columns}
    estimates = {key: value for key, value in found.items() if value is not None}
    return TableRow(section, rank, row, _marks(row), estimates)


def _marks(row: Row) -> tuple[str, ...]:
    facts = row.method
    marks = {
        "copies": row.copies,
        "local judges": row.local_judges,
        "uses judge": facts.uses_judge,
        "needs style label": facts.needs_style_label,
        "needs content label": facts.needs_content_label,
    }
    chosen = [name for name, holds in marks.items() if holds]
    if len(row.seeds) > 1:
        chosen.append(f"{len(row.seeds)} seeds")
    if row.status != "ok":
        chosen.insert(0, row.status)
    elif row.reason:
        chosen.append("cells left out")
    return tuple(chosen)


def _judges(stored: Sequence[StoredRecord]) -> tuple[JudgeFacts, ...]:
    by_id = {judge.id: judge for record, _ in stored for judge in record.judges}
    return tuple(by_id[name] for name in sorted(by_id))


def _shared_facts(stored: Sequence[StoredRecord]) -> dict[str, str]:
    """Protocol facts on which all records that have them agree."""
    found: dict[str, set[str]] = {}
    for record, _ in stored:
        for name, text in record.protocol_facts.items():
            found.setdefault(name, set()).add(text)
    return {name: texts.pop() for name, texts in sorted(found.items()) if len(texts) == 1}
