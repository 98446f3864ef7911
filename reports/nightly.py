"""Two nights compared, and the history of many: which numbers of which rows moved for the worse, beyond chance.

Rows of one night are compared with the same rows of another on the same samples (:func:`reports.aggregate
.paired_difference`). All comparisons of a night are one family under Holm's correction, so that the chance of a false
alarm in a night stays at ``alpha``.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from reports.aggregate import holm, paired_difference
from reports.curves import COLOURS
from reports.figures import styled
from reports.formatting import escape_markdown, number
from reports.records import BadRecord, Better, write_text_atomically
from reports.rows import Row
from reports.significance import Difference
from reports.tables import Column, Table, tables_of_run

FAMILY_WISE = 0.01
MOST_TRENDS = 12


@dataclass(frozen=True)
class Change:
    """One number of one row on two nights.

    Attributes
    ----------
    before, now : values; ``difference`` is now minus before with its interval and uncorrected p.
    p : adjusted over all comparisons of the night.
    worse : whether the number went the wrong way.
    """

    table: str
    method: str
    column: str
    unit: str
    before: float
    now: float
    difference: Difference
    p: float
    worse: bool


@dataclass(frozen=True)
class Comparison:
    """What came of comparing two nights.

    Attributes
    ----------
    compared : how many numbers were compared.
    regressions, improvements : changes that are beyond chance.
    lost : rows that had finished before and have not now, with the reason.
    not_compared : rows or tables that could not be compared, with the reason.
    """

    compared: int
    regressions: tuple[Change, ...]
    improvements: tuple[Change, ...]
    lost: Mapping[str, str]
    not_compared: Mapping[str, str]


def compare_nights(before: Path, now: Path, alpha: float = FAMILY_WISE) -> Comparison:
    """Compare every main column of every row that both run folders have.

    Raises
    ------
    BadRecord : records of either night are broken.
    """
    earlier = {table.key: table for table in tables_of_run(before)}
    found: list[tuple[str, str, Column, Row, Row, Difference]] = []
    lost, apart = {}, {}
    for table in tables_of_run(now):
        if table.key not in earlier:
            apart[table.title] = "the night before has no such table"
            continue
        rows = {row.row.method.row_name: row.row for row in earlier[table.key].rows}
        for row in table.rows:
            name, old = row.row.method.row_name, rows.get(row.row.method.row_name)
            where = f"{name} in {table.title}"
            if old is None:
                apart[where] = "new"
            elif old.ok and not row.row.ok:
                lost[where] = row.row.reason
            elif old.ok:
                try:
                    pairs = list(_differences(table, row.row, old))
                except BadRecord as error:
                    apart[where] = str(error)
                    continue
                found += [(table.title, name, column, old, row.row, d) for column, d in pairs]
    adjusted = holm([item[-1].p for item in found])
    changes = [_change(*item, p) for item, p in zip(found, adjusted, strict=True) if p < alpha]
    return Comparison(
        compared=len(found),
        regressions=tuple(change for change in changes if change.worse),
        improvements=tuple(change for change in changes if not change.worse),
        lost=lost,
        not_compared=apart,
    )


def _differences(table: Table, row: Row, old: Row) -> Iterator[tuple[Column, Difference]]:
    same = [record.motions_digest for record in row.ok] == [record.motions_digest for record in old.ok]
    for column in table.columns_of("main"):
        if column.better == "none" or (same and row.ok[0].motions_digest):
            continue
        difference = paired_difference(row, old, column.metric, column.slice)
        if difference is not None:
            yield column, difference


def _change(table: str, name: str, column: Column, old: Row, row: Row, difference: Difference, p: float) -> Change:
    before, now = (_value(side, column) for side in (old, row))
    return Change(
        table, name, column.title, column.unit, before, now, difference, float(p), is_worse(column.better, before, now)
    )


def is_worse(better: Better, before: float, now: float) -> bool:
    """Whether a number has gone the wrong way."""
    if better == "one":
        return abs(now - 1.0) > abs(before - 1.0)
    return now < before if better == "higher" else now > before


def _value(row: Row, column: Column) -> float:
    values = [m.value for m in row.measurements(column.metric, column.slice) if m.value is not None]
    return float(np.mean(values)) if values else float("nan")


def summary(night: str, before: str, comparison: Comparison | None, failed: Mapping[str, str]) -> str:
    """A night in Markdown: what got worse, what failed, what got better; the first line says whether all is well."""
    bad = len(failed) + (len(comparison.regressions) + len(comparison.lost) if comparison else 0)
    lines = [f"# Night {night}: {f'{bad} to look at' if bad else 'all is well'}", ""]
    if comparison is None:
        lines += ["Not compared with another night.", ""]
    else:
        lines += [
            f"Compared with {before}: {comparison.compared} numbers whose motions changed, one family of tests "
            f"(Holm, {FAMILY_WISE:.0%}).",
            "",
            *_changes("Worse", comparison.regressions),
            *_listed("Finished before, not now", comparison.lost),
            *_changes("Better", comparison.improvements),
            *_listed("Not compared", comparison.not_compared),
        ]
    return "\n".join([*lines, *_listed("Failed", failed)]).rstrip() + "\n"


def _changes(title: str, changes: Sequence[Change]) -> list[str]:
    if not changes:
        return []
    rows = []
    for change in changes:
        before, now, moved, low, high = (
            number(value, change.unit)
            for value in (
                change.before,
                change.now,
                change.difference.value,
                change.difference.low,
                change.difference.high,
            )
        )
        names = " | ".join(escape_markdown(name) for name in (change.method, change.table, change.column))
        rows.append(f"| {names} | {before} | {now} | {moved} [{low}, {high}] | {change.p:.2g} |")
    head = ["| row | table | number | before | now | difference [95 %] | p |", "|---|---|---|---|---|---|---|"]
    return [f"## {title}", "", *head, *rows, ""]


def _listed(title: str, items: Mapping[str, str]) -> list[str]:
    if not items:
        return []
    return [f"## {title}", "", *(f"- {escape_markdown(k)}: {escape_markdown(v)}" for k, v in items.items()), ""]


@dataclass(frozen=True)
class Night:
    """One line of the history.

    Attributes
    ----------
    name : of the night's folder. good : nothing failed and nothing got worse.
    values : ``table | row | column`` -> value of every primary column.
    """

    name: str
    good: bool
    values: Mapping[str, float]


def night_of(name: str, good: bool, folder: Path) -> Night:
    """The primary numbers of a night's rows."""
    values = {}
    for table in tables_of_run(folder):
        column = table.primary
        for row in table.rows if column else ():
            found = row.estimates.get(column.key) if column else None
            if column and found is not None and found.value is not None:
                values[f"{table.title} | {row.row.method.row_name} | {column.title}"] = found.value
    return Night(name, good, values)


def read_history(path: Path) -> list[Night]:
    """All nights, oldest first.

    Raises
    ------
    BadRecord : a line is no night.
    """
    if not path.is_file():
        return []
    found = []
    for place, line in enumerate(path.read_text(encoding="utf-8").splitlines(), start=1):
        try:
            night: dict[str, Any] = json.loads(line)
            found.append(Night(str(night["name"]), bool(night["good"]), dict(night["values"])))
        except (ValueError, KeyError, TypeError) as error:
            raise BadRecord(f"{path}:{place}: not a night: {error}") from error
    return found


def add_to_history(path: Path, night: Night) -> list[Night]:
    """Append a night; returns all of them."""
    nights = [*read_history(path), night]
    write_text_atomically(path, "".join(json.dumps(asdict(n), sort_keys=True) + "\n" for n in nights))
    return nights


def trend_figure(nights: Sequence[Night]) -> Figure:
    """Primary numbers over the nights, a panel a table; crosses are nights that were not good.

    Raises
    ------
    BadRecord : no night has a number.
    """
    tables: dict[str, list[str]] = {}
    for key in dict.fromkeys(key for night in nights for key in night.values):
        tables.setdefault(key.partition(" | ")[0], []).append(key)
    if not tables:
        raise BadRecord("no night has a number to draw")
    with styled():
        figure = Figure(figsize=(9.0, 2.9 * len(tables) + 0.4), layout="constrained")
        FigureCanvasAgg(figure)
        panels = figure.subplots(len(tables), 1, squeeze=False).ravel()
        at = np.arange(len(nights))
        for panel, (title, keys) in zip(panels, tables.items(), strict=True):
            for colour, key in zip(COLOURS * len(keys), keys[:MOST_TRENDS], strict=False):
                values = np.array([night.values.get(key, np.nan) for night in nights])
                panel.plot(at, values, color=colour, marker=".", linewidth=1.0, label=key.split(" | ")[1])
                bad = np.array([not night.good for night in nights])
                panel.plot(at[bad], values[bad], "x", color=colour, markersize=8)
            panel.set_title(title, fontsize=9)
            panel.set_xticks(at, [night.name[:10] for night in nights], rotation=45, fontsize=7)
            panel.legend(fontsize=7, ncols=3, loc="center left", bbox_to_anchor=(1.0, 0.5))
    return figure
