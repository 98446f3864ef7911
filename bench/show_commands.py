"""``stylebench movie``, ``study`` and ``study-score``: motions of a run for a talk, and for people to judge."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bench import console
from bench.command_options import STORE, names_of
from bench.errors import BadConfig

if TYPE_CHECKING:
    from collections.abc import Collection

    from reports.page import PlayerTable

RunFolder = Annotated[Path, typer.Argument(help="A run folder.")]
RowsOption = Annotated[str, typer.Option(help="Comma-separated methods.")]
TableOption = Annotated[str, typer.Option(help="Start of the table's file name, where a run has several.")]
StoreOption = Annotated[Path, typer.Option(help="The store of the run.")]


def movie(
    run_folder: RunFolder,
    rows: RowsOption,
    sample: Annotated[str, typer.Option(help="Sample id; several for a sheet, comma-separated.")] = "s0000",
    out: Annotated[
        Path, typer.Option(help="A .gif, an .mp4 where ffmpeg is installed; .png, .pdf or .svg is a sheet of poses.")
    ] = Path("movie.gif"),
    table: TableOption = "",
    store: StoreOption = STORE,
) -> None:
    """Write source, style reference and some rows side by side as a GIF or MP4, or pose by pose as a picture.

    Example: stylebench movie runs/latest --rows copy-content,style-mean-shift --sample s0003
    """
    from reports.movie import SHEET_FORMS, write_movie, write_sheet

    names, samples = names_of(rows), names_of(sample)
    player = _player(run_folder, store, table, names, samples)
    if len(player.samples) < len(samples):
        there = ", ".join(sample_id for sample_id, _ in _player(run_folder, store, table, names, ()).samples)
        missing = sorted(set(samples) - {sample_id for sample_id, _ in player.samples})
        raise BadConfig(f"no sample {', '.join(missing)}", where="--sample", remedy=f"for example {there}")
    bodies = ["content", "style", *(["truth"] if "truth" in player.bodies else []), *names]
    if out.suffix.lower() in SHEET_FORMS:
        write_sheet(player, range(len(samples)), bodies, out)
    else:
        write_movie(player, 0, bodies, out)
    console.say(f"wrote {out}")


def study(
    run_folder: RunFolder,
    rows: RowsOption,
    trials: Annotated[int, typer.Option(min=1, help="Pairs of clips.")] = 20,
    seed: Annotated[int, typer.Option(help="Draws samples, sides and order.")] = 0,
    out: Annotated[Path, typer.Option(help="A new folder.")] = Path("study"),
    table: TableOption = "",
    store: StoreOption = STORE,
) -> None:
    """Write a page on which people compare rows, and the key that says which clip is whose.

    Example: stylebench study runs/latest --rows copy-content,style-mean-shift --trials 12 --out study
    """
    from reports.study import KEY_FILE, write_study

    player = _player(run_folder, store, table, names_of(rows), ())
    page = write_study(out, player, names_of(rows), trials, seed)
    console.say(f"give participants the folder {out} without {KEY_FILE}; they open {page.name} and save their answers")


def study_score(
    folder: Annotated[Path, typer.Argument(help="The folder that has the key.")],
    answers: Annotated[list[Path], typer.Argument(help="Saved answers, one CSV a participant.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """How often one row was preferred to another, by question, with exact 95 % intervals.

    Example: stylebench study-score study answers-*.csv
    """
    from reports.study import score_study

    found = score_study(folder, answers)
    headers = ["question", "row", "preferred to", "share", "95 %", "answers", "p"]
    lines = [
        [
            item.question, item.row, item.other, f"{100 * item.share:.0f} %",
            f"{100 * item.low:.0f} to {100 * item.high:.0f} %", str(item.answers), f"{item.p:.2g}",
        ]
        for item in found
    ]  # fmt: skip
    if as_json:
        console.say_json([dict(zip(headers, line, strict=True)) for line in lines])
    else:
        console.show_rows(headers, lines)


def _player(
    run_folder: Path, store: Path, table: str, names: Collection[str], sample_ids: Collection[str]
) -> PlayerTable:
    from bench.suite.output import stem_of
    from bench.suite.page import player_of
    from bench.suite.store import Store
    from bench.suite.trust import motions_folders
    from reports.tables import tables_of_run

    kept = Store(store.absolute())
    folders = motions_folders(kept)
    for found in tables_of_run(run_folder):
        rows = {row.row.method.row_name for row in found.rows if row.row.ok}
        if stem_of(found.key).startswith(table) and set(names) <= rows:
            player = player_of(run_folder, found, kept, folders, names=names, sample_ids=sample_ids)
            if player is not None and set(names) <= set(player.bodies):
                return player
    raise BadConfig(
        f"no table of the run has motions of all of {', '.join(names)}",
        where=str(run_folder),
        remedy="check --rows, and give the run's own --store",
    )
