"""Training without a run: what the store lacks of some methods is trained, and loss curves are drawn."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.adapters.loading import AdapterSource
from bench.datasets.table import load_dataset
from bench.errors import BadConfig
from bench.suite import assemble
from bench.suite.calls import CellCall
from bench.suite.cell import FIT_ONLY, GenerateJob
from bench.suite.plan import Cell, plan_cells
from bench.suite.request import RunRequest, checked_device, protocols_of, sources_of
from bench.suite.session import Progress, Session, session_of
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from bench.suite.timed import job_of
from bench.suite.workers import Limits, Outcome
from reports.curves import TrainingCurves, save_losses

CURVES_FILE = "curves.npz"
WEIGHTS_FILE = "weights.safetensors"
LIMITS = Limits(wall_s=7 * 24 * 3600.0, rss_mb=16384.0)
"""A training may take as long as it takes; a run's cells may not."""


@dataclass(frozen=True)
class FitOrder:
    """What to train.

    Attributes
    ----------
    data : dataset name -> path (None for generated data).
    methods, adapter_files : as for a run; only what learns is trained.
    track : whose training motions; ``gesture`` has its own, all other tracks those of ``transfer``.
    seeds : one training of each method with each.
    device : ``cpu`` or ``cuda``; weights of one are not those of the other.
    out : folder for figures and logs.
    """

    data: dict[str, Path | None]
    methods: tuple[str, ...]
    out: Path
    store: Path
    adapter_files: tuple[str, ...] = ()
    track: str = "transfer"
    budget: str = "small"
    seeds: tuple[int, ...] = (0,)
    device: str = "cpu"
    split: str = "default"
    jobs: int = 2
    limits: Limits = field(default_factory=lambda: LIMITS)
    command: str = ""


@dataclass(frozen=True)
class Fitted:
    """One training as it ended.

    Attributes
    ----------
    steps, seconds, losses : of the training itself; 0 and empty where the method keeps no curves.
    size_bytes : of everything that is stored.
    anew : False where the store had it.
    """

    dataset: str
    method: str
    seed: int
    outcome: Outcome
    steps: int = 0
    seconds: float = 0.0
    losses: tuple[tuple[str, float], ...] = ()
    size_bytes: int = 0
    anew: bool = False


def fit_all(order: FitOrder, progress: Progress) -> list[Fitted]:
    """Train what is missing, ``jobs`` at a time; a killed training goes on where it was. Draws the loss curves.

    Raises
    ------
    BadConfig : unknown names, a method that does not learn, a device that is not there.
    """
    _check(order)
    request = RunRequest(
        data=order.data, out=order.out, store=order.store, methods=order.methods, adapter_files=order.adapter_files,
        only_files=bool(order.adapter_files), tracks=(order.track,), profile="smoke", jobs=order.jobs,
        limits=order.limits, command=order.command,
    )  # fmt: skip
    [protocol] = protocols_of(request)
    sources = sources_of(request)
    found: list[Fitted] = []
    with session_of(request, progress) as session:
        for name, path in order.data.items():
            dataset = load_dataset(name, path, lambda what, done, total: progress("data", what, done, total))
            setting = prepare(dataset, protocol, request.profile, session.store, split_kind=order.split)
            cells = _trained_cells(setting, sources, order)
            found += _fit_cells(session, setting, cells, order)
            _draw(session.store, setting, cells, order)
    return found


def _check(order: FitOrder) -> None:
    checked_device(order.device)
    if not order.methods and not order.adapter_files:
        raise BadConfig("no method named", where="--methods", remedy="stylebench list methods shows what there is")


def _trained_cells(setting: Setting, sources: Sequence[AdapterSource], order: FitOrder) -> list[Cell]:
    """One cell a method and seed, the first seed of every method first."""
    cells = plan_cells(setting, sources, seeds=order.seeds, budget=order.budget, device=order.device)
    for cell in cells:
        if cell.settled is not None and cell.settled.status != "unsupported":
            raise BadConfig(f"{cell.facts.name}: {cell.settled.reason}")
        if not cell.fit_key:
            raise BadConfig(f"{cell.facts.name} does not learn", where="--methods", remedy="leave it out")
    return sorted(cells, key=lambda cell: order.seeds.index(cell.seed))


def _fit_cells(session: Session, setting: Setting, cells: Sequence[Cell], order: FitOrder) -> list[Fitted]:
    waiting = [cell for cell in cells if not session.store.has("fit", cell.fit_key)]
    calls = [_call(session, setting, cell) for cell in waiting]
    name = f"training on {setting.dataset.dataset_id}"
    answers = session.answers(calls, name, before=len(cells) - len(waiting)) if calls else []
    outcomes = {cell.fit_key: answer.outcome for cell, answer in zip(waiting, answers, strict=True)}
    return [_fitted(session.store, setting, cell, outcomes.get(cell.fit_key)) for cell in cells]


def _call(session: Session, setting: Setting, cell: Cell) -> CellCall:
    work = GenerateJob(cell.fit_key, "", FIT_ONLY, setting.protocol.fps)
    return CellCall(
        name=f"fit-{assemble.record_key(setting, cell)}",
        folder=str(session.folder),
        wanted=session.wanted,
        needs=(("takes", setting.pack_folder.name),),
        job=job_of(setting, cell, session.store, work),
        spec=None,
        given=cell.given,
        limits=session.request.limits,
        logs=session.logs,
        command=session.request.command,
    )


def _fitted(store: Store, setting: Setting, cell: Cell, outcome: Outcome | None) -> Fitted:
    name = cell.facts.name
    if outcome is not None and outcome.status != "ok":
        return Fitted(setting.dataset.dataset_id, name, cell.seed, outcome)
    folder = store.folder("fit", cell.fit_key)
    curves = read_curves(folder, f"seed {cell.seed}")
    last = () if curves is None else tuple(zip(curves.names, curves.values[-1].tolist(), strict=True))
    return Fitted(
        dataset=setting.dataset.dataset_id,
        method=name,
        seed=cell.seed,
        outcome=Outcome("ok"),
        steps=0 if curves is None else int(curves.steps[-1]),
        seconds=_seconds(folder) or float(store.facts("fit", cell.fit_key).get("wall_s", 0.0)),
        losses=last,
        size_bytes=sum(path.stat().st_size for path in folder.rglob("*") if path.is_file()),
        anew=outcome is not None,
    )


def read_curves(folder: Path, label: str) -> TrainingCurves | None:
    """The loss curves that a learned adapter leaves beside its weights; None where there are none."""
    path = folder / CURVES_FILE
    if not path.is_file():
        return None
    with np.load(path, allow_pickle=False) as stored:
        names = tuple(str(name) for name in stored["names"])
        return TrainingCurves(label, names, stored["steps"], stored["values"])


def _seconds(folder: Path) -> float:
    path = folder / CURVES_FILE
    if not path.is_file():
        return 0.0
    with np.load(path, allow_pickle=False) as stored:
        return float(stored["seconds"])


def _draw(store: Store, setting: Setting, cells: Sequence[Cell], order: FitOrder) -> None:
    for name in dict.fromkeys(cell.facts.name for cell in cells):
        own = [cell for cell in cells if cell.facts.name == name and store.has("fit", cell.fit_key)]
        curves = [
            found for cell in own if (found := read_curves(store.folder("fit", cell.fit_key), f"seed {cell.seed}"))
        ]
        if curves:
            title = f"{name}, budget {order.budget}, {order.track}, {setting.dataset.dataset_id}"
            save_losses(order.out / f"{name}-{order.budget}-{order.track}-{setting.dataset.name}.png", title, curves)


def table_of(found: Sequence[Fitted]) -> tuple[list[str], list[list[str]]]:
    """Headers and rows for the terminal."""
    headers = ["dataset", "method", "seed", "status", "steps", "seconds", "kB", "last losses"]
    rows = [
        [
            row.dataset,
            row.method,
            str(row.seed),
            row.outcome.status if row.anew or row.outcome.status != "ok" else "in the store",
            str(row.steps or "-"),
            f"{row.seconds:.0f}",
            f"{row.size_bytes / 1000:.0f}",
            row.outcome.reason or ", ".join(f"{name} {value:.3g}" for name, value in row.losses),
        ]
        for row in found
    ]
    return headers, rows
