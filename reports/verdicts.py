"""What the first screen says of a table: who leads, who really transfers style, who copies, what a trick can do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from reports.aggregate import badness, paired_difference
from reports.formatting import escape_markdown, number
from reports.significance import SIGNIFICANCE, holm
from reports.tables import Column, Table, TableRow

CEILING_ROWS = (
    "real-test", "real-disjoint", "label-oracle", "procedural-truth", "gesture-truth", "real-answer", "take-to-take",
    "gesture-imitation",
)  # fmt: skip
"""Anchors made of performed or true answers; also with a suffix: ``real-test+park-ik``."""
NOTHING_ROWS = ("copy-content", "copy-style", "coin-flip", "mean-pose", "frozen-frame", "repeat-last", "noise")
"""Anchors that do not even try; also with a suffix: ``noise-0.1``."""
RIGHT = 1e-9
"""An error below this is none: what has it cannot be beaten."""


@dataclass(frozen=True)
class Verdict:
    """Names of rows of one table, best first."""

    leaders: tuple[TableRow, ...]
    """methods of rank 1"""
    transfers: tuple[TableRow, ...]
    """ranked methods separably better than every row that does nothing and than the best simple trick"""
    like_a_trick: tuple[TableRow, ...]
    """ranked methods separably better than every row that does nothing, but not than the trick"""
    does_nothing: tuple[TableRow, ...]
    """the other ranked methods"""
    no_floor: str
    """why nothing can be said of the three above, which then are empty; empty where it can"""
    trick: TableRow | None
    """the best anchor that neither is real motion nor does nothing nor copies"""
    copying_methods: tuple[TableRow, ...]
    copying_anchors: tuple[TableRow, ...]


def is_one_of(name: str, families: Sequence[str]) -> bool:
    """Whether an anchor's name is one of the families, alone or with a suffix after ``-`` or ``+``."""
    return any(name == family or name.startswith((f"{family}-", f"{family}+")) for family in families)


def verdict_of(table: Table) -> Verdict:
    """Judge the ranked methods of a table on its primary column.

    A method is better than nothing if it is above chance, where the column has one, and separably better than every
    do-nothing row that has a number: of its paired differences the largest p, Holm-corrected over the methods, decides
    (an intersection-union test: only a method that beats them all is called better). Without replicates of both rows a
    method counts as not separable.
    """
    ranked = [row for row in table.of("methods") if row.rank is not None]
    anchors = [row for row in table.of("anchors") if row.row.method.kind == "anchor"]
    measured = [row for row in anchors if table.primary and _badness(table.primary, row) < float("inf")]
    nothing = [row for row in measured if is_one_of(row.row.method.name, NOTHING_ROWS)]
    tricks = [
        row
        for row in measured
        if not row.row.copies and not is_one_of(row.row.method.name, (*NOTHING_ROWS, *CEILING_ROWS))
    ]
    true = [row for row in measured if is_one_of(row.row.method.name, CEILING_ROWS)]
    no_floor = _why_no_floor(table.primary, nothing, true)
    judged = [] if no_floor else ranked
    above_nothing = _above_chance(table.primary, _better_than_all(table.primary, judged, nothing))
    above_trick = _better_than_all(table.primary, above_nothing, tricks[:1])
    return Verdict(
        leaders=tuple(row for row in ranked if row.rank == 1),
        transfers=above_trick,
        like_a_trick=tuple(row for row in above_nothing if row not in above_trick),
        does_nothing=tuple(row for row in judged if row not in above_nothing),
        no_floor=no_floor,
        trick=tricks[0] if tricks else None,
        copying_methods=tuple(row for row in table.of("anchors") if row.row.method.kind == "method"),
        copying_anchors=tuple(row for row in anchors if row.row.copies),
    )


def _why_no_floor(column: Column | None, nothing: Sequence[TableRow], true: Sequence[TableRow]) -> str:
    """Why *better than nothing* has no meaning in a table; empty where it has one. Rows best first."""
    if column is None or not nothing:
        return "no row that does nothing has a number here"
    right = [row for row in nothing if column.better == "lower" and _badness(column, row) < RIGHT]
    if right:
        return f"doing nothing is a right answer here ({escape_markdown(right[0].title)} {_value(column, right[0])})"
    if true and _badness(column, true[0]) >= _badness(column, nothing[0]):
        best = " against ".join(f"{escape_markdown(row.title)} {_value(column, row)}" for row in (true[0], nothing[0]))
        return f"the column puts doing nothing before true answers ({best})"
    return ""


def _badness(column: Column, row: TableRow) -> float:
    return badness(row.row, column.metric, column.slice)


def _above_chance(column: Column | None, rows: Sequence[TableRow]) -> tuple[TableRow, ...]:
    """Rows whose interval lies above what guessing gives; all of them where guessing gives nothing."""
    return tuple(row for row in rows if column is None or _lowest(column, row) >= _chance(column, row))


def _lowest(column: Column, row: TableRow) -> float:
    found = row.estimates[column.key]
    return float("inf") if found.low is None else found.low


def _chance(column: Column, row: TableRow) -> float:
    measured = row.row.measurements(column.metric, column.slice)
    return max((item.details["chance"] for item in measured if "chance" in item.details), default=-float("inf"))


def _better_than_all(
    column: Column | None, rows: Sequence[TableRow], rivals: Sequence[TableRow]
) -> tuple[TableRow, ...]:
    """Rows separably better than each rival, after Holm's correction over the rows."""
    if column is None or not rows:
        return ()
    adjusted = holm([max((_p_of_better(column, row, rival) for rival in rivals), default=0.0) for row in rows])
    return tuple(row for row, p in zip(rows, adjusted, strict=True) if p < SIGNIFICANCE)


def _p_of_better(column: Column, row: TableRow, rival: TableRow) -> float:
    """p of the paired difference; 1 where it goes the other way or cannot be tested."""
    found = paired_difference(row.row, rival.row, column.metric, column.slice)
    sign = -1.0 if column.better == "lower" else 1.0
    return 1.0 if found is None or sign * found.value <= 0.0 else found.p


def sentences(table: Table, verdict: Verdict) -> list[str]:
    """The verdict on a table as Markdown sentences, one fact each."""
    column = table.primary
    if column is None:
        return ["No row of this table has finished."]
    said = [_leading(table, column, verdict)]
    if verdict.leaders and verdict.no_floor:
        said.append(f"**Better than nothing?** Not to be said from this table: {verdict.no_floor}.")
    if verdict.transfers:
        done = "Really transfer style" if column.metric == "joint_recognition" else "Really better"
        said.append(f"**{done}** ({_beaten(verdict)}): {_names(verdict.transfers)}.")
    if verdict.trick is not None and verdict.like_a_trick:
        trick = f"{escape_markdown(verdict.trick.title)} ({_value(column, verdict.trick)})"
        said.append(f"**Better than nothing, but not than a simple trick**, {trick}: {_names(verdict.like_a_trick)}.")
    if verdict.does_nothing:
        said.append(f"**Not separable from doing nothing:** {_names(verdict.does_nothing)}.")
    if verdict.copying_methods:
        said.append(f"**Only copy** (no rank, whatever they score): {_names(verdict.copying_methods)}.")
    said += [_scale(table, column, verdict.trick), _if_frechet_ranked(table)]
    return [sentence for sentence in said if sentence]


def _beaten(verdict: Verdict) -> str:
    every = "separably above every do-nothing row"
    return every if verdict.trick is None else f"{every} and the best simple trick"


def _leading(table: Table, column: Column, verdict: Verdict) -> str:
    if not verdict.leaders:
        if table.of("methods"):
            return f"Methods stand in order of {column.title} and carry no ranks: their differences cannot be tested."
        return "No method is in this table yet; its anchor rows show what the numbers mean."
    tie = " (a tie: not separable on these samples)" if len(verdict.leaders) > 1 else ""
    values = ", ".join(f"{escape_markdown(row.title)} {_value(column, row)}" for row in verdict.leaders)
    return f"**Leads** on {column.title}{tie}: {values}."


def _scale(table: Table, column: Column, trick: TableRow | None) -> str:
    """Where real motion, the best trick and the best do-nothing row stand on the primary column."""
    anchors = table.of("anchors")
    families = (("real data", CEILING_ROWS[:2]), ("the best do-nothing row", NOTHING_ROWS))
    parts = []
    for words, names in families:
        found = [row for row in anchors if is_one_of(row.row.method.name, names)]
        if found:
            parts.append(f"{words} ({escape_markdown(found[0].title)}) {_value(column, found[0])}")
    if trick is not None:
        parts.insert(1, f"the best simple trick ({escape_markdown(trick.title)}) {_value(column, trick)}")
    return f"**Scale** of {column.title}: {', '.join(parts)}." if parts else ""


def _if_frechet_ranked(table: Table) -> str:
    """Rows without merit that plain FMD would put above real motion: why it does not rank."""
    column = next((column for column in table.columns if column.metric == "fmd[stgcn-content]"), None)
    anchors = [row for row in table.of("anchors") if row.row.method.kind == "anchor"]
    real = next((row for row in anchors if row.row.method.name == "real-disjoint"), None)
    if column is None or real is None:
        return ""
    limit = badness(real.row, column.metric, column.slice)
    idle = [row for row in anchors if not is_one_of(row.row.method.name, CEILING_ROWS)]
    better = [row for row in idle if badness(row.row, column.metric, column.slice) < limit]
    if not better:
        return ""
    named = ", ".join(f"{escape_markdown(row.title)} {_value(column, row)}" for row in better)
    return (
        f"**If {column.title} ranked**, these would beat {escape_markdown(real.title)} {_value(column, real)}: {named}."
    )


def _names(rows: Sequence[TableRow]) -> str:
    return ", ".join(escape_markdown(row.title) for row in rows)


def _value(column: Column, row: TableRow) -> str:
    found = row.estimates.get(column.key)
    if found is None or found.value is None:
        return "undefined"
    return number(found.value, column.unit) + (" %" if column.unit == "%" else "")
