"""``leaderboard.md`` from published records: the same records give the same bytes."""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path

from tabulate import tabulate

from reports.formatting import UNDEFINED, count, duration, escape_markdown, number, one_line
from reports.records import Record
from reports.render import anchor_table, environment, to_markdown
from reports.rows import GroupKey, StoredRecord, groups, load_run
from reports.tables import Column, Table, TableRow, build_table
from reports.verdicts import Verdict, sentences, verdict_of

MAX_DIFF_LINES = 40
TRACKS = ("transfer", "latent", "interpolation", "parts", "gesture", "prediction", "runtime")
"""Order of the page."""
OWN = "stylebench-"


def render_leaderboard(records_folder: Path) -> str:
    """The whole page as Markdown, from the records and samples files under ``records_folder``.

    Records judged by local judges are left out and named. No time, host or path enters but those in the records.

    Raises
    ------
    BadRecord : a record or samples file is broken, or records must not stand in one table.
    """
    stored = load_run(records_folder)
    canonical = [item for item in stored if not _is_local(item.record)]
    built = [(build_table(key, items), items) for key, items in sorted(groups(canonical).items(), key=_place)]
    tables = [(table, items, verdict_of(table)) for table, items in built]
    template = environment().get_template("leaderboard.md")
    page = template.render(
        first=_first_screen([(table, verdict) for table, _, verdict in tables]),
        sections=[_section(table, items, verdict) for table, items, verdict in tables],
        anchors=anchor_table([table for table, _, _ in tables]),
        left_out=_left_out(stored),
    )
    return page.rstrip() + "\n"


def _place(item: tuple[GroupKey, Sequence[StoredRecord]]) -> tuple[object, ...]:
    """Our own protocols first, track by track, each from its standard condition on; then those of the papers."""
    key = item[0]
    track = TRACKS.index(key.track) if key.track in TRACKS else len(TRACKS)
    return (not key.protocol.startswith(OWN), track, key.condition != "standard", *map(str, key))


def _first_screen(tables: Sequence[tuple[Table, Verdict]]) -> str:
    """One line a table with a ranked method: who leads, who really transfers, who copies, what the leader costs."""
    lines = []
    for table, verdict in tables:
        if table.primary is None or not verdict.leaders:
            continue
        copying = [*verdict.copying_methods, *verdict.copying_anchors]
        lines.append(
            [
                escape_markdown(_short_title(table)),
                "; ".join(f"{escape_markdown(row.title)} {_primary(table, row)}" for row in verdict.leaders),
                "–" if verdict.no_floor else _titles(verdict.transfers),
                "–" if verdict.no_floor else _titles([*verdict.like_a_trick, *verdict.does_nothing]),
                _titles(copying) if copying else "",
                _costs(verdict.leaders[0]),
            ]
        )
    headers = [
        "table", "leads (tie group)", "really better than nothing and than the best trick", "not separably better",
        "copies (no rank)", "cost of the leader",
    ]  # fmt: skip
    return _pipe(headers, lines)


def _short_title(table: Table) -> str:
    name = table.key.track if table.key.protocol.startswith(OWN) else table.protocol_id
    condition = "" if table.key.condition == "standard" else f"/{table.key.condition}"
    return f"{name}{condition}, {table.key.dataset.partition('@')[0]}"


def _titles(rows: Sequence[TableRow]) -> str:
    return ", ".join(escape_markdown(row.title) for row in rows) or "none"


def _primary(table: Table, row: TableRow) -> str:
    column = table.primary
    found = row.estimates.get(column.key) if column else None
    if column is None or found is None or found.value is None:
        return UNDEFINED
    return number(found.value, column.unit) + ("" if column.unit in ("1", "distance") else f" {column.unit}")


def _costs(row: TableRow) -> str:
    facts = row.row.method
    size = "" if facts.parameters is None else f"{count(facts.parameters)} parameters, "
    return f"{size}{escape_markdown(facts.trained_on) or 'nothing trained'}; run {_run_time(row)}"


def _run_time(row: TableRow) -> str:
    """Wall clock of one cell of a row: the mean over its seeds and trials."""
    seconds = [record.provenance.wall_s for record, _ in row.row.stored]
    return duration(sum(seconds) / len(seconds))


def check(path: Path, records_folder: Path) -> str:
    """Empty if ``path`` holds exactly what the records give, else what differs, in at most 40 lines of diff."""
    wanted = render_leaderboard(records_folder)
    if not path.is_file():
        return f"{path}: missing; write it with `stylebench leaderboard`"
    found = path.read_text(encoding="utf-8")
    if found == wanted:
        return ""
    lines = list(
        difflib.unified_diff(found.splitlines(), wanted.splitlines(), path.name, "from the records", lineterm="", n=1)
    )
    more = [f"... {len(lines) - MAX_DIFF_LINES} more lines"] if len(lines) > MAX_DIFF_LINES else []
    head = f"{path}: differs from what the records give; write it again with `stylebench leaderboard`"
    return "\n".join([head, *lines[:MAX_DIFF_LINES], *more])


def _is_local(record: Record) -> bool:
    return any(judge.origin == "local" for judge in record.judges)


def _left_out(stored: Sequence[StoredRecord]) -> list[str]:
    names = {(record.method.row_title, record.dataset) for record, _ in stored if _is_local(record)}
    return [f"{escape_markdown(title)} on {escape_markdown(dataset)}" for title, dataset in sorted(names)]


def _section(table: Table, stored: Sequence[StoredRecord], verdict: Verdict) -> dict[str, object]:
    return {
        "title": escape_markdown(table.title),
        "overview": sentences(table, verdict),
        "cost": _cost(table),
        "facts": _facts(table),
        "main": to_markdown(table, "main").rstrip(),
        "details": to_markdown(table, "details").rstrip() if table.columns_of("details") else "",
        "judges": _judge_cards(table),
        "runs": _runs(stored),
    }


def _pipe(headers: Sequence[str], lines: Sequence[Sequence[str]]) -> str:
    return tabulate(lines, headers=headers, tablefmt="pipe", disable_numparse=True) if lines else ""


def _cost(table: Table) -> str:
    """What each method took to train, run and score; empty without methods."""
    rows = [row for row in table.rows if row.row.method.kind == "method"]
    column = table.primary
    headers = ["rank", "method", column.header if column else "", "seeds", "run", "memory", "needs", "trained on"]
    return _pipe(headers, [_cost_line(row, column) for row in rows])


def _cost_line(row: TableRow, column: Column | None) -> list[str]:
    facts = row.row.method
    found = row.estimates.get(column.key) if column else None
    value = UNDEFINED if column is None or found is None or found.value is None else number(found.value, column.unit)
    needs = [words for words in row.marks if words.startswith(("needs", "uses"))]
    provenance = [record.provenance for record, _ in row.row.stored]
    return [
        UNDEFINED if row.rank is None else str(row.rank),
        escape_markdown(row.title) + (" (copies)" if row.row.copies else ""),
        row.row.status if row.section == "unfinished" else value,
        str(len(row.row.seeds)) if facts.trained_on else UNDEFINED,
        _run_time(row),
        f"{max(item.peak_rss_mb for item in provenance) / 1000.0:.1f} GB",
        ", ".join(words.removeprefix("needs ") for words in needs),
        escape_markdown(facts.trained_on),
    ]


def _facts(table: Table) -> list[str]:
    """What a reader needs to rebuild the numbers, as Markdown list items."""
    column = table.primary
    items = []
    if column is not None and table.n is not None:
        items.append(f"n: {table.n} samples behind {column.title} ({column.slice.replace('_', ' ')})")
    names = ["licence", "citation", *(name for name in table.facts if name not in ("licence", "citation"))]
    items += [
        f"{name.replace('_', ' ')}: {escape_markdown(table.facts[name])}" for name in names if name in table.facts
    ]
    return items


def _judge_cards(table: Table) -> str:
    def percent(value: float | None) -> str:
        return UNDEFINED if value is None else number(value, "%")

    lines = [
        [
            escape_markdown(judge.id),
            percent(judge.real_accuracy),
            percent(judge.chance),
            percent(judge.majority_rate),
            judge.origin,
            f"`{judge.digest}`",
        ]
        for judge in table.judges
    ]
    return _pipe(["judge", "accuracy on real, %", "chance, %", "commonest class, %", "origin", "digest"], lines)


def _runs(stored: Sequence[StoredRecord]) -> list[str]:
    """One list item per distinct command, commit and machine, with what it took."""
    found: dict[tuple[str, ...], list[Record]] = {}
    for record, _ in stored:
        made = record.provenance
        commit = made.commit[:12] + (" with uncommitted changes" if made.dirty else "")
        machine = f"{made.gpu or made.cpu}, {made.threads} thread{'s' if made.threads != 1 else ''}"
        found.setdefault((one_line(made.command).replace("`", "'"), commit, machine), []).append(record)
    items = []
    for (command, commit, machine), records in sorted(found.items()):
        wall = duration(sum(record.provenance.wall_s for record in records))
        days = sorted({record.provenance.time_utc[:10] for record in records})
        span = days[0] if len(days) == 1 else f"{days[0]} to {days[-1]}"
        cells = f"{len(records)} cell{'s' if len(records) != 1 else ''}"
        keys = " ".join(f"`{key}`" for key in sorted(record.key for record in records))
        items.append(
            f"`{command}`<br>commit {commit}; {escape_markdown(machine)}; {cells} in {wall}; {span}; keys {keys}"
        )
    return items
