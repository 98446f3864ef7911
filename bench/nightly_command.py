"""``stylebench nightly``."""

from __future__ import annotations

import sys
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated

import typer

from bench import console
from bench.command_options import command_line


def nightly(
    config: Annotated[Path, typer.Argument(help="nightly.toml; see docs/nightly.md.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print as JSON.")] = False,
) -> None:
    """Run what changed, compare with the last good night, write page, summary and trend; exit 1 on a regression.

    Example: stylebench nightly nightly.toml
    """
    from bench.suite.nightly import SUMMARY, night, read_config

    name = datetime.now(UTC).strftime("%Y-%m-%dT%H-%M-%SZ")
    with console.ProgressDisplay() as progress:
        result = night(read_config(config), name, command_line(sys.argv[1:]), progress)
    text = (result.folder / SUMMARY).read_text(encoding="utf-8")
    if as_json:
        found = result.comparison
        regressions = [f"{c.method}: {c.column} in {c.table}" for c in found.regressions] if found else []
        lost = dict(found.lost) if found else {}
        console.say_json(
            {
                "night": name,
                "good": result.good,
                "regressions": regressions,
                "lost": lost,
                "failed": dict(result.failed),
            }
        )
    else:
        console.say(text)
        page = result.folder / "page" / "index.html"
        console.say(f"page: {page}" if page.is_file() else f"summary: {result.folder / SUMMARY}")
    if not result.good:
        raise typer.Exit(1)
