"""Numbers that the five papers print, and whether ours may be laid beside them: ``published_numbers.csv``.

A row is one printed number. Most are not comparable, because evaluators, splits and weights were never released; each
row says so, and why.
"""

from __future__ import annotations

import csv
import math
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bench.errors import BadConfig, BadFile

PUBLISHED_CSV = Path(__file__).with_name("published_numbers.csv")


@dataclass(frozen=True)
class Published:
    """One number of a paper.

    Attributes
    ----------
    table_id : ``park2021.table1``; numbers from running text are in ``park2021.text``.
    paper, table : where it stands, in words.
    method, metric : row and column there.
    printed : as printed: trailing zeros, bounds (``>80``) and lists of joints kept.
    value : the number; None for bounds and lists.
    joints : the list of joints that Motion Puzzle's Table 1 prints instead of a number; empty elsewhere.
    sd : standard deviation beside it, None where there is none.
    unit : of ``value`` and ``sd``.
    condition : what was measured, as far as the paper says.
    our_method : name of the same row here; empty where it is no method.
    our_metric : name in METRICS of the same quantity; empty where there is none.
    our_slice : slice of that metric in records; after a colon the name in its details; empty where it is open.
    factor : ``value * factor`` is in the unit of ``our_metric``; None where no factor does it, or there is no metric.
    comparable : whether a difference to our number says anything.
    why : the reason; never empty where not comparable.
    """

    table_id: str
    paper: str
    table: str
    method: str
    metric: str
    printed: str
    value: float | None
    joints: tuple[int, ...]
    sd: float | None
    unit: str
    condition: str
    our_method: str
    our_metric: str
    our_slice: str
    factor: float | None
    comparable: bool
    why: str


FIELDS = (
    "table_id", "paper", "table", "method", "metric", "value", "sd", "unit", "condition", "our_method", "our_metric",
    "our_slice", "factor", "comparable", "why",
)  # fmt: skip
"""Columns of the file, in order."""


def published_numbers(table_id: str | None = None) -> tuple[Published, ...]:
    """Every published number, or those of one table, in the paper's order.

    Parameters
    ----------
    table_id : ``motion_puzzle.table2``; None for all.

    Raises
    ------
    BadConfig : no such table.
    """
    everything = _committed()
    if table_id is None:
        return everything
    rows = tuple(row for row in everything if row.table_id == table_id)
    if not rows:
        known = ", ".join(dict.fromkeys(row.table_id for row in everything))
        raise BadConfig(f"no published table is called {table_id!r}", where="table_id", remedy=f"one of {known}")
    return rows


def read_published_numbers(path: Path) -> tuple[Published, ...]:
    """Read a file of published numbers.

    Raises
    ------
    BadFile : missing, other columns, or a row that cannot be read; with ``file:line``.
    """
    try:
        with path.open(encoding="utf-8", newline="") as file:
            reader = csv.DictReader(file, strict=True)
            if tuple(reader.fieldnames or ()) != FIELDS:
                raise BadFile(f"columns must be {', '.join(FIELDS)}, got {reader.fieldnames}", where=f"{path}:1")
            return tuple(_published(row, f"{path}:{reader.line_num}") for row in reader)
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise BadFile(f"cannot read published numbers: {error}", where=str(path)) from error


@cache
def _committed() -> tuple[Published, ...]:
    return read_published_numbers(PUBLISHED_CSV)


def _published(row: dict[str, str], where: str) -> Published:
    if None in row or None in row.values():
        raise BadFile(f"a row must have {len(FIELDS)} columns", where=where, cause="a comma outside quotes")
    missing = [name for name in ("table_id", "paper", "table", "method", "metric", "value", "unit") if not row[name]]
    if missing:
        raise BadFile(f"{', '.join(missing)} must not be empty", where=where)
    if row["comparable"] not in ("yes", "no"):
        raise BadFile(f"comparable must be yes or no, got {row['comparable']!r}", where=where)
    if row["comparable"] == "no" and not row["why"]:
        raise BadFile("a number that is not comparable needs its reason in why", where=where)
    is_list = row["unit"] == "joints"
    return Published(
        table_id=row["table_id"],
        paper=row["paper"],
        table=row["table"],
        method=row["method"],
        metric=row["metric"],
        printed=row["value"],
        value=None if is_list or row["value"].startswith(">") else _number(row["value"], "value", where),
        joints=_joints(row["value"], where) if is_list else (),
        sd=_number(row["sd"], "sd", where) if row["sd"] else None,
        unit=row["unit"],
        condition=row["condition"],
        our_method=row["our_method"],
        our_metric=row["our_metric"],
        our_slice=row["our_slice"],
        factor=_number(row["factor"], "factor", where) if row["factor"] else None,
        comparable=row["comparable"] == "yes",
        why=row["why"],
    )


def _joints(text: str, where: str) -> tuple[int, ...]:
    if not all(joint.isdecimal() for joint in text.split()):
        raise BadFile(f"value must be a list of joints, got {text!r}", where=where)
    return tuple(int(joint) for joint in text.split())


def _number(text: str, name: str, where: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise BadFile(f"{name} must be a number, got {text!r}", where=where)
    return value
