"""The tables of the five papers rebuilt: published numbers joined with records by method, metric and slice."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from bench.adapters import ADAPTERS
from bench.errors import BadConfig
from bench.metrics import METRICS
from bench.protocols import PROTOCOLS
from bench.protocols.published import Published, published_numbers
from reports.aggregate import Estimate, estimate, tie_groups
from reports.context import judge_summary
from reports.formatting import number, one_line
from reports.paper_table import PaperCell, PaperColumn, PaperRow, PaperTable
from reports.records import PAPER_BUDGET
from reports.rows import GroupKey, Row, StoredRecord, groups, rows_of
from reports.tables import build_table

NOT_MEASURED = "published, not measured here"
DECLARED = {"animation_synthesis_network_params", "style_modulation_network_params"}
"""Quantities that are counts of a network, not measurements of motion: tests hold them (see the method's docs)."""
WITHOUT_PRINTED_NUMBERS = {"mason2022.fig10": "Mason 2022, Figure 10 (bars, no printed numbers)"}


def paper_table_ids() -> tuple[str, ...]:
    """Every table that can be rebuilt, in the papers' order."""
    printed = [row.table_id for row in published_numbers() if not row.table_id.endswith(".text")]
    return tuple(dict.fromkeys([*printed, *WITHOUT_PRINTED_NUMBERS]))


def paper_tables(table_id: str, stored: Sequence[StoredRecord]) -> tuple[PaperTable, ...]:
    """One table of a paper, once for every dataset and profile that records of its protocol are there for.

    Without records there is one table all the same: its gaps say what to run.

    Raises
    ------
    BadConfig : no such table.
    BadRecord : records must not stand in one table.
    """
    if table_id not in paper_table_ids():
        raise BadConfig(
            f"no table is called {table_id!r}", where="TABLE", remedy=f"one of {', '.join(paper_table_ids())}"
        )
    published = () if table_id in WITHOUT_PRINTED_NUMBERS else published_numbers(table_id)
    label = protocol_of(table_id)
    own = [item for item in stored if item.record.protocol_label == label]
    found = groups(own)
    if not found:
        return (_joined(table_id, published, None, ()),)
    return tuple(_joined(table_id, published, key, items) for key, items in found.items())


def protocol_of(table_id: str) -> str:
    """Label of the protocol that measures a table; empty for tables that are not measured here."""
    paper, _, table = table_id.partition(".")
    label = f"{paper}@1/{table}"
    return label if label in PROTOCOLS else ""


def _joined(
    table_id: str, published: Sequence[Published], key: GroupKey | None, stored: Sequence[StoredRecord]
) -> PaperTable:
    rows = {row.method.row_name: row for row in rows_of(stored)}
    columns = _columns(published) or _measured_columns(key, stored)
    cells_of = {(item.method, item.metric): item for item in published}
    ranks = {column.name: _ranks(column, list(rows.values())) for column in columns}
    printed = list(dict.fromkeys((item.method, item.our_method) for item in published))
    answering = {method: _most_trained(method, rows.values()) for _, method in printed}
    paper_rows = [
        _paper_row(name, method, columns, cells_of, answering[method], ranks, table_id) for name, method in printed
    ]
    shown = {row.method.row_name for row in answering.values() if row}
    ours = [name for name in rows if name not in shown]
    own_rows = [_own_row(rows[name], columns, ranks) for name in ours if rows[name].ok]
    title = f"{published[0].paper}, {published[0].table}" if published else WITHOUT_PRINTED_NUMBERS[table_id]
    return PaperTable(
        table_id=table_id,
        title=title,
        dataset=f"{key.dataset} · {key.profile}" if key else "",
        columns=columns,
        rows=(*paper_rows, *own_rows),
        orders=tuple(order for column in columns if (order := _order(column, ranks[column.name], rows))),
        facts=_facts(stored),
    )


def _most_trained(method: str, rows: Iterable[Row]) -> Row | None:
    """The row that stands beside a paper's: trained as the paper does, where there is such a row."""
    own = [row for row in rows if row.method.name == method]
    return max(own, key=lambda row: row.method.budget == PAPER_BUDGET, default=None)


def _columns(published: Sequence[Published]) -> tuple[PaperColumn, ...]:
    columns: dict[str, PaperColumn] = {}
    for item in published:
        metric = METRICS.get(item.our_metric)
        measured = PaperColumn(
            item.metric,
            item.our_metric,
            item.our_slice,
            metric.unit if metric else item.unit,
            metric.better if metric else "none",
            item.unit,
        )
        if item.metric not in columns or (metric and not columns[item.metric].metric):
            columns[item.metric] = measured
    return tuple(columns.values())


def _measured_columns(key: GroupKey | None, stored: Sequence[StoredRecord]) -> tuple[PaperColumn, ...]:
    """The main columns of our own table, where the paper prints no numbers."""
    if key is None:
        return ()
    return tuple(
        PaperColumn(column.title, column.metric, column.slice, column.unit, column.better, column.unit)
        for column in build_table(key, stored).columns_of("main")
    )


def _paper_row(
    name: str,
    method: str,
    columns: Sequence[PaperColumn],
    items: dict[tuple[str, str], Published],
    row: Row | None,
    ranks: dict[str, dict[str, int]],
    table_id: str,
) -> PaperRow:
    cells = {}
    for column in columns:
        item = items.get((name, column.name))
        best = row is not None and _is_best(row.method.row_name, ranks[column.name])
        cells[column.name] = (
            PaperCell(gap="the paper has no such cell") if item is None else _cell(item, row, best, table_id)
        )
    title = row.method.row_title if row else (ADAPTERS[method].title if method in ADAPTERS else "")
    return PaperRow(
        name, row.method.row_name if row else method, title, ("copies",) if row and row.copies else (), cells
    )


def _own_row(row: Row, columns: Sequence[PaperColumn], ranks: dict[str, dict[str, int]]) -> PaperRow:
    cells = {
        column.name: PaperCell(
            ours=_estimate(row, column.metric, column.slice) if column.metric else None,
            gap="no such number in this record" if column.metric else NOT_MEASURED,
            best=_is_best(row.method.row_name, ranks[column.name]),
        )
        for column in columns
    }
    marks = (*(["anchor"] if row.method.kind == "anchor" else []), *(["copies"] if row.copies else []))
    return PaperRow("", row.method.row_name, row.method.row_title, marks, cells)


def _cell(item: Published, row: Row | None, best: bool, table_id: str) -> PaperCell:
    scale = item.factor if item.factor is not None else None if item.our_metric else 1.0
    published = item.value * scale if item.value is not None and scale is not None else None
    printed = item.printed + (f" ± {item.sd:g}" if item.sd is not None else "")
    ours = _estimate(row, item.our_metric, item.our_slice) if row is not None and row.ok and item.our_metric else None
    gap = "" if ours is not None else _gap(item, row, table_id)
    comparable, why = item.comparable, item.why
    if comparable and item.unit == "count" and row is not None and row.method.budget != PAPER_BUDGET:
        comparable, why = False, f"ours is narrower than the paper's network ({row.method.trained_on})"
    return PaperCell(printed, published, ours, gap, comparable, why, best and ours is not None)


def _gap(item: Published, row: Row | None, table_id: str) -> str:
    """Why there is no number of ours: never a hole without a reason."""
    if item.metric in DECLARED:
        return "a count of the network: the method's tests and docs hold ours"
    if not protocol_of(table_id) or not item.our_metric:
        return NOT_MEASURED
    if item.our_method not in ADAPTERS:
        return "no method of this name here"
    if row is None:
        return (
            f"no record: stylebench run --protocols {protocol_of(table_id)} --methods {item.our_method} "
            "--data NAME=PATH"
        )
    if not row.ok:
        return f"{row.status}: {row.reason}"
    return f"the record has no {item.our_metric} on {item.our_slice or 'all'}"


def _estimate(row: Row, metric: str, slice_name: str) -> Estimate | None:
    """The estimate of a slice, or of a fact in its details: ``intra:against_style_sample``."""
    slice_name, _, detail = slice_name.partition(":")
    found = estimate(row, metric, slice_name or "all")
    if found is None or not detail:
        return found
    values = [item.details[detail] for item in row.measurements(metric, slice_name) if detail in item.details]
    if not values:
        return None
    return replace(found, value=sum(values) / len(values), low=None, high=None, seed_sd=None)


def _ranks(column: PaperColumn, rows: Sequence[Row]) -> dict[str, int]:
    if not column.metric or ":" in column.slice or column.better == "none":
        return {}
    return tie_groups(rows, column.metric, column.slice or "all")


def _is_best(method: str, ranks: dict[str, int]) -> bool:
    """Alone in the first tie group of at least two methods."""
    return len(ranks) > 1 and ranks.get(method) == 1 and list(ranks.values()).count(1) == 1


def _order(column: PaperColumn, ranks: dict[str, int], rows: dict[str, Row]) -> str:
    if len(ranks) < 2:
        return ""
    tied: dict[int, list[str]] = {}
    for name, rank in ranks.items():
        tied.setdefault(rank, []).append(one_line(rows[name].method.row_title))
    return f"{column.title}, best first, = not separable: " + " > ".join(" = ".join(names) for names in tied.values())


def _facts(stored: Sequence[StoredRecord]) -> tuple[str, ...]:
    """What our numbers are made with; empty without records."""
    if not stored:
        return ()
    records = [item.record for item in stored if item.record.status == "ok"]
    judges = {judge.id: judge for record in records for judge in record.judges}
    budgets = sorted({record.method.trained_on for record in records if record.method.trained_on})
    machines = sorted({record.provenance.gpu or record.provenance.cpu for record in records})
    seeds = sorted({record.seed for record in records})
    counts = sorted({measurement.n for record in records for measurement in record.measurements})
    said = [
        judge_summary([judges[name] for name in sorted(judges)]),
        f"Protocol {stored[0].record.protocol_id}/{stored[0].record.condition}",
        f"n: {counts[0]} to {counts[-1]} by slice" if counts else "",
        f"method seeds: {', '.join(map(str, seeds))}",
        f"trained on: {'; '.join(budgets)}" if budgets else "",
        f"hardware: {', '.join(machines)}" if machines else "",
    ]
    return tuple(f"{sentence}." for sentence in said if sentence)


def explain(table: PaperTable, cell: str, stored: Sequence[StoredRecord]) -> str:
    """Everything behind one cell, ``ROW:QUANTITY``: judge, data, windows, samples, versions, command.

    ``ROW`` is a row's name in the paper or ours, ``QUANTITY`` the paper's name of the column or our metric.

    Raises
    ------
    BadConfig : the table has no such row or quantity.
    """
    row_name, _, quantity = cell.rpartition(":")
    row = next((row for row in table.rows if row_name in (row.printed, row.method)), None)
    column = next((column for column in table.columns if quantity in (column.name, column.metric)), None)
    if row is None or column is None:
        known = [row.method or row.printed for row in table.rows]
        raise BadConfig(
            f"no cell {cell!r}",
            where="--explain",
            remedy=f"ROW:QUANTITY with a row of {', '.join(known)} and a quantity of "
            f"{', '.join(column.name for column in table.columns)}",
        )
    found = row.cells[column.name]
    lines = [f"{table.title}, row {row.label}, {column.title}, {table.dataset or 'no records'}", ""]
    lines += _published_lines(table.table_id, row, column, found)
    label = protocol_of(table.table_id)
    own = [
        item
        for item in stored
        if (item.record.method.row_name, item.record.protocol_label) == (row.method, label)
        and f"{item.record.dataset} · {item.record.profile}" == table.dataset
    ]
    if found.ours is None or not own:
        return "\n".join([*lines, f"ours: none; {found.gap}"]) + "\n"
    return "\n".join([*lines, *_our_lines(found.ours, column, own)]) + "\n"


def _published_lines(table_id: str, row: PaperRow, column: PaperColumn, cell: PaperCell) -> list[str]:
    if not cell.printed:
        return ["published: nothing"]
    item = next(
        item for item in published_numbers(table_id) if (item.method, item.metric) == (row.printed, column.name)
    )
    comparable = "yes" if item.comparable else f"no: {item.why}"
    return [
        f"published: {cell.printed} {item.unit} ({item.paper}, {item.table}, row {item.method!r}, {item.metric})",
        f"measured there: {item.condition or 'not said'}",
        f"comparable: {comparable}",
    ]


def _our_lines(ours: Estimate, column: PaperColumn, stored: Sequence[StoredRecord]) -> list[str]:
    metric, slice_name = column.metric, column.slice.partition(":")[0] or "all"
    definition = METRICS[metric]
    value = "undefined" if ours.value is None else f"{number(ours.value, column.unit)} {column.unit}"
    interval = "none" if ours.low is None else f"[{ours.low:.6g}, {ours.high:.6g}], 95 % over tasks"
    lines = [
        f"ours: {value}, interval {interval}, n {ours.n}, {ours.seeds} method seed(s)",
        f"metric: {metric} version {definition.version}, on {column.slice or 'all'}: {definition.summary}",
        f"source of the metric: {definition.source}; formula in docs/metrics/{definition.docs}.md",
        f"misleads: {definition.misleads}",
    ]
    for record, path in stored:
        lines += ["", f"record {path.name}: seed {record.seed}, {record.status}"]
        measured = record.find(metric, slice_name)
        if measured is not None:
            lines.append(f"  value {measured.value}, under each judge seed {list(measured.judge_values) or 'no judge'}")
            lines += [f"  {name} {fact:g}" for name, fact in sorted(measured.details.items())]
            lines += [f"  said: {one_line(measured.reason)}"] if measured.reason else []
        facts = record.method
        made = record.provenance
        lines += [
            f"  method {facts.name}, digest {facts.digest}, trained on: {facts.trained_on or 'nothing'}",
            f"  data {record.dataset}, digest {record.dataset_digest}, split {record.split}, seed {record.split_seed}",
            f"  protocol {record.protocol_id}/{record.condition}, profile {record.profile}",
            *(f"  {name}: {one_line(text)}" for name, text in sorted(record.protocol_facts.items())),
            *(f"  judge {judge.id}, {judge.origin}, digest {judge.digest}" for judge in record.judges),
            f"  motions digest {record.motions_digest}, samples digest {record.samples_digest}",
            f"  commit {made.commit}{' with uncommitted changes' if made.dirty else ''}, python {made.python}, "
            f"{made.gpu or made.cpu}, {made.threads} thread(s), {made.time_utc}",
            f"  command: {one_line(made.command)}",
            f"  again: stylebench reproduce {path}",
        ]
    return lines
