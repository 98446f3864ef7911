"""Tables as text: data frames of cells, Markdown, plain text, CSV, LaTeX (booktabs) and HTML."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from textwrap import wrap
from typing import Literal

import jinja2
import pandas as pd
from tabulate import tabulate

from reports.aggregate import Estimate
from reports.columns import Part
from reports.context import anchor_meanings, context
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
from reports.tables import SECTION_TITLES, Column, Section, Table, TableRow

Format = Literal["text", "md", "csv", "latex", "html"]
TEMPLATES = Path(__file__).with_name("templates")
FLOOR_TITLE = "floor: real against real"
TEXT_HEADER_COLUMNS = 12


def render(table: Table, form: Format, part: Part = "main") -> str:
    """The table in one of the formats; CSV holds all columns and unrounded numbers, whatever ``part``."""
    makers: dict[Format, Callable[[Table, Part], str]] = {
        "text": to_text,
        "md": to_markdown,
        "csv": lambda table, part: to_csv(table),
        "latex": to_latex,
        "html": to_html,
    }
    return makers[form](table, part)


def text_frame(table: Table, part: Part = "main") -> tuple[pd.DataFrame, tuple[str, ...]]:
    """Cells as plain text, one line per row of the table in its order, and the footnotes they point to.

    Columns: rank, row, the columns of ``part`` by their headers, n of the primary column, notes. An undefined cell is
    ``–[a]`` and footnote a says why; ``84.7[b]`` carries a warning; a warning all cells of a column share stands at
    its header. Nothing is escaped.
    """
    reasons: list[str] = []
    shared = {column.key: _shared_reason(table, column) for column in table.columns_of(part)}
    headers = [column.header + _mark(shared[column.key], reasons) for column in table.columns_of(part)]
    lines = [
        [_rank_text(row), row.title, *_cells(table, part, row, shared, reasons), _n_text(table, row), _notes(row)]
        for row in table.rows
    ]
    notes = tuple(f"[{footnote_mark(place)}] {reason}" for place, reason in enumerate(reasons))
    return pd.DataFrame(lines, columns=pd.Index(["rank", "row", *headers, "n", "notes"]), dtype=str), notes


def _shared_reason(table: Table, column: Column) -> str | None:
    """The warning that every value of a column carries, None if they do not all carry the same one."""
    found = [row.estimates.get(column.key) for row in table.rows if row.section != "unfinished"]
    reasons = {one_line(item.reason) if item is not None and item.reason else "" for item in found}
    if len(found) < 2 or len(reasons) != 1 or any(item is None or item.value is None for item in found):
        return None
    return reasons.pop() or None


def _mark(reason: str | None, reasons: list[str]) -> str:
    """The footnote mark of a reason, which is added to ``reasons`` if it is new; empty without a reason."""
    if not reason:
        return ""
    if reason not in reasons:
        reasons.append(reason)
    return f"[{footnote_mark(reasons.index(reason))}]"


def _n_text(table: Table, row: TableRow) -> str:
    found = row.estimates.get(table.primary.key) if table.primary else None
    return UNDEFINED if found is None else str(found.n)


def _rank_text(row: TableRow) -> str:
    return "" if row.rank is None else str(row.rank)


def _cells(table: Table, part: Part, row: TableRow, shared: Mapping[str, str | None], reasons: list[str]) -> list[str]:
    if row.section == "unfinished":
        return [UNDEFINED for _ in table.columns_of(part)]
    return [
        cell_text(column, row.estimates.get(column.key), reasons, at_header=shared[column.key])
        for column in table.columns_of(part)
    ]


def cell_text(column: Column, found: Estimate | None, reasons: list[str], at_header: str | None = None) -> str:
    """One cell; its reason or warning, if any and not ``at_header``, goes to ``reasons`` and its mark to the cell."""
    reason = "not measured in this record" if found is None else one_line(found.reason or "")
    text = UNDEFINED
    if found is not None and found.value is not None:
        bounds = (found.low, found.high) if column.interval else (None, None)
        text = with_interval(found.value, *bounds, column.unit)
    return text if reason == at_header else text + _mark(reason, reasons)


def _notes(row: TableRow) -> str:
    notes = ", ".join(row.marks)
    if not row.row.reason:
        return notes
    log = row.row.stored[0].record.log if row.section == "unfinished" else ""
    return f"{notes}: {one_line(row.row.reason)}" + (f" ({log})" if log else "")


def floor_cells(table: Table, part: Part = "main") -> list[str] | None:
    """Real against real at the same n for each column of ``part`` (``–`` where it means nothing); None if none has one.

    Floors are a property of data, judge and n; where rows state different ones, the range is shown.
    """
    cells = []
    for column in table.columns_of(part):
        found = [row.estimates[column.key].floor for row in table.rows if column.key in row.estimates]
        known = [floor for floor in found if floor is not None]
        ends = sorted({number(floor, column.unit) for floor in (min(known), max(known))}) if known else [UNDEFINED]
        cells.append(" to ".join(ends))
    return None if all(cell == UNDEFINED for cell in cells) else cells


def number_frame(table: Table) -> pd.DataFrame:
    """Unrounded numbers for scripts: a line per row; per column value, low, high, n, sd over seeds, floor."""
    lines: list[dict[str, object]] = []
    for row in table.rows:
        line: dict[str, object] = {
            "section": row.section,
            "rank": row.rank,
            "method": row.row.method.row_name,
            "title": row.title,
            "status": row.row.status,
            "marks": ";".join(row.marks),
            "reason": row.row.reason,
        }
        for column in table.columns:
            found = row.estimates.get(column.key)
            for field in ("value", "low", "high", "n", "seed_sd", "floor"):
                name = column.key if field == "value" else f"{column.key}.{field}"
                line[name] = None if found is None else getattr(found, field)
        lines.append(line)
    frame = pd.DataFrame(lines)
    frame["rank"] = frame["rank"].astype("Int64")
    return frame


def sections(table: Table, part: Part = "main") -> tuple[list[tuple[Section, pd.DataFrame]], tuple[str, ...]]:
    """Frames of cells by section, empty sections left out, and the footnotes of them all.

    The floors are the last line of the anchors (of the methods, where there are no anchors). Only methods have a rank.
    What did not finish is told in the main part only.
    """
    frame, notes = text_frame(table, part)
    floors = floor_cells(table, part)
    found: list[tuple[Section, pd.DataFrame]] = []
    for section in SECTION_TITLES:
        inside = [row.section == section for row in table.rows]
        if any(inside) and (part == "main" or section != "unfinished"):
            found.append((section, frame[inside].reset_index(drop=True)))
    if floors is not None and found:
        place = max((at for at, (section, _) in enumerate(found) if section != "unfinished"), default=0)
        section, chosen = found[place]
        line = pd.DataFrame([["", FLOOR_TITLE, *floors, "", ""]], columns=chosen.columns)
        found[place] = (section, pd.concat([chosen, line], ignore_index=True))
    return [(section, _without_empty_rank(section, chosen)) for section, chosen in found], notes


def _without_empty_rank(section: Section, frame: pd.DataFrame) -> pd.DataFrame:
    if section == "unfinished":
        return frame[["row", "notes"]]
    return frame if section == "methods" else frame.drop(columns="rank")


def _alignments(names: Sequence[str]) -> list[str]:
    return ["left" if name in ("row", "notes") else "right" for name in names]


def _tabulated(frame: pd.DataFrame, style: str, escape: Callable[[str], str]) -> str:
    # Numbers stay readable in the source: only names and notes can hold characters that mean something.
    words = [name in ("row", "notes") for name in frame.columns]
    lines = [
        [escape(str(cell)) if word else str(cell) for cell, word in zip(line, words, strict=True)]
        for line in frame.itertuples(index=False)
    ]
    headers = [str(name) for name in frame.columns]
    return tabulate(lines, headers=headers, tablefmt=style, disable_numparse=True, colalign=_alignments(headers))


def to_markdown(table: Table, part: Part = "main") -> str:
    """Pipe tables, one per section, with their titles in bold; footnotes and context below."""
    found, notes = sections(table, part)
    blocks = [
        f"**{SECTION_TITLES[section]}**\n\n{_tabulated(frame, 'pipe', escape_markdown)}" for section, frame in found
    ]
    below = [*notes, *(context(table) if part == "main" else ())]
    if below:
        blocks.append("<br>\n".join(escape_markdown(note) for note in below))
    return "\n\n".join(blocks) + "\n"


def to_text(table: Table, part: Part = "main") -> str:
    """Plain text for a terminal or a log: one grid, headers on several lines, what to know below."""
    found, notes = sections(table, part)
    grids = [(section, frame) for section, frame in found if section != "unfinished"]
    failed = [frame for section, frame in found if section == "unfinished"]
    below = [*notes, *(context(table) if part == "main" else ())]
    blocks = [table.title]
    blocks += [_text_grid(grids)] if grids else []
    blocks += [_text_list(SECTION_TITLES["unfinished"], frame.to_numpy().tolist()) for frame in failed]
    blocks += ["\n".join(below)] if below else []
    meanings = [(title, _with_source(words, source)) for title, words, source in anchor_meanings([table])]
    blocks += [_text_list("What the anchor rows are", meanings)] if meanings and part == "main" else []
    return "\n\n".join(blocks) + "\n"


def _text_grid(grids: Sequence[tuple[Section, pd.DataFrame]]) -> str:
    """All sections in one grid, so that their columns stand below each other."""
    names = list(dict.fromkeys(["rank", *grids[0][1].columns]))
    lines = [
        [one_line(str(cell)) for cell in line]
        for _, frame in grids
        for line in frame.reindex(columns=names, fill_value="").itertuples(index=False)
    ]
    headers = [_text_header(name) for name in names]
    alignments = _alignments(names)
    grid = tabulate(lines, headers, "simple", disable_numparse=True, colalign=alignments, headersglobalalign="left")
    drawn = [line.rstrip() for line in grid.splitlines()]
    head, body = drawn[: -len(lines)], drawn[-len(lines) :]
    for section, frame in grids:
        head += [*([""] if section != grids[0][0] else []), SECTION_TITLES[section], *body[: len(frame)]]
        body = body[len(frame) :]
    return "\n".join(head)


def _text_header(name: str) -> str:
    # Unit and direction stay together: wrap() does not break at a no-break space.
    bound = re.sub(f" (?=[{''.join(ARROWS.values())}])", "\N{NO-BREAK SPACE}", name)
    return "\n".join(wrap(bound, TEXT_HEADER_COLUMNS)).replace("\N{NO-BREAK SPACE}", " ")


def _text_list(title: str, items: Sequence[Sequence[str]]) -> str:
    width = max(len(one_line(name)) for name, _ in items)
    return "\n".join([title, *(f"  {one_line(name):{width}}  {one_line(words)}".rstrip() for name, words in items)])


def _with_source(words: str, source: str) -> str:
    return f"{words} (from {source})" if source else words


def anchor_table(tables: Sequence[Table]) -> str:
    """What every anchor row of the tables is, each once, as a Markdown table; empty without anchors."""
    lines = [[escape_markdown(cell) or UNDEFINED for cell in line] for line in anchor_meanings(tables)]
    headers = ["row", "what it is", "draws from"]
    return tabulate(lines, headers=headers, tablefmt="pipe", disable_numparse=True) if lines else ""


def to_csv(table: Table) -> str:
    """:func:`number_frame` as CSV."""
    return number_frame(table).to_csv(index=False, lineterminator="\n")


def to_latex(table: Table, part: Part = "main") -> str:
    """A booktabs ``tabular``; sections are parted by rules, footnotes follow in a ``flushleft`` block.

    Needs ``\\usepackage{booktabs}``.
    """
    found, notes = sections(table, part)
    headers = list(text_frame(table, part)[0].columns)
    form = "".join("l" if name in ("row", "notes") else "r" for name in headers)
    lines = [f"\\begin{{tabular}}{{{form}}}", r"\toprule", _latex_line(headers)]
    for section, frame in found:
        title = f"\\multicolumn{{{len(headers)}}}{{l}}{{\\emph{{{escape_latex(SECTION_TITLES[section])}}}}} \\\\"
        lines += [r"\midrule", title]
        whole = frame.reindex(columns=headers, fill_value="")
        lines += [_latex_line([str(cell) for cell in line]) for line in whole.itertuples(index=False)]
    lines += [r"\bottomrule", r"\end{tabular}"]
    return "\n".join([*lines, *latex_notes(notes)]) + "\n"


def latex_notes(notes: Sequence[str]) -> list[str]:
    """Lines of a block of footnotes; empty without notes."""
    if not notes:
        return []
    lines = [latex_cell(note) + r"\\" for note in notes]
    return [r"\begin{flushleft}\footnotesize", *lines, r"\end{flushleft}"]


def latex_cell(text: str) -> str:
    """Text that LaTeX prints as it is, also at the start of a line of a table."""
    # What starts with a bracket would be read as the optional argument of the line break before it.
    return ("{}" if text.startswith("[") else "") + escape_latex(text)


def _latex_line(cells: Sequence[str]) -> str:
    return " & ".join(latex_cell(cell) for cell in cells) + r" \\"


def to_html(table: Table, part: Part = "main") -> str:
    """A ``<table>`` element with sections as row groups and the footnotes below; style is left to the page."""
    found, notes = sections(table, part)
    headers = list(text_frame(table, part)[0].columns)
    groups = [
        (SECTION_TITLES[section], frame.reindex(columns=headers, fill_value="").to_numpy().tolist())
        for section, frame in found
    ]
    template = environment().get_template("table.html")
    title = table.title if part == "main" else f"{table.title}: more columns"
    return template.render(title=title, headers=headers, groups=groups, notes=notes)


def environment() -> jinja2.Environment:
    """Templates of this package: HTML is escaped, an undefined name is an error."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=jinja2.select_autoescape(["html"]),
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
