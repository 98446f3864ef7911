"""One folder that opens from disk in any browser: tables that sort, interactive plots, and a player of the motions.

Nothing is fetched from anywhere; every name from outside is text, never markup.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import plotly
from numpy.typing import NDArray

from reports.formatting import one_line
from reports.plots import Plot
from reports.records import write_text_atomically
from reports.render import environment, to_html
from reports.tables import Table

ASSETS = Path(__file__).with_name("page_assets")
MILLIMETRES = 1000.0
FARTHEST_MM = 32_000.0


@dataclass(frozen=True, eq=False)
class Body:
    """One row of the player.

    Attributes
    ----------
    title : as shown.
    positions_m : a motion a sample, ``[T, J, 3]``; the style reference's length may differ from the others'.
    contacts : ``[T, feet]`` for each of them.
    scores : per-sample metric -> ``[samples]``; NaN where undefined.
    """

    title: str
    positions_m: Sequence[NDArray[np.float64]]
    contacts: Sequence[NDArray[np.bool_]]
    scores: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class PlayerTable:
    """Motions of some samples of one table.

    Attributes
    ----------
    name : file name without suffix. title : as shown.
    fps : frames per second. parents : of each joint, -1 for the root.
    sides : ``left``, ``right`` or ``middle`` of each joint. hands, feet, head : joints.
    samples : id and what was asked, in words.
    bodies : name -> row; the source is called ``content``, the reference ``style``.
    better : per-sample metric -> ``higher`` or ``lower``.
    """

    name: str
    title: str
    fps: float
    parents: Sequence[int]
    sides: Sequence[str]
    hands: Sequence[int]
    feet: Sequence[int]
    head: int
    samples: Sequence[tuple[str, str]]
    bodies: Mapping[str, Body]
    better: Mapping[str, str]


@dataclass(frozen=True)
class Section:
    """A part of the page."""

    anchor: str
    title: str
    text: tuple[str, ...] = ()
    tables: tuple[str, ...] = ()
    plots: tuple[Plot, ...] = ()


def table_section(tables: Sequence[Table]) -> Section:
    """All tables of a run, main columns and details."""
    shown = [to_html(table) + (to_html(table, "details") if table.columns_of("details") else "") for table in tables]
    return Section("tables", "Tables", ("Click a column's title to sort by it.",), tuple(shown))


def write_page(
    folder: Path, title: str, subtitle: str, sections: Sequence[Section], players: Sequence[PlayerTable]
) -> Path:
    """Write ``index.html`` and what it needs into a folder; returns the page."""
    page = environment().get_template("page.html").render(
        title=one_line(title), subtitle=one_line(subtitle), sections=_safe(sections),
        player_tables=[(player.name, player.title) for player in players],
    )  # fmt: skip
    write_text_atomically(folder / "index.html", page)
    for asset in ("page.css", "page.js", "player.js"):
        write_text_atomically(folder / asset, (ASSETS / asset).read_text(encoding="utf-8"))
    write_text_atomically(folder / "plotly.min.js", plotly.offline.get_plotlyjs())
    for player in players:
        call = f"stylebench.load({script_json(player.name)}, {script_json(_player_data(player))});\n"
        write_text_atomically(folder / "data" / f"{player.name}.js", call)
    return folder / "index.html"


def _safe(sections: Sequence[Section]) -> list[dict[str, Any]]:
    """Tables and figures were escaped where they were made; everything else is escaped by the template."""
    from markupsafe import Markup

    return [
        {
            "anchor": section.anchor,
            "title": section.title,
            "text": section.text,
            "tables": [Markup(table) for table in section.tables],
            "plots": [
                {"anchor": plot.anchor, "title": plot.title, "json": Markup(plot.json)} for plot in section.plots
            ],
        }
        for section in sections
    ]


def _player_data(player: PlayerTable) -> dict[str, Any]:
    return {
        "fps": player.fps,
        "parents": list(player.parents),
        "sides": list(player.sides),
        "hands": list(player.hands),
        "feet": list(player.feet),
        "head": player.head,
        "better": dict(player.better),
        "samples": [{"id": one_line(name), "said": one_line(said)} for name, said in player.samples],
        "motions": {
            name: {
                "title": one_line(body.title),
                "positions": [_positions(positions) for positions in body.positions_m],
                "contacts": [_bits(contacts) for contacts in body.contacts],
                "scores": {metric: _numbers(values) for metric, values in body.scores.items()},
            }
            for name, body in player.bodies.items()
        },
    }


def _positions(positions_m: NDArray[np.float64]) -> str:
    """Whole millimetres from the first frame's place on the ground, 16 bits each."""
    placed = positions_m - positions_m[:1, :1] * np.array([1.0, 0.0, 1.0])
    whole = np.clip(np.rint(placed * MILLIMETRES), -FARTHEST_MM, FARTHEST_MM).astype("<i2")
    return base64.b64encode(whole.tobytes()).decode("ascii")


def _bits(contacts: NDArray[np.bool_]) -> str:
    weights = 1 << np.arange(contacts.shape[1])
    return base64.b64encode((contacts * weights).sum(axis=1).astype(np.uint8).tobytes()).decode("ascii")


def _numbers(values: NDArray[np.float64]) -> list[float | None]:
    return [float(f"{value:.5g}") if np.isfinite(value) else None for value in values]


def body_data(body: Body, sample: int, title: str) -> dict[str, str]:
    """One motion of a body under another title."""
    return {"title": title, "positions": _positions(body.positions_m[sample])}


def script_json(value: Any) -> str:
    """JSON that may stand in a script: no ``</script>`` and no line separators."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    for sign in "<>&\u2028\u2029":
        text = text.replace(sign, f"\\u{ord(sign):04x}")
    return text
