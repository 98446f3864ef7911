"""Numbers and names as text: decimals that fit a unit, intervals, arrows, and escaping for Markdown and LaTeX."""

from __future__ import annotations

import math
import re

from reports.records import Better

UNDEFINED = "–"
ARROWS: dict[Better, str] = {"higher": "↑", "lower": "↓", "one": "→1", "none": ""}

_MARKDOWN = re.compile(r"([\\`*_{}\[\]<>|#~&])")
_LATEX = {
    "\\": r"\textbackslash{}",
    "&": r"\&",
    "%": r"\%",
    "$": r"\$",
    "#": r"\#",
    "_": r"\_",
    "{": r"\{",
    "}": r"\}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "<": r"\textless{}",
    ">": r"\textgreater{}",
    "|": r"\textbar{}",
    "–": "--",
    "—": "---",
    "±": r"$\pm$",
    "≥": r"$\geq$",
    "≤": r"$\leq$",
    "×": r"$\times$",
    "↑": r"$\uparrow$",
    "↓": r"$\downarrow$",
    "→": r"$\rightarrow$",
}


def decimals_for(value: float, unit: str) -> int:
    """Decimals of one number: 1 for percent, 0 for counts; else as many as show 3 digits, 2 for ratios, 4 at most."""
    if unit == "%":
        return 1
    if unit in ("count", "B"):
        return 0
    most = 2 if unit == "1" else 4
    if not math.isfinite(value) or value == 0.0:
        return 2
    return min(most, max(0, 2 - math.floor(math.log10(abs(value)))))


def number(value: float, unit: str, decimals: int | None = None) -> str:
    """A number with the decimals of its unit (or those given), without a negative zero."""
    places = decimals_for(value, unit) if decimals is None else decimals
    text = f"{value:.{places}f}"
    return f"{0.0:.{places}f}" if float(text) == 0.0 else text


def with_interval(value: float, low: float | None, high: float | None, unit: str) -> str:
    """``84.7 [82.9, 86.4]``, or the value alone where there is no interval; the ends have the value's decimals."""
    if low is None or high is None:
        return number(value, unit)
    # A value next to zero says nothing about the digits its interval needs.
    places = decimals_for(max(abs(value), (high - low) / 2.0), unit)
    return f"{number(value, unit, places)} [{number(low, unit, places)}, {number(high, unit, places)}]"


def one_line(text: str) -> str:
    """White space, line breaks included, folded to single blanks."""
    return " ".join(text.split())


def escape_markdown(text: str) -> str:
    """Text that Markdown prints as it is, also inside a pipe table."""
    return _MARKDOWN.sub(r"\\\1", one_line(text))


def escape_latex(text: str) -> str:
    """Text that LaTeX prints as it is."""
    return "".join(_LATEX.get(character, character) for character in one_line(text))


def footnote_mark(place: int) -> str:
    """``a``, ``b``, ... ``z``, ``aa``, ... for place 0, 1, ..."""
    letters = ""
    place += 1
    while place:
        place, rest = divmod(place - 1, 26)
        letters = chr(ord("a") + rest) + letters
    return letters


def duration(seconds: float) -> str:
    """``8 s``, ``3 min``, ``2.5 h``."""
    if seconds < 90.0:
        return f"{seconds:.0f} s" if seconds >= 1.0 else f"{seconds:.1g} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"


def count(value: int) -> str:
    """``4.3 M``, ``12 k``, ``311``."""
    for size, letter in ((1_000_000, "M"), (1_000, "k")):
        if value >= size:
            return f"{value / size:.1f} {letter}" if value < 10 * size else f"{value / size:.0f} {letter}"
    return str(value)
