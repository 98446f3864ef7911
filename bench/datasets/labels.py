"""Labels of a folder of motion files: from ``labels.csv``, or from file names by a pattern."""

from __future__ import annotations

import csv
import re
from collections.abc import Iterable, Sequence
from pathlib import Path

from bench.datasets.bvh_files import LabelledFile
from bench.errors import BadConfig, BadData

LABELS_CSV = "labels.csv"
NEEDED, OPTIONAL = ("file", "content", "style"), ("actor", "session")
FIELDS = ("content", "style", "actor", "session", "any")


def labels_from_csv(path: Path, places: Sequence[str]) -> list[LabelledFile]:
    """Rows of a table with columns file, content, style and perhaps actor, session.

    Raises
    ------
    BadData : a column or label is missing, a file is not there or named twice; the message starts with ``file:line``.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise BadData(f"cannot be read ({error})", where=str(path), remedy="save it as UTF-8") from error
    reader = csv.DictReader(text.splitlines())
    columns = [str(name).strip().lower() for name in reader.fieldnames or ()]
    missing = [name for name in NEEDED if name not in columns]
    if missing:
        raise BadData(
            f"lacks the column {', '.join(missing)}; it has {', '.join(columns) or 'nothing'}",
            where=f"{path}:1",
            remedy=f"the first line must name the columns {', '.join(NEEDED)}, and perhaps {', '.join(OPTIONAL)}",
        )
    reader.fieldnames = columns
    known, found = set(places), {}
    for row in reader:
        where = f"{path}:{reader.line_num}"
        values = {name: (row.get(name) or "").strip() for name in (*NEEDED, *OPTIONAL)}
        empty = [name for name in NEEDED if not values[name]]
        if empty:
            raise BadData(f"no {', '.join(empty)} in this row", where=where, remedy="fill it in, or remove the row")
        place = _place(values["file"], known)
        if place is None:
            raise BadData(f"there is no file {values['file']}", where=where, remedy="give its path inside the folder")
        if place in found:
            raise BadData(f"{place} is labelled twice", where=where, remedy="keep one row a file")
        found[place] = LabelledFile(
            place, values["content"], values["style"], values["actor"] or None, values["session"] or None
        )
    if not found:
        raise BadData("has no row", where=str(path), remedy="write one row a file")
    return [found[place] for place in sorted(found)]


def _place(file: str, known: set[str]) -> str | None:
    place = file.replace("\\", "/").removeprefix("./")
    return next((name for name in (place, f"{place}.bvh") if name in known), None)


def labels_from_pattern(pattern: str, places: Iterable[str]) -> tuple[list[LabelledFile], list[str]]:
    """Files whose path inside the folder fits ``{style}/{content}_{any}``, and those whose does not.

    A field holds anything but slashes and is as short as what follows allows.

    Raises
    ------
    BadConfig : unknown fields, or one of content and style is missing.
    """
    expression = _expression(pattern)
    labelled: list[LabelledFile] = []
    others: list[str] = []
    for place in places:
        found = expression.fullmatch(place[: -len(".bvh")])
        if found is None:
            others.append(place)
            continue
        values = found.groupdict()
        labelled.append(
            LabelledFile(place, values["content"], values["style"], values.get("actor"), values.get("session"))
        )
    return labelled, others


def _expression(pattern: str) -> re.Pattern[str]:
    parts = re.split(r"\{([^{}]*)\}", pattern.removesuffix(".bvh"))
    fields = parts[1::2]
    named = [field for field in fields if field != "any"]
    wrong = sorted(set(fields) - set(FIELDS))
    if wrong or len(set(named)) != len(named) or not {"content", "style"} <= set(named):
        raise BadConfig(
            f"a pattern must hold {{content}} and {{style}} once and may hold {{actor}}, {{session}}, {{any}}, "
            f"got {pattern!r}",
            where="pattern",
            remedy="for example {content}_{style}_{any}",
        )
    text = "".join(
        re.escape(part) if index % 2 == 0 else "[^/]+?" if part == "any" else f"(?P<{part}>[^/]+?)"
        for index, part in enumerate(parts)
    )
    return re.compile(text)
