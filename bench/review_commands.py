"""``stylebench table``, ``pack``, ``verify``, ``reproduce`` and ``diff``: what authors and reviewers type."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench import console
from bench.command_options import RUNS, STORE, command_line, datasets_of, names_of
from bench.errors import BadConfig
from reports.formatting import number, with_interval

if TYPE_CHECKING:
    from bench.suite.reproduce import Reproduced

PUBLISHED = Path("reports/published")
DataOption = Annotated[
    list[str] | None, typer.Option(help="Dataset as NAME or NAME=PATH; repeat for several. Default: procedural.")
]
StoreOption = Annotated[Path, typer.Option(help="Where finished work is kept between runs.")]
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


def pack(
    run_folder: Annotated[Path, typer.Argument(help="A run folder.")],
    methods: Annotated[str, typer.Option(help="Comma-separated names; default: all.")] = "",
    store: Annotated[Path, typer.Option(help="The store of the run; it has the motions.")] = STORE,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Write the motions of each row into a zip, and its digest into the record, so that others can score them again.

    Example: stylebench pack runs/latest --methods copy-content
    """
    from bench.suite.packs import pack_run
    from bench.suite.store import Store

    with console.ProgressDisplay() as progress:
        packed = pack_run(
            run_folder, Store(store.absolute()), names_of(methods),
            lambda done, total: progress("cells", "packing", done, total),
        )  # fmt: skip
    headers = ["pack", "MB", "not packed"]
    lines = [[str(one.file or one.record), f"{one.size_bytes / 1e6:.2f}", one.reason] for one in packed]
    if as_json:
        console.say_json([dict(zip(headers, line, strict=True)) for line in lines])
    else:
        console.show_rows(headers, lines)


def verify(
    records: Annotated[Path, typer.Argument(help="A record, a folder of records, a run, or a submission.")],
    sample: Annotated[int, typer.Option(min=0, help="Motions of each row to generate again.")] = 0,
    packs: Annotated[str, typer.Option(help="Folder or address of the packs; default: beside the records.")] = "",
    data: DataOption = None,
    out: Annotated[Path, typer.Option(help="Folder for what is scored again.")] = RUNS / "verify",
    store: StoreOption = STORE,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Check what records claim: digests, data, judges, numbers scored again from packs, motions generated again.

    Example: stylebench verify examples/packs --sample 5
    """
    from bench.suite.verify import VerifyRequest, table_of
    from bench.suite.verify import verify as check

    request = VerifyRequest(records, packs, datasets_of(data or ["procedural"]), sample, out, store.absolute())
    with console.ProgressDisplay() as progress:
        claims = check(request, progress)
    headers = ["verdict", "record", "claim", "what"]
    if as_json:
        console.say_json([dict(zip(headers, line, strict=True)) for line in table_of(claims)])
    else:
        console.show_rows(headers, table_of(claims))
    counts = {
        verdict: sum(claim.verdict == verdict for claim in claims) for verdict in ("pass", "fail", "cannot check")
    }
    console.remark(", ".join(f"{verdict}: {number}" for verdict, number in counts.items()))
    if counts["fail"]:
        raise typer.Exit(1)


def reproduce(
    record: Annotated[Path, typer.Argument(help="A record, as under reports/published.")],
    data: DataOption = None,
    out: Annotated[Path | None, typer.Option(help="Run folder; default runs/<time>.")] = None,
    store: StoreOption = STORE,
    everything: Annotated[bool, typer.Option("--all", help="Also the numbers that came out the same.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Run the cell of a record again, trained again where needed, and compare every number with its interval.

    Example: stylebench reproduce reports/published/KEY.json --data bandai-namco=bandai.zip
    """
    from bench.suite import request as asked
    from bench.suite.reproduce import WITHIN
    from bench.suite.reproduce import reproduce as again

    with console.ProgressDisplay() as progress:
        old, _, found = again(
            record, datasets_of(data or ["procedural"]), out or asked.default_out(RUNS), store, progress,
            command_line(sys.argv[1:]),
        )  # fmt: skip
    shown = [item for item in found if everything or item.outcome != "same"]
    if as_json:
        console.say_json([vars(item) for item in shown])
    elif shown:
        headers = ["number", "on", "recorded", "again", "95 % interval", ""]
        console.show_rows(headers, [_reproduced_line(item) for item in shown])
    same = sum(item.outcome == "same" for item in found)
    console.remark(f"{old.method.name} in {old.protocol_id}/{old.condition}: {same} of {len(found)} numbers the same")
    if any(item.outcome not in WITHIN for item in found):
        raise typer.Exit(1)


def _reproduced_line(item: Reproduced) -> list[str]:
    def text(value: float | None) -> str:
        return "undefined" if value is None else number(value, item.unit)

    interval = "none" if item.low is None else f"[{text(item.low)}, {text(item.high)}]"
    return [item.metric, item.slice, text(item.recorded), text(item.again), interval, item.outcome]


def diff(
    first: Annotated[Path, typer.Argument(help="A run folder, or a folder of records.")],
    second: Annotated[Path, typer.Argument(help="Another; differences are second minus first.")],
    alpha: Annotated[
        float, typer.Option(help="Family-wise chance of calling a difference where there is none.")
    ] = 0.05,
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Compare two runs row by row on the same samples; exit 1 where a number is separably worse or a row is lost.

    Example: stylebench diff runs/before runs/latest
    """
    from reports.nightly import compare_nights

    found = compare_nights(first, second, alpha)
    changes = [*found.regressions, *found.improvements]
    headers = ["", "table", "row", "number", "first", "second", "difference, 95 %", "p"]
    lines = [
        [
            "worse" if change.worse else "better", change.table, change.method, change.column,
            number(change.before, change.unit), number(change.now, change.unit),
            with_interval(change.difference.value, change.difference.low, change.difference.high, change.unit),
            f"{change.p:.2g}",
        ]
        for change in changes
    ]  # fmt: skip
    if as_json:
        console.say_json(
            {
                "compared": found.compared,
                "differences": [dict(zip(headers, line, strict=True)) for line in lines],
                "lost": dict(found.lost),
                "not compared": dict(found.not_compared),
            }
        )
    else:
        if lines:
            console.show_rows(headers, lines)
        console.say(f"{found.compared} numbers compared, {len(lines)} separable at {alpha:g} (Holm)")
        for name, reason in found.lost.items():
            console.complain(f"lost: {name}: {reason}")
        for name, reason in found.not_compared.items():
            console.remark(f"not compared: {name}: {reason}")
    if found.regressions or found.lost:
        raise typer.Exit(1)
