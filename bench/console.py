"""What the terminal shows: progress bars (plain lines where there is no terminal), tables, one-line errors."""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, TaskID, TextColumn, TimeElapsedColumn, TimeRemainingColumn
from rich.progress import Progress as RichProgress
from rich.table import Table as RichTable

PLAIN_EVERY_S = 5.0


class ProgressDisplay:
    """Progress of a run on stderr: bars with time left on a terminal, a plain line every few seconds elsewhere."""

    def __init__(self) -> None:
        self.console = Console(stderr=True)
        self.bars: RichProgress | None = None
        self.tasks: dict[str, TaskID] = {}
        self.started: dict[str, float] = {}
        self.last_line = 0.0

    def __enter__(self) -> ProgressDisplay:
        if self.console.is_terminal:
            self.bars = RichProgress(
                TextColumn("{task.description}"),
                BarColumn(),
                MofNCompleteColumn(),
                TimeElapsedColumn(),
                TimeRemainingColumn(),
                TextColumn("{task.fields[detail]}"),
                console=self.console,
                transient=True,
            )
            self.bars.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.bars:
            self.bars.stop()

    def __call__(self, stage: str, what: str, done: int, total: int) -> None:
        """Show that ``done`` of ``total`` steps of a stage are finished; a total of -1 only updates the detail."""
        if self.bars:
            self._bar(self.bars, stage, what, done, total)
        else:
            self._line(stage, what, done, total)

    def _bar(self, bars: RichProgress, stage: str, what: str, done: int, total: int) -> None:
        if stage not in self.tasks:
            self.tasks[stage] = bars.add_task(stage, total=max(total, 1), detail=what)
        if total < 0:
            bars.update(self.tasks[stage], detail=what)
        else:
            bars.update(self.tasks[stage], completed=done, total=max(total, 1), detail=what)

    def _line(self, stage: str, what: str, done: int, total: int) -> None:
        now = time.monotonic()
        self.started.setdefault(stage, now)
        if total >= 0 and done < total and now - self.last_line < PLAIN_EVERY_S and done > 0:
            return
        if total < 0:
            return
        self.last_line = now
        left = ""
        if 0 < done < total:
            left = f", about {(now - self.started[stage]) / done * (total - done):.0f} s left"
        self.console.print(f"{stage}: {what} {done}/{total}{left}", highlight=False, markup=False)


def show_rows(headers: Sequence[str], rows: Sequence[Sequence[str]], *, title: str = "") -> None:
    """A small table on stdout."""
    table = RichTable(title=title or None, title_justify="left", box=None, pad_edge=False)
    for header in headers:
        table.add_column(header, overflow="fold")
    for row in rows:
        table.add_row(*[cell.replace("[", "\\[") for cell in row])
    Console(width=None if sys.stdout.isatty() else 200).print(table)


def say(text: str) -> None:
    """A line on stdout, as it is."""
    sys.stdout.write(text + "\n")


def say_json(value: Any) -> None:
    """JSON on stdout, for scripts."""
    sys.stdout.write(json.dumps(value, indent=1, sort_keys=True) + "\n")


def remark(text: str) -> None:
    """One line on stderr that is no error: what was assumed."""
    sys.stderr.write("note: " + " ".join(text.split()) + "\n")


def complain(text: str) -> None:
    """One line on stderr."""
    sys.stderr.write("error: " + " ".join(text.split()) + "\n")
