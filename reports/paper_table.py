"""A table of a paper beside our records: what it prints, what we measure, and whether the two may be compared."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import pandas as pd
from tabulate import tabulate

from reports.aggregate import Estimate
from reports.formatting import (
    ARROWS,
    UNDEFINED,
    escape_latex,
    escape_markdown,
    footnote_mark,
    number,
    one_line,
    with_interval,
)
from reports.records import Better
from reports.render import environment, latex_cell, latex_notes

PaperForm = Literal["text", "md", "latex", "csv", "html"]
FORMS: tuple[PaperForm, ...] = ("text", "md", "latex", "csv", "html")
PAPER_ROWS, OWN_ROWS = "Rows of the paper", "Rows that the paper does not have"


@dataclass(frozen=True)
class PaperColumn:
    """A quantity of the paper's table.

    Attributes
    ----------
    name : as printed in the paper.
    metric, slice : our number for it; empty where there is none.
    unit, better : of our number, or of the paper's where there is none of ours.
    printed_unit : of the printed number.
    """

    name: str
    metric: str
    slice: str
    unit: str
    better: Better
    printed_unit: str

    @property
    def title(self) -> str:
        """Name, our unit and the good direction."""
        return f"{self.name.replace('_', ' ')}{_after(self.unit)} {ARROWS[self.better]}".strip()

    @property
    def printed_title(self) -> str:
        """Name and unit in the paper."""
        return f"{self.name.replace('_', ' ')}{_after(self.printed_unit)} {ARROWS[self.better]}".strip()


@dataclass(frozen=True)
class PaperCell:
    """One quantity of one row.

    Attributes
    ----------
    printed : as the paper prints it, spread included; empty where it prints none.
    published : the printed number in our unit; None for lists, bounds and missing numbers.
    ours : our number, None where there is none, and then ``gap`` says why.
    comparable : whether a difference says anything; if not, ``why`` says what stands against it.
    best : separably better than every other method's number in the column.
    """

    printed: str = ""
    published: float | None = None
    ours: Estimate | None = None
    gap: str = ""
    comparable: bool = False
    why: str = ""
    best: bool = False

    @property
    def difference(self) -> float | None:
        """Ours minus published, in our unit."""
        if self.published is None or self.ours is None or self.ours.value is None:
            return None
        return self.ours.value - self.published


@dataclass(frozen=True)
class PaperRow:
    """A row: its name in the paper (empty if it is ours alone), our name, title and marks, and a cell a column."""

    printed: str
    method: str
    title: str
    marks: tuple[str, ...]
    cells: Mapping[str, PaperCell]

    @property
    def label(self) -> str:
        """What tables print: the paper's name for the row, and ours where it differs."""
        if not self.printed:
            return self.title
        return self.printed if self.title in ("", self.printed) else f"{self.printed} = {self.title}"


@dataclass(frozen=True)
class PaperTable:
    """One table of a paper on one dataset.

    Attributes
    ----------
    orders : for each measured column, in words, which methods are separable and in which order.
    facts : judges, data, n, budget and hardware behind our numbers.
    """

    table_id: str
    title: str
    dataset: str
    columns: tuple[PaperColumn, ...]
    rows: tuple[PaperRow, ...]
    orders: tuple[str, ...]
    facts: tuple[str, ...]


def _after(unit: str) -> str:
    return "" if unit in ("1", "distance", "count", "joints", "") else f", {unit}"


def render_paper_table(table: PaperTable, form: PaperForm) -> str:
    """The table in one of the formats; CSV has a line a cell and unrounded numbers."""
    return {"text": _text, "md": _markdown, "latex": _latex, "csv": _csv, "html": _html}[form](table)


def _lines(table: PaperTable, bold: tuple[str, str]) -> tuple[list[str], list[tuple[str, list[list[str]]]], list[str]]:
    """Headers, cells by section, and footnotes; nothing is escaped but what ``bold`` puts around the best."""
    notes: list[str] = []
    compared = {
        column.name: any(_is_compared(row.cells[column.name]) for row in table.rows) for column in table.columns
    }
    headers = ["row"]
    for column in table.columns:
        headers += [f"{column.printed_title} published", f"{column.title} ours"]
        headers += ["difference"] if compared[column.name] else []
    groups = []
    for section, rows in _sections(table):
        lines = []
        for row in rows:
            line = [row.label + (f" ({', '.join(row.marks)})" if row.marks else "")]
            for column in table.columns:
                line += _cell(row.cells[column.name], column, compared[column.name], bold, notes)
            lines.append(line)
        groups.append((section, lines))
    return headers, groups, notes


def _sections(table: PaperTable) -> list[tuple[str, list[PaperRow]]]:
    parts = [
        (PAPER_ROWS, [row for row in table.rows if row.printed]),
        (OWN_ROWS, [row for row in table.rows if not row.printed]),
    ]
    return [(section, rows) for section, rows in parts if rows]


def _is_compared(cell: PaperCell) -> bool:
    return cell.comparable and cell.difference is not None


def _cell(cell: PaperCell, column: PaperColumn, compared: bool, bold: tuple[str, str], notes: list[str]) -> list[str]:
    published = cell.printed or UNDEFINED
    if cell.printed and not cell.comparable:
        published += _noted(f"not comparable: {cell.why}", notes)
    if cell.ours is None or cell.ours.value is None:
        reason = cell.gap or (cell.ours.reason if cell.ours else "") or "not measured"
        ours = UNDEFINED + _noted(one_line(reason), notes)
    else:
        ours = with_interval(cell.ours.value, cell.ours.low, cell.ours.high, column.unit)
        ours = f"{bold[0]}{ours}{bold[1]}" if cell.best else ours
        ours += _noted(one_line(cell.ours.reason), notes) if cell.ours.reason else ""
    if not compared:
        return [published, ours]
    shown = cell.difference if cell.comparable else None
    return [published, ours, UNDEFINED if shown is None else f"{'+' if shown > 0 else ''}{number(shown, column.unit)}"]


def _noted(reason: str, notes: list[str]) -> str:
    if reason not in notes:
        notes.append(reason)
    return f"[{footnote_mark(notes.index(reason))}]"


def _below(table: PaperTable, notes: Sequence[str]) -> list[str]:
    return [*(f"[{footnote_mark(place)}] {note}" for place, note in enumerate(notes)), *table.orders, *table.facts]


def _head(table: PaperTable) -> str:
    return f"{table.title} · {table.dataset or 'no records'}"


def _text(table: PaperTable) -> str:
    headers, groups, notes = _lines(table, ("*", "*"))
    blocks = [_head(table)]
    for section, lines in groups:
        grid = tabulate(lines, headers=headers, tablefmt="simple", disable_numparse=True, maxheadercolwidths=14)
        blocks.append(f"{section}\n{grid}")
    return "\n\n".join([*blocks, "\n".join(_below(table, notes))]) + "\n"


def _markdown(table: PaperTable) -> str:
    headers, groups, notes = _lines(table, ("**", "**"))
    blocks = [f"**{escape_markdown(_head(table))}**"]
    for section, lines in groups:
        escaped = [[escape_markdown(line[0]), *line[1:]] for line in lines]
        align = ["left", *["right"] * (len(headers) - 1)]
        blocks.append(
            f"*{section}*\n\n" + tabulate(escaped, headers, tablefmt="pipe", disable_numparse=True, colalign=align)
        )
    return "\n\n".join([*blocks, "<br>\n".join(escape_markdown(line) for line in _below(table, notes))]) + "\n"


def _latex(table: PaperTable) -> str:
    opened, closed = "\x01", "\x02"
    headers, groups, notes = _lines(table, (opened, closed))

    def line_of(cells: Sequence[str]) -> str:
        escaped = " & ".join(latex_cell(cell) for cell in cells) + r" \\"
        return escaped.replace(opened, r"\textbf{").replace(closed, "}")

    lines = [
        f"% {one_line(_head(table))}",
        f"\\begin{{tabular}}{{l{'r' * (len(headers) - 1)}}}",
        r"\toprule",
        line_of(headers),
    ]
    for section, rows in groups:
        title = f"\\multicolumn{{{len(headers)}}}{{l}}{{\\emph{{{escape_latex(section)}}}}} \\\\"
        lines += [r"\midrule", title, *(line_of(row) for row in rows)]
    lines += [r"\bottomrule", r"\end{tabular}", *latex_notes(_below(table, notes))]
    return "\n".join(lines) + "\n"


def _csv(table: PaperTable) -> str:
    lines = []
    for row in table.rows:
        for column in table.columns:
            cell = row.cells[column.name]
            ours = cell.ours
            lines.append(
                {
                    "table": table.table_id,
                    "dataset": table.dataset,
                    "row": row.printed,
                    "method": row.method,
                    "quantity": column.name,
                    "published": cell.printed,
                    "published_in_our_unit": cell.published,
                    "metric": column.metric,
                    "slice": column.slice,
                    "unit": column.unit,
                    "ours": ours.value if ours else None,
                    "low": ours.low if ours else None,
                    "high": ours.high if ours else None,
                    "n": ours.n if ours else None,
                    "seeds": ours.seeds if ours else None,
                    "difference": cell.difference,
                    "comparable": cell.comparable,
                    "why_not": "" if cell.comparable else cell.why,
                    "gap": cell.gap,
                    "best": cell.best,
                }
            )
    return pd.DataFrame(lines).to_csv(index=False, lineterminator="\n")


def _html(table: PaperTable) -> str:
    headers, groups, notes = _lines(table, ("", " (best)"))
    template = environment().get_template("table.html")
    return template.render(title=_head(table), headers=headers, groups=groups, notes=_below(table, notes))
