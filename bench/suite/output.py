"""What a run folder shows: tables and figures made from its records."""

from __future__ import annotations

import shutil
from collections.abc import Iterator, Sequence
from pathlib import Path

from matplotlib.figure import Figure

import reports
from bench.errors import BadConfig
from reports.figures import interval_bars, recognition_scatter, save_figure
from reports.heatmap import part_heatmap
from reports.more_figures import latency_figure
from reports.records import samples_path, write_text_atomically
from reports.render import render
from reports.rows import GroupKey, group_key, load_run
from reports.tables import Column, Table, TableRow, tables_of_run


def write_report(folder: Path, forms: Sequence[str] = ("png",)) -> list[str]:
    """Write ``tables.md``, one CSV and the figures of each table into a run folder; returns the tables as plain text.

    ``forms`` of the figures: ``png``, ``pdf``, ``svg``.

    Raises
    ------
    BadRecord : no records there, or broken ones.
    """
    texts, pages = [], []
    for table in tables_of_run(folder):
        stem = stem_of(table.key)
        texts.append(render(table, "text"))
        pages.append(f"# {table.title}\n\n{render(table, 'md')}\n\n## Details\n\n{render(table, 'md', 'details')}")
        write_text_atomically(folder / f"{stem}.csv", render(table, "csv"))
        for name, figure in _figures(table):
            for form in forms:
                save_figure(figure, folder / f"{stem}-{name}.{form}")
    write_text_atomically(folder / "tables.md", "\n\n".join(pages) + "\n")
    return texts


def stem_of(key: GroupKey) -> str:
    """Start of the file names of a table: ``stylebench-transfer-bandai-namco@1-quick``, the condition included."""
    condition = [] if key.condition == "standard" else [key.condition]
    return "-".join([key.protocol, *condition, key.dataset, key.profile])


def _figures(table: Table) -> Iterator[tuple[str, Figure]]:
    """The figures that a table's columns allow, each with the end of its file name."""
    shown = {column.metric for column in table.columns}
    if table.primary is None:
        return
    if {"cra", "sra", "joint_recognition"} <= shown:
        yield "recognition", recognition_scatter(table)
    if "locality_msd" in shown:
        yield "joints", part_heatmap(table)
    if table.key.track == "runtime" and any(_has(row, table.primary) for row in table.rows):
        yield "latency", latency_figure(table)
    if any(_has(row, table.primary) for row in table.rows):
        yield "intervals", interval_bars(table)


def _has(row: TableRow, column: Column) -> bool:
    found = row.estimates.get(column.key)
    return found is not None and found.value is not None


PUBLISHED = Path(reports.__file__).with_name("published")


def stand_beside(folder: Path, against: str) -> int:
    """Copy records into a run folder that belong into its tables: the rows a new one is read against.

    ``against`` is ``leaderboard``, a run folder or a folder of records. A row that the run has itself is not copied.
    Returns how many were copied.

    Raises
    ------
    BadConfig : nothing there belongs beside the run's records.
    """
    own = load_run(folder)
    tables = {group_key(item.record) for item in own}
    methods = {(group_key(item.record), item.record.method.row_name) for item in own}
    copied = 0
    for record, path in load_run(PUBLISHED if against == "leaderboard" else Path(against)):
        if group_key(record) not in tables or (group_key(record), record.method.row_name) in methods:
            continue
        for source in (samples_path(path), path):
            if source.is_file():
                shutil.copyfile(source, folder / "records" / source.name)
        copied += 1
    if not copied:
        raise BadConfig(
            f"{against} has no row for {', '.join(sorted({t.protocol for t in tables}))} of this data and profile",
            where="--against",
            remedy="run its rows with the same data, protocol and profile first",
        )
    return copied


def failures(folder: Path) -> dict[str, str]:
    """Cells of a run that should have worked and did not: method name -> status and reason."""
    return {
        stored.record.method.name: f"{stored.record.status}: {stored.record.reason}"
        for stored in load_run(folder)
        if stored.record.status not in ("ok", "unsupported", "skipped")
    }
