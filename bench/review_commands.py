"""``stylebench table``, ``pack``, ``verify``, ``reproduce`` and ``diff``: what authors and reviewers type."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench import console
from bench.errors import BadConfig

PUBLISHED = Path("reports/published")
RecordsOption = Annotated[Path, typer.Option(help="A run folder, or a folder of records.")]


def table(
    table_id: Annotated[str, typer.Argument(metavar="TABLE", help="PAPER.TABLE; `list` names them all.")],
    form: Annotated[str, typer.Option("--format", help="text, md, latex, csv or html.")] = "text",
    explain: Annotated[str, typer.Option(help="ROW:QUANTITY; print all that is behind this cell.")] = "",
    dataset: Annotated[str, typer.Option(help="Start of the dataset's name, where records have several.")] = "",
    records: RecordsOption = PUBLISHED,
) -> None:
    """Rebuild a table of one of the five papers from records, beside what the paper prints.

    Example: stylebench table park2021.table2 --format md
    """
    from bench.suite import paper_tables
    from reports.paper_table import FORMS, render_paper_table
    from reports.rows import load_run

    if table_id == "list":
        console.say("\n".join(paper_tables.paper_table_ids()))
        return
    chosen = next((known for known in FORMS if known == form), None)
    if chosen is None:
        raise BadConfig(f"unknown format {form!r}", where="--format", remedy=f"one of {', '.join(FORMS)}")
    stored = load_run(records)
    found = [item for item in paper_tables.paper_tables(table_id, stored) if item.dataset.startswith(dataset)]
    if not found:
        raise BadConfig(f"no records of {table_id} on a dataset {dataset!r}", where="--dataset")
    for item in found:
        console.say(paper_tables.explain(item, explain, stored) if explain else render_paper_table(item, chosen))
