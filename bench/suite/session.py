"""What all settings of one run share: the store, the workers, the run's own folder in the store, what the user sees."""

from __future__ import annotations

import contextlib
import json
import shutil
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TypeVar

from bench.suite.calls import VISIBLE_WITHIN_S, Call
from bench.suite.executors import Workers, workers_of
from bench.suite.failures import Failures
from bench.suite.machines import Home, Wanted, code_digest
from bench.suite.plan import Cell
from bench.suite.request import RunRequest
from bench.suite.setting import Setting
from bench.suite.store import Store

Progress = Callable[[str, str, int, int], None]
"""Called as ``progress(stage, what, done, total)``; stages are ``data``, ``judges``, ``reference``, ``cells``."""

Answered = TypeVar("Answered")


@dataclass(frozen=True)
class Session:
    """One run under way.

    Attributes
    ----------
    folder : in the store; calls leave word there of their attempts and how far they are.
    wanted : what is asked of every machine; None where no other takes part.
    """

    request: RunRequest
    store: Store
    workers: Workers
    folder: Path
    failures: Failures
    progress: Progress
    wanted: Wanted | None = None

    @property
    def logs(self) -> str:
        """Where calls write logs: other machines see the store alone, and the run folder gets its logs at the end."""
        return str(self.folder / "logs") if self.request.scheduler else str(self.request.out.absolute() / "logs")

    @property
    def visible_within_s(self) -> float:
        return VISIBLE_WITHIN_S if self.request.scheduler else 0.0

    def checked(self, planned: Sequence[tuple[Setting, Sequence[Cell]]]) -> Session:
        """This session, once all workers there are can do what was planned.

        Raises
        ------
        BadConfig : a machine lacks this code, the store, a dataset or an adapter.
        """
        if not self.request.scheduler:
            return self
        datasets = {(setting.dataset.dataset_id, setting.pack_folder.name) for setting, _ in planned}
        adapters = {(cell.source, cell.facts.digest) for _, cells in planned for cell in cells if not cell.settled}
        by_name = sorted(adapters, key=lambda item: item[0].name)
        home = Home(str(self.store.root), str(self.folder))
        wanted = Wanted(home, code_digest(), tuple(sorted(datasets)), tuple(by_name))
        self.workers.check(wanted)
        return replace(self, wanted=wanted)

    def answers(self, calls: Sequence[Call[Answered]], name: str, before: int = 0) -> list[Answered]:
        """The answers to some calls, in their order; ``before`` cells of this name needed none."""
        total = before + len(calls)
        self.progress("cells", name, before, total)
        return self.workers.run(
            calls,
            done=lambda number: self.progress("cells", name, before + number, total),
            waiting=_Detail(self.folder, self.progress).show,
        )


class _Detail:
    """The latest word that any call left."""

    def __init__(self, folder: Path, progress: Progress) -> None:
        self.folder = folder
        self.progress = progress
        self.shown_ns = 0

    def show(self) -> None:
        """Show it unless it was shown; a shared folder may lose a file between two looks."""
        with contextlib.suppress(OSError, ValueError):
            latest = max(((path.stat().st_mtime_ns, path) for path in self.folder.glob("*.progress")), default=None)
            if latest and latest[0] > self.shown_ns:
                self.shown_ns = latest[0]
                what, done, total = json.loads(latest[1].read_text())
                self.progress("cells", f"{what} {done}/{total}", -1, -1)


@contextmanager
def session_of(request: RunRequest, progress: Progress) -> Iterator[Session]:
    """Open the store and the workers for one run.

    Raises
    ------
    BadConfig : the store cannot be written, or nothing answers at the scheduler's address.
    """
    store = Store(request.store.absolute())
    store.sweep()
    folder = store.draft("run")
    try:
        with workers_of(request.scheduler, request.jobs) as workers:
            yield Session(request, store, workers, folder, Failures(store, request.out), progress)
    finally:
        for log in (folder / "logs").glob("*"):
            (request.out / "logs").mkdir(parents=True, exist_ok=True)
            shutil.move(log, request.out / "logs" / log.name)
        shutil.rmtree(folder, ignore_errors=True)
