"""The plan of a run: its cells, the keys that decide their numbers, and what is still to be done."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from bench.adapters.base import Adapter
from bench.adapters.loading import AdapterSource, find_adapter
from bench.adapters.oracles import Oracle
from bench.adapters.post_processed import plain
from bench.suite.keys import adapter_digest, fit_key, generate_key
from bench.suite.setting import Setting
from bench.suite.store import Store
from bench.suite.truth import KNOWN_FOR
from bench.suite.workers import Outcome
from reports.records import TRAINED_HERE, MethodFacts, digest_of

SECONDS_PER_1000_SAMPLES = {"generate": 6.0, "score": 14.0}
"""Rough cost of a cell on one core, for ``--dry-run``; measured on the anchor rows."""
BYTES_PER_FRAME = 21 * 16 + 12
WHOLE_TAKE_FRAMES = 1600


@dataclass(frozen=True)
class Cell:
    """Method x protocol x dataset x seed: the unit that is run, cached, failed and resumed.

    ``settled`` is the outcome where it is known before anything runs: not supported, or not to be imported.
    ``device`` is where the method is trained; it answers on the CPU.
    """

    source: AdapterSource
    facts: MethodFacts
    seed: int
    budget: str
    fit_key: str
    motions_key: str
    given: bool
    settled: Outcome | None = None
    device: str = "cpu"


def plan_cells(
    setting: Setting, sources: Sequence[AdapterSource], *, seeds: Sequence[int], budget: str, device: str
) -> list[Cell]:
    """The cells of a run, in the order of ``sources``: of a method that is trained one a seed, else the first alone."""
    cells = []
    for source in sources:
        if source.broken:
            cells.append(_broken(source, seeds[0], budget))
            continue
        adapter = find_adapter(source)
        own_seeds = seeds if adapter.kind == "method" and adapter.fits() else seeds[:1]
        cells += [_cell(setting, source, adapter, seed, budget, device) for seed in own_seeds]
    return cells


def _broken(source: AdapterSource, seed: int, budget: str) -> Cell:
    """The cell of an adapter that cannot be imported: a row that says so."""
    facts = MethodFacts(name=source.name, title=source.name, kind="method", digest="")
    key = digest_of({"not to be imported": source.name})
    return Cell(source, facts, seed, budget, "", key, given=True, settled=Outcome("failed", source.broken))


def _cell(setting: Setting, source: AdapterSource, adapter: type[Adapter], seed: int, budget: str, device: str) -> Cell:
    digest = adapter_digest(adapter)
    trained = adapter_digest(plain(adapter))
    fitted = fit_key(trained, setting.fit_digest, budget, seed, device) if adapter.fits() else ""
    return Cell(
        source=source,
        facts=_facts(source, adapter, digest, budget),
        seed=seed,
        budget=budget,
        fit_key=fitted,
        motions_key=generate_key(
            fitted or digest, setting.tasks_digest, seed, after=digest if trained != digest else ""
        ),
        given=not issubclass(adapter, Oracle),
        settled=Outcome("unsupported", reason) if (reason := _unsupported(adapter, setting)) else None,
        device=device,
    )


def _facts(source: AdapterSource, adapter: type[Adapter], digest: str, budget: str) -> MethodFacts:
    traits = adapter.traits
    trained = traits.trained_on
    if adapter.fits() and adapter.kind == "method":
        trained = TRAINED_HERE + budget
    return MethodFacts(
        name=adapter.name or source.name,
        title=adapter.title or adapter.name or source.name,
        kind="anchor" if adapter.kind == "anchor" else "method",
        description=adapter.description,
        digest=digest,
        needs_content_label=traits.needs_content_label,
        needs_style_label=traits.needs_style_label,
        uses_judge=traits.uses_judge,
        trained_on=trained,
        draws_from=adapter.draws_from,
    )


def _unsupported(adapter: type[Adapter], setting: Setting) -> str:
    protocol = setting.protocol
    if issubclass(adapter, Oracle):
        if adapter.needs_truth and setting.dataset.name != KNOWN_FOR:
            return f"true answers exist for the {KNOWN_FOR} dataset only"
        # Conditions of our own protocols ask for something else than the track; those of papers are tables of theirs.
        # No oracle walks along a path frame by frame.
        own = protocol.name == f"stylebench-{protocol.track}" and protocol.condition != "standard"
        special = own or protocol.needs == "streams"
        if (f"{protocol.track}/{protocol.condition}" if special else protocol.track) not in adapter.tracks:
            return f"means nothing in {protocol.label}"
    elif protocol.needs not in adapter.capabilities():
        return f"{protocol.label} needs an adapter that {protocol.needs}"
    return ""


@dataclass(frozen=True)
class Estimate:
    """What a run would still cost."""

    cells: int
    to_generate: int
    minutes: float
    disk_mb: float


def estimate(setting: Setting, cells: Sequence[Cell], store: Store, jobs: int) -> Estimate:
    """Rough cost of what the store does not have yet."""
    runnable = [cell for cell in cells if cell.settled is None]
    waiting = [cell for cell in runnable if not store.has("motions", cell.motions_key)]
    per_cell = len(setting.tasks) / 1000.0
    seconds = per_cell * sum(SECONDS_PER_1000_SAMPLES.values()) * len(waiting)
    size = len(waiting) * sum(task.n_frames or WHOLE_TAKE_FRAMES for task in setting.tasks) * BYTES_PER_FRAME
    return Estimate(len(cells), len(waiting), seconds / max(jobs, 1) / 60.0, size / 2**20)
