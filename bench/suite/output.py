"""What a run folder shows: tables and figures made from its records."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from matplotlib.figure import Figure

from reports.figures import interval_bars, recognition_scatter, save_figure
from reports.heatmap import part_heatmap
from reports.records import write_text_atomically
from reports.render import render
from reports.rows import GroupKey, load_run
from reports.tables import Column, Table, TableRow, tables_of_run


def write_report(folder: Path) -> list[str]:
    """Write ``tables.md``, one CSV and one figure per table into a run folder; returns the tables as plain text.

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
            save_figure(figure, folder / f"{stem}-{name}.png")
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
    if any(_has(row, table.primary) for row in table.rows):
        yield "intervals", interval_bars(table)


def _has(row: TableRow, column: Column) -> bool:
    found = row.estimates.get(column.key)
    return found is not None and found.value is not None


def failures(folder: Path) -> dict[str, str]:
    """Cells of a run that should have worked and did not: method name -> status and reason."""
    return {
        stored.record.method.name: f"{stored.record.status}: {stored.record.reason}"
        for stored in load_run(folder)
        if stored.record.status not in ("ok", "unsupported", "skipped")
    }
