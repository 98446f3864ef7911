"""``stylebench ladder`` and ``stylebench trust``: how far the numbers themselves can be trusted."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from bench import console
from bench.command_options import STORE, datasets_of


def ladder(
    data: Annotated[
        list[str] | None, typer.Option(help="Measure this dataset, NAME or NAME=PATH; default: use stored numbers.")
    ] = None,
    samples: Annotated[int, typer.Option(min=130, help="Windows a level.")] = 200,
    check: Annotated[bool, typer.Option("--check", help="Only compare; exit 1 on a difference.")] = False,
    numbers: Annotated[Path, typer.Option(help="Folder of stored numbers.")] = Path("reports/published/ladder"),
    docs: Annotated[Path, typer.Option(help="Folder of the page and its figure.")] = Path("docs/metrics"),
    store: Annotated[Path, typer.Option(help="Where finished work is kept between runs.")] = STORE,
) -> None:
    """Corrupt real motion step by step and see what every metric makes of it.

    Example: stylebench ladder --data procedural
    """
    from bench.datasets.table import load_dataset
    from bench.suite.ladder import page
    from bench.suite.ladder.climb import measured
    from bench.suite.store import Store
    from reports.ladder import write_rungs

    with console.ProgressDisplay() as progress:
        for name, path in datasets_of(data or []).items():
            dataset = load_dataset(name, path, lambda what, done, total: progress("data", what, done, total))
            write_rungs(numbers / f"{name}.csv", measured(dataset, samples, Store(store), progress))
    stored = page.stored_rungs(numbers)
    wrong = page.contradictions(page.all_cells(stored))
    for line in wrong:
        console.complain(line)
    if check:
        changed = page.difference(docs, stored)
        if changed:
            console.say(changed)
        if changed or wrong:
            raise typer.Exit(1)
        return
    for path in page.write_page(docs, stored):
        console.say(f"wrote {path}")
    if wrong:
        raise typer.Exit(1)


def trust(
    run_folders: Annotated[list[Path] | None, typer.Argument(help="Run folders of the transfer track.")] = None,
    data: Annotated[list[str] | None, typer.Option(help="Dataset as NAME or NAME=PATH; default: procedural.")] = None,
    store: Annotated[Path, typer.Option(help="The store of those runs; it has their motions.")] = STORE,
    check: Annotated[bool, typer.Option("--check", help="Only compare; exit 1 on a difference.")] = False,
    numbers: Annotated[Path, typer.Option(help="Folder of stored numbers.")] = Path("reports/published_trust"),
    page: Annotated[Path, typer.Option(help="The page; its figure lies beside it.")] = Path("docs/trust.md"),
    cards: Annotated[bool, typer.Option("--cards", help="Also note the agreement on the judges' cards.")] = False,
) -> None:
    """Judge stored motions with a second judge family and write docs/trust.md; without run folders from stored numbers.

    Example: stylebench trust runs/latest --data bandai-namco=bandai.zip
    """
    from bench.suite import trust as measured
    from reports.trust_page import check_page, write_page

    if check:
        difference = check_page(page, numbers)
        if difference:
            console.say(difference)
            raise typer.Exit(1)
        return
    if run_folders:
        with console.ProgressDisplay() as progress:
            found = measured.measure(run_folders, datasets_of(data or ["procedural"]), store, progress)
        measured.publish(found, numbers, page, cards=cards)
    else:
        write_page(numbers, page)
    console.say(f"wrote {page}")
