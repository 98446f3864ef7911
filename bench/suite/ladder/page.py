"""``docs/metrics/ladder.md`` and its figure, from stored numbers: the same numbers give the same bytes."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

from bench.errors import BadFile
from bench.suite.ladder.declared import BLIND_SPOTS, DECLARED, Claim
from bench.suite.ladder.rungs import LADDERS
from bench.suite.ladder.verdict import BLIND_UP_TO, IGNORES_UP_TO, MOVES_FROM, N_SD, cells_of
from reports.figures import save_figure
from reports.ladder import Cell, Rung, read_rungs
from reports.ladder_figure import ladder_figure
from reports.records import write_text_atomically

PAGE, FIGURE = "ladder.md", "ladder.png"
MARKS = {Claim.UP: "▲", Claim.DOWN: "▼", Claim.IGNORE: "=", Claim.BLIND: "blind", Claim.OPEN: ""}


def stored_rungs(folder: Path) -> dict[str, list[Rung]]:
    """Dataset -> its numbers, from the CSV files of a folder.

    Raises
    ------
    BadFile : there are none.
    """
    found = {}
    for path in sorted(folder.glob("*.csv")):
        rungs = read_rungs(path)
        found[rungs[0].dataset] = rungs
    if not found:
        raise BadFile(
            "no ladder numbers", where=str(folder), remedy="measure some: stylebench ladder --data procedural"
        )
    return found


def all_cells(stored: Mapping[str, Sequence[Rung]]) -> dict[str, list[Cell]]:
    """Dataset -> what every metric made of every ladder."""
    return {dataset: cells_of(rungs, DECLARED) for dataset, rungs in stored.items()}


def contradictions(cells: Mapping[str, Sequence[Cell]]) -> list[str]:
    """Cells that are not as declared, one line each."""
    return [
        f"{dataset}: {cell.metric} on {cell.ladder}: {cell.contradiction}"
        for dataset, found in cells.items()
        for cell in found
        if cell.contradiction
    ]


def write_page(folder: Path, stored: Mapping[str, Sequence[Rung]]) -> list[Path]:
    """Write page and figure; returns their paths."""
    page, figure = folder / PAGE, folder / FIGURE
    save_figure(ladder_figure(_panels(stored)), figure)
    write_text_atomically(page, render(stored))
    return [page, figure]


def difference(folder: Path, stored: Mapping[str, Sequence[Rung]]) -> str:
    """Empty if the page is what the numbers give and the figure is there, else what is wrong."""
    page, figure = folder / PAGE, folder / FIGURE
    if not figure.is_file():
        return f"{figure}: missing; write it with `stylebench ladder`"
    if not page.is_file() or page.read_text(encoding="utf-8") != render(stored):
        return f"{page}: differs from what the stored numbers give; write it again with `stylebench ladder`"
    return ""


def render(stored: Mapping[str, Sequence[Rung]]) -> str:
    """The page as Markdown."""
    cells = all_cells(stored)
    wrong = contradictions(cells)
    verdict = f"{len(wrong)} of them contradict it" if wrong else "no cell contradicts it"
    lines = [
        "# Metrics under test: the corruption ladder",
        "",
        "Written by `stylebench ladder` from the numbers in `reports/published/ladder`; do not edit. To measure them",
        "again: `stylebench ladder --data NAME=PATH`.",
        "",
        "Real windows of the test part are corrupted step by step and scored under their own labels by the canonical",
        "judges. For each metric and corruption it is declared which way the number must go, and what it must not see;",
        f"of {sum(len(found) for found in cells.values())} cells measured, **{verdict}**.",
        "",
        f"Measured: {_measured(stored)}.",
        "",
        *[f"- {line}" for line in wrong],
        "",
        f"![What metrics make of corrupted real motion]({FIGURE})",
        "",
        "## Blind spots",
        "",
        "What a metric should see and does not. Read it beside one that does.",
        "",
        *[line for spot in BLIND_SPOTS for line in (f"- **{spot.title}.** {spot.words}",)],
        "",
        "## Ladders",
        "",
        "| ladder | what is done to each window | levels |",
        "|---|---|---|",
        *[
            f"| {ladder.name} | {ladder.summary} | {', '.join(f'{v:g}' for v in ladder.levels)} {ladder.unit} |"
            for ladder in LADDERS.values()
        ],
        "",
        "## What is declared",
        "",
        f"▲ rises, ▼ falls: at the last level by more than {MOVES_FROM:.0%} of the metric's range and by more than",
        f"{N_SD:g} bootstrap standard deviations, without a step back. =: must be ignored, changes by at most",
        f"{IGNORES_UP_TO:.1%} of its range. blind: the motion is worse, and the metric worsens by less than",
        f"{BLIND_UP_TO:.0%} of its range. Empty: nothing is promised.",
        "",
        "The range of a metric is the widest change that any ladder brings about. Percentages are counted on a",
        "straight scale. All others are counted on a logarithmic one, because swapped joints move a distance a hundred",
        "thousand times as far as another style does: log(1 + change / m) over log(1 + widest / m), with m the median",
        "change of all levels.",
        "",
        "| metric | " + " | ".join(LADDERS) + " |",
        "|---" * (len(LADDERS) + 1) + "|",
        *[
            f"| `{metric}` | " + " | ".join(MARKS[claims[ladder]] for ladder in LADDERS) + " |"
            for metric, claims in DECLARED.items()
        ],
    ]
    for dataset, rungs in stored.items():
        lines += ["", f"## {dataset}: values", "", *_values(rungs)]
    return "\n".join(lines) + "\n"


def _panels(stored: Mapping[str, Sequence[Rung]]) -> dict[str, list[Cell]]:
    return {f"{dataset}, {stored[dataset][0].samples} windows": cells for dataset, cells in all_cells(stored).items()}


def _measured(stored: Mapping[str, Sequence[Rung]]) -> str:
    return "; ".join(f"{dataset}, {rungs[0].samples} windows a level" for dataset, rungs in stored.items())


def _values(rungs: Sequence[Rung]) -> list[str]:
    """Real motion and the last level of every ladder."""
    found = {(rung.metric, rung.ladder, rung.level): rung.value for rung in rungs}
    ladders = list(dict.fromkeys(rung.ladder for rung in rungs))
    last = {name: max(rung.level for rung in rungs if rung.ladder == name) for name in ladders}
    head = [f"{name} {last[name]:g}" for name in ladders]
    return [
        "| metric | real | " + " | ".join(head) + " |",
        "|---" * (len(ladders) + 2) + "|",
        *[
            f"| `{metric}` | "
            + " | ".join(
                _shown(found[metric, ladder, level])
                for ladder, level in [(ladders[0], 0.0), *((name, last[name]) for name in ladders)]
            )
            + " |"
            for metric in dict.fromkeys(rung.metric for rung in rungs)
        ],
    ]


def _shown(value: float) -> str:
    return "–" if value != value else f"{value:.3g}"
