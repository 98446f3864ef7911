"""``stylebench report``: the page of a run, with the motions that its store still has."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from bench.datasets.pack import Pack
from bench.metrics import METRICS
from bench.motion.clip import Clip
from bench.motion.edit import crop, resample
from bench.motion.kinematics import FOOT_JOINTS, foot_contacts, world_positions
from bench.motion.skeleton import CANONICAL_PARENTS, HEAD, LEFT_HAND, PARTS, RIGHT_HAND
from bench.protocols.base import Task
from bench.suite.answering import source_of
from bench.suite.fitting import read_curves
from bench.suite.inputs import read_inputs
from bench.suite.judges import CARD_FILE, PRETRAINED, read_card
from bench.suite.ladder.page import all_cells, stored_rungs
from bench.suite.motions import Motions
from bench.suite.output import PUBLISHED, stem_of
from bench.suite.setting import read_tasks
from bench.suite.store import Store
from bench.suite.trust import motions_folders
from reports import plots
from reports.curves import TrainingCurves, loss_figure
from reports.figures import save_figure
from reports.ladder_figure import ladder_figure
from reports.more_figures import confusion_figure
from reports.page import Body, PlayerTable, Section, table_section, write_page
from reports.plots import Plot, plot_of
from reports.tables import Table, TableRow, tables_of_run
from reports.trust import read_trust
from reports.trust_figure import sample_size_figure

N_SAMPLES = 30
MOST_BODIES = 12
LONGEST_S = 10.0
"""Sequences are shown up to here; windows are shorter."""
NO_MOTIONS = "The store of this run no longer has its motions, or the run was not made here: there is nothing to play."


LADDER, TRUST = PUBLISHED / "ladder", PUBLISHED.with_name("published_trust")


def build_page(run_folder: Path, store: Store) -> Path:
    """Write the page of a run into ``run_folder/page``; returns its ``index.html``.

    Raises
    ------
    BadRecord : no records there, or broken ones.
    """
    tables = tables_of_run(run_folder)
    folders = motions_folders(store)
    players = [player for table in tables if (player := player_of(run_folder, table, store, folders))]
    title = f"Stylebench: {', '.join(sorted({table.key.dataset for table in tables}))}"
    made = sorted({record.provenance.time_utc[:10] for t in tables for row in t.rows for record in row.row.ok})
    subtitle = (
        f"{sum(len(t.rows) for t in tables)} rows in {len(tables)} tables; made {' to '.join(made[:1] + made[-1:])}"
    )
    sections = [
        table_section(tables),
        Section("motions", "Motions", () if players else (NO_MOTIONS,)),
        *_plot_sections(run_folder, tables, store),
    ]
    return write_page(run_folder / "page", title, subtitle, [s for s in sections if s is not None], players)


def save_figures(run_folder: Path, store: Store, forms: Sequence[str]) -> list[Path]:
    """Write what belongs to no single table into ``run_folder/figures``: judges, distances, ladder, trainings."""
    tables, paths = tables_of_run(run_folder), []
    for name, figure in _static(run_folder, tables, store):
        for form in forms:
            paths.append(run_folder / "figures" / f"{name}.{form}")
            save_figure(figure, paths[-1])
    return paths


def _static(run_folder: Path, tables: Sequence[Table], store: Store) -> Iterator[tuple[str, Figure]]:
    for dataset, target, labels, counts in _cards(tables):
        yield f"judges-{dataset}-{target}", confusion_figure(f"{target}, {dataset}", labels, counts)
    stored = read_trust(TRUST) if TRUST.is_dir() else {}
    shown = [stored[dataset] for dataset in sorted({table.key.dataset for table in tables} & set(stored))]
    if shown:
        yield "distances", sample_size_figure(shown)
    if LADDER.is_dir():
        yield "ladder", ladder_figure(all_cells(stored_rungs(LADDER)))
    for number, (title, curves) in enumerate(_curves_of(run_folder, tables, store)):
        yield f"training-{number}", loss_figure(title, [curves])


def player_of(
    run_folder: Path,
    table: Table,
    store: Store,
    folders: Mapping[str, Path],
    *,
    names: Collection[str] = (),
    sample_ids: Collection[str] = (),
) -> PlayerTable | None:
    """What a table can show, or None where the store lacks it.

    Parameters
    ----------
    folders : digest of motions -> where the store has them (:func:`bench.suite.trust.motions_folders`).
    names : rows to show; empty for the first ``MOST_BODIES``.
    sample_ids : samples to show; empty for ``N_SAMPLES`` spread over the list.
    """
    rows = [row for row in table.rows if row.row.ok and row.row.ok[0].motions_digest in folders]
    rows = [row for row in rows if row.row.method.row_name in names] if names else rows[:MOST_BODIES]
    if not rows:
        return None
    digest = table.facts.get("tasks digest", "")
    facts = read_inputs(run_folder, digest)
    tasks_file = store.root / "tasks" / f"{digest}.json"
    if facts is None or not store.has("takes", str(facts["takes"])) or not tasks_file.is_file():
        return None
    tasks = read_tasks(tasks_file)
    pack, fps = Pack.open(store.folder("takes", str(facts["takes"]))), float(facts["fps"])
    chosen = np.unique(np.linspace(0, len(tasks) - 1, N_SAMPLES).astype(int))
    if sample_ids:
        chosen = np.flatnonzero([task.sample_id in sample_ids for task in tasks])
    picked = [tasks[place] for place in chosen]
    bodies = {
        "content": _body("source", [source_of(task, pack, fps).clip for task in picked]),
        "style": _body("style reference", [resample(pack.take(task.style_take_id).clip, fps) for task in picked]),
    }
    if facts["truth"] and store.has("truth", str(facts["truth"])):
        truth = Motions.load(store.folder("truth", str(facts["truth"])))
        bodies["truth"] = _body("true answer", [truth.clip(int(place)) for place in chosen])
    better: dict[str, str] = {}
    for row in rows:
        motions = Motions.load(folders[row.row.ok[0].motions_digest])
        if motions.n == len(tasks):
            scores = _scores(row, chosen, len(tasks), better)
            bodies[row.row.method.row_name] = _body(row.title, [motions.clip(int(place)) for place in chosen], scores)
    return PlayerTable(
        name=stem_of(table.key), title=table.title, fps=min(fps, 30.0), parents=CANONICAL_PARENTS, sides=_sides(),
        hands=(LEFT_HAND, RIGHT_HAND), feet=FOOT_JOINTS, head=HEAD,
        samples=[(task.sample_id, _said(task)) for task in picked], bodies=bodies, better=better,
    )  # fmt: skip


def _said(task: Task) -> str:
    part = f", {task.part}" if task.part else ""
    weight = f", weight {task.weight:g}" if task.weight != 1.0 else ""
    return f"{task.content}, {task.source_style} to {task.target_style}{part}{weight}"


def _body(title: str, clips: Sequence[Clip], scores: Mapping[str, NDArray[np.float64]] | None = None) -> Body:
    shown = []
    for clip in clips:
        slower = resample(clip, min(clip.fps, 30.0))
        shown.append(crop(slower, 0, min(slower.n_frames, round(LONGEST_S * slower.fps))))
    positions = [world_positions(clip) for clip in shown]
    contacts = [foot_contacts(place, clip.fps) for place, clip in zip(positions, shown, strict=True)]
    return Body(title, positions, contacts, scores or {})


def _scores(row: TableRow, chosen: NDArray[np.int64], n: int, better: dict[str, str]) -> dict[str, NDArray[np.float64]]:
    """Per-sample metrics of the shown samples that have a good direction; those are noted in ``better``."""
    found: dict[str, NDArray[np.float64]] = {}
    for name, values in row.row.samples[0].items() if row.row.samples else ():
        metric = name.removeprefix("per_sample/")
        known = METRICS.get(metric)
        if metric == name or known is None or known.better not in ("higher", "lower") or values.shape != (n,):
            continue
        better[metric] = known.better
        found[metric] = values[chosen].astype(np.float64)
    return found


def _sides() -> list[str]:
    left, right = {*PARTS["left_leg"], *PARTS["left_arm"]}, {*PARTS["right_leg"], *PARTS["right_arm"]}
    return ["left" if j in left else "right" if j in right else "middle" for j in range(len(CANONICAL_PARENTS))]


def _plot_sections(run_folder: Path, tables: Sequence[Table], store: Store) -> list[Section]:
    found: list[tuple[str, str, str, list[Plot]]] = [
        ("pareto", "Content against style", "Upper right is transfer; corners are copies.",
         _each(tables, "pareto", plots.pareto)),
        ("latency", "Latency", "Calls frame by frame; dotted lines are the deadlines of 30, 60 and 120 fps.",
         _each(tables, "latency", plots.latencies)),
        ("distances", "Distances against n", "Below the floor, grey, a distance means nothing.", _distances(tables)),
        ("confusion", "Judges", "What the judges make of real motion, first seed.", _confusions(tables)),
        ("locality", "Locality", "How far joints move when one body part is transferred.",
         _each(tables, "joints", plots.joints_moved)),
        ("ladder", "Corruption ladder", "Orange: the metric sees that motion got worse. White: it does not see it.",
         _ladders()),
        ("training", "Training", "Losses of the trainings behind the rows.", _trainings(run_folder, tables, store)),
    ]  # fmt: skip
    return [
        Section(anchor, title, (text,), (), tuple(made)) if made
        else Section(anchor, title, ("This run has nothing to show here.",))
        for anchor, title, text, made in found
    ]  # fmt: skip


def _each(tables: Sequence[Table], kind: str, draw: Any) -> list[Plot]:
    figures = [(table, draw(table)) for table in tables]
    return [plot_of(f"{kind}-{n}", table.title, figure) for n, (table, figure) in enumerate(figures) if figure]


def _distances(tables: Sequence[Table]) -> list[Plot]:
    shown = {table.key.dataset for table in tables}
    stored = read_trust(TRUST) if TRUST.is_dir() else {}
    return [
        plot_of(f"distances-{n}", dataset, plots.distances_by_n(data))
        for n, (dataset, data) in enumerate(stored.items())
        if dataset in shown
    ]


def _confusions(tables: Sequence[Table]) -> list[Plot]:
    return [
        plot_of(f"confusion-{n}", f"{target}, {dataset}", plots.confusion(labels, counts))
        for n, (dataset, target, labels, counts) in enumerate(_cards(tables))
    ]


def _cards(tables: Sequence[Table]) -> Iterator[tuple[str, str, Sequence[str], Sequence[Sequence[int]]]]:
    """Dataset, target, labels and confusion of the first judge of each canonical card that the tables need."""
    for dataset in sorted({table.key.dataset for table in tables if table.judges}):
        if (PRETRAINED / dataset / CARD_FILE).is_file():
            card = read_card(PRETRAINED / dataset)
            for target, labels in (("content", card.content_labels), ("style", card.style_labels)):
                yield dataset, target, labels, card.of(target)[0].pooled.confusion


def _ladders() -> list[Plot]:
    if not LADDER.is_dir():
        return []
    cells = all_cells(stored_rungs(LADDER))
    return [plot_of(f"ladder-{n}", title, figure) for n, (title, figure) in enumerate(plots.of_ladders(cells))]


def _trainings(run_folder: Path, tables: Sequence[Table], store: Store) -> list[Plot]:
    return [
        plot_of(f"training-{n}", title, plots.training([curves]))
        for n, (title, curves) in enumerate(_curves_of(run_folder, tables, store))
    ]


def _curves_of(run_folder: Path, tables: Sequence[Table], store: Store) -> Iterator[tuple[str, TrainingCurves]]:
    fits: dict[str, str] = {}
    for table in tables:
        facts = read_inputs(run_folder, table.facts.get("tasks digest", "")) or {}
        fits |= facts.get("fits", {})
    for title, key in sorted(fits.items()):
        if store.has("fit", key) and (curves := read_curves(store.folder("fit", key), "")):
            yield title, curves
