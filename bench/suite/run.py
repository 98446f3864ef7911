"""Running a benchmark: datasets in, records out. What the store has is not done again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.adapters.loading import AdapterSource
from bench.datasets.base import Dataset
from bench.datasets.table import load_dataset
from bench.errors import BadData
from bench.suite.plan import Cell, Estimate, estimate, plan_cells
from bench.suite.request import RunRequest, check_request, protocols_of, sources_of
from bench.suite.score import pin_threads
from bench.suite.session import Progress, session_of
from bench.suite.setting import Setting, prepare
from bench.suite.setting_run import SettingRun
from bench.suite.store import Store
from bench.suite.timed import time_cells
from reports.records import Record


@dataclass(frozen=True)
class RunResult:
    """What a run left: its records, and how many cells were generated and metrics computed anew.

    ``left_out`` names protocols that a dataset cannot serve, with the reason; ``notes`` what was assumed of the data.
    """

    records: tuple[Record, ...]
    generated: int
    scored: int
    left_out: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Planned:
    """The settings of a run, and what could not be set up."""

    settings: tuple[Setting, ...]
    left_out: tuple[str, ...]


def dry_run(request: RunRequest, progress: Progress) -> list[tuple[Setting, list[Cell], Estimate]]:
    """The cells of a run and what they would cost; loads the data, runs nothing."""
    check_request(request)
    sources = sources_of(request)
    store = Store(request.store)
    plans = []
    for setting in _settings(request, _loaded(request, progress), store).settings:
        cells = _cells(request, setting, sources)
        plans.append((setting, cells, estimate(setting, cells, store, request.jobs)))
    return plans


def run(request: RunRequest, progress: Progress) -> RunResult:
    """Run everything asked for and write one record per cell into ``out/records``.

    Raises
    ------
    BenchError : a request that cannot be run; a failing method is a record, not an error.
    """
    check_request(request)
    sources = sources_of(request)
    pin_threads(request.limits.threads)
    datasets = _loaded(request, progress)
    records: list[Record] = []
    generated = scored = 0
    with session_of(request, progress) as opened:
        planned = _settings(request, datasets, opened.store)
        cells_of = [(setting, _cells(request, setting, sources)) for setting in planned.settings]
        session = opened.checked(cells_of)
        records_folder = fresh_records_folder(request.out)
        for setting, cells in cells_of:
            if setting.protocol.track == "runtime":
                records.extend(time_cells(session, setting, cells, records_folder))
                continue
            part = SettingRun(session, setting).run(cells, records_folder)
            records.extend(part.records)
            generated += part.generated
            scored += part.scored
    notes = tuple(note for dataset in datasets for note in dataset.said)
    return RunResult(tuple(records), generated, scored, planned.left_out, notes)


def fresh_records_folder(out: Path) -> Path:
    """The records folder of a run, emptied."""
    folder = out / "records"
    folder.mkdir(parents=True, exist_ok=True)
    for old in folder.iterdir():
        old.unlink()
    return folder


def _loaded(request: RunRequest, progress: Progress) -> list[Dataset]:
    return [
        load_dataset(name, path, lambda what, done, total: progress("data", what, done, total), request.overrides)
        for name, path in {**request.data, **request.foreign}.items()
    ]


def _settings(request: RunRequest, datasets: Sequence[Dataset], store: Store) -> Planned:
    """Every protocol on every dataset that can serve it; a run with one protocol refuses what it cannot serve."""
    protocols = protocols_of(request)
    settings, left_out = [], []
    for dataset in datasets[: len(request.data)]:
        foreign = datasets[len(request.data) :]
        others = [*foreign, *(other for other in datasets if other is not dataset)]
        for protocol in protocols:
            try:
                setting = prepare(
                    dataset, protocol, request.profile, store, split_kind=request.split,
                    foreign=others[0] if others else None,
                )  # fmt: skip
            except BadData as error:
                if len(protocols) == 1:
                    raise
                left_out.append(f"{protocol.label} on {dataset.dataset_id}: {error.problem}")
            else:
                settings.append(setting)
    return Planned(tuple(settings), tuple(left_out))


def _cells(request: RunRequest, setting: Setting, sources: Sequence[AdapterSource]) -> list[Cell]:
    cells = plan_cells(setting, sources, seeds=request.seeds, budget=request.budget, device=request.device)
    return [cell for cell in cells if _is_a_row(cell, request)]


def _is_a_row(cell: Cell, request: RunRequest) -> bool:
    """What is not supported is shown only where it was asked for by name."""
    return cell.settled is None or cell.settled.status != "unsupported" or cell.facts.name in request.methods
