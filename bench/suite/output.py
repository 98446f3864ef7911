"""What a run folder shows: tables and figures made from its records."""

from __future__ import annotations

from pathlib import Path

from reports.figures import recognition_scatter, save_figure
from reports.records import write_text_atomically
from reports.render import render
from reports.rows import load_run
from reports.tables import tables_of_run


def write_report(folder: Path) -> list[str]:
    """Write ``tables.md``, one CSV and one figure per table into a run folder; returns the tables as plain text.

    Raises
    ------
    BadRecord : no records there, or broken ones.
    """
    texts, pages = [], []
    for table in tables_of_run(folder):
        stem = f"{table.key.track}-{table.key.dataset}-{table.key.profile}"
        texts.append(render(table, "text"))
        pages.append(f"# {table.title}\n\n{render(table, 'md')}\n\n## Details\n\n{render(table, 'md', 'details')}")
        write_text_atomically(folder / f"{stem}.csv", render(table, "csv"))
        if table.primary is not None and table.key.track == "transfer":
            save_figure(recognition_scatter(table), folder / f"{stem}-recognition.png")
    write_text_atomically(folder / "tables.md", "\n\n".join(pages) + "\n")
    return texts


def failures(folder: Path) -> dict[str, str]:
    """Cells of a run that should have worked and did not: method name -> status and reason."""
    return {
        stored.record.method.name: f"{stored.record.status}: {stored.record.reason}"
        for stored in load_run(folder)
        if stored.record.status not in ("ok", "unsupported", "skipped")
    }
