"""Measuring how far a run's numbers can be trusted: both judge families, sessions, kinds of source, sample sizes.

Stored motions are judged again by the second family; nothing is generated.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from bench.datasets.table import load_dataset
from bench.errors import BadConfig
from bench.protocols import PROTOCOLS
from bench.suite.embedding import Embedding
from bench.suite.judge_card import ClassifierFacts, to_markdown
from bench.suite.judges import CARD_FILE, PRETRAINED, read_card
from bench.suite.motions import Motions
from bench.suite.request import RunRequest
from bench.suite.scores.base import Reference
from bench.suite.second_judges import load_second_judges
from bench.suite.session import Progress, session_of
from bench.suite.setting import Setting, prepare
from bench.suite.setting_run import SettingRun
from bench.suite.store import Store
from bench.suite.trust_curves import DISTANCES, DRAWS, FEWEST_SAMPLES, curve
from bench.suite.trust_rows import Opinions
from reports.records import Record, write_text_atomically
from reports.rows import StoredRecord, load_run
from reports.trust import Curve, TrustData, TrustJudge, judge_agreements, merged, read_trust, write_trust
from reports.trust_page import write_page

PROTOCOL = "stylebench-transfer@1"
CURVE_ROWS = ("label-oracle", "classify-and-retrieve", "style-mean-shift", "pose-adain", "copy-content")
"""Anchor rows whose distances are drawn against n, beside the floor; methods are always drawn."""


def measure(
    run_folders: Sequence[Path], data: Mapping[str, Path | None], store: Path, progress: Progress
) -> list[TrustData]:
    """Measure every dataset of some runs of the transfer track.

    Parameters
    ----------
    run_folders : with the records.
    data : dataset name -> where it lies.
    store : of the runs; it has their motions.

    Raises
    ------
    BadConfig : no records to measure, a dataset is not given, or the store lacks a row's motions.
    JudgeRefused : there is no second family for the data.
    BadRecord : a record or samples file is broken.
    """
    stored = [item for folder in run_folders for item in load_run(folder) if _counts(item.record)]
    if not stored:
        raise BadConfig(f"no finished record of {PROTOCOL}", where=", ".join(map(str, run_folders)))
    by_dataset: dict[str, list[StoredRecord]] = {}
    for item in stored:
        by_dataset.setdefault(item.record.dataset, []).append(item)
    return [_measure_dataset(items, data, store, progress) for _, items in sorted(by_dataset.items())]


def publish(measured: Iterable[TrustData], folder: Path, page: Path, *, cards: bool) -> list[Path]:
    """Store what was measured beside the rows already stored, and write the page; returns the files of numbers.

    ``cards`` also notes the agreement of the families on the cards of the canonical judges, for maintainers.

    Raises
    ------
    BadRecord : stored rows were measured under other tasks, data or judges.
    """
    stored, paths = read_trust(folder), []
    for data in measured:
        whole = merged(stored[data.dataset], data) if data.dataset in stored else data
        paths.append(write_trust(folder, whole))
        if cards:
            note_on_card(whole)
    write_page(folder, page)
    return paths


def note_on_card(data: TrustData) -> None:
    """Write the rank agreement of both families onto the card of the canonical judges.

    Raises
    ------
    JudgeRefused : there is no card.
    """
    folder = PRETRAINED / data.dataset
    card, found = read_card(folder), judge_agreements(data)

    def noted(facts: Iterable[ClassifierFacts]) -> tuple[ClassifierFacts, ...]:
        return tuple(fact.model_copy(update={"rank_agreement": found.get(fact.id)}) for fact in facts)

    card = card.model_copy(update={"classifiers": noted(card.classifiers), "second": noted(card.second)})
    write_text_atomically(folder / "card.md", to_markdown(card))
    write_text_atomically(folder / CARD_FILE, card.model_dump_json(indent=1) + "\n")


def _counts(record: Record) -> bool:
    return record.status == "ok" and record.protocol_id == PROTOCOL and record.condition == "standard"


def _measure_dataset(
    stored: Sequence[StoredRecord], data: Mapping[str, Path | None], store: Path, progress: Progress
) -> TrustData:
    first = stored[0].record
    name = first.dataset.partition("@")[0]
    if name not in data:
        raise BadConfig(f"there are records of {name}, but not the dataset", remedy=f"--data {name}=PATH")
    dataset = load_dataset(name, data[name], lambda what, done, total: progress("data", what, done, total))
    setting = prepare(dataset, PROTOCOLS[PROTOCOL], first.profile, Store(store.absolute()))
    for record, path in stored:
        made_of = (record.dataset_digest, record.profile, record.protocol_facts.get("tasks digest"))
        if made_of != (dataset.digest, setting.profile, setting.tasks_digest):
            raise BadConfig(
                f"{record.method.name} was made of other data or tasks, or another profile than the others",
                where=str(path),
                remedy="run it again, or leave it out",
            )
    request = RunRequest(data={}, out=stored[0].path.parent.parent, store=store, jobs=1)
    with session_of(request, progress) as session:
        run = SettingRun(session, setting)
        run.run((), request.out / "records")
        return _data(run, setting, session.store, stored, progress)


def _data(
    run: SettingRun, setting: Setting, store: Store, stored: Sequence[StoredRecord], progress: Progress
) -> TrustData:
    if run.judges is None or not isinstance(run.scorer.reference, Reference):
        raise BadConfig(f"{PROTOCOL} is not judged")
    judges, second = run.judges.judges, load_second_judges(run.judges.folder)
    known = {fact.digest for fact in judges.facts}
    opinions = Opinions(setting, judges, second, run.scorer.reference, store)
    folders = motions_folders(store)
    reference = run.scorer.reference
    rows, curves = [], _curves("floor", "real against real", reference, reference.floor.embedding)
    for done, item in enumerate(stored):
        record, facts = item.record, item.record.method
        progress("cells", f"second opinion, {setting.dataset.dataset_id}", done, len(stored))
        if {fact.digest for fact in record.judges} != known:
            raise BadConfig(
                f"{facts.name} was scored by other judges",
                where=str(item.path),
                remedy="score it again, or leave it out",
            )
        if record.motions_digest not in folders:
            raise BadConfig(
                f"the store lacks the motions of {facts.name} on {record.dataset}",
                where=str(store.root),
                cause="the run had another store, or it was cleaned",
                remedy="give its store with --store, or run it again",
            )
        judged = opinions.judged(Motions.load(folders[record.motions_digest]))
        rows.append(opinions.row(item, judged))
        if facts.kind == "method" or facts.name in CURVE_ROWS:
            curves += _curves(facts.name, facts.title, reference, judged.first)
    progress("cells", f"second opinion, {setting.dataset.dataset_id}", len(stored), len(stored))
    dataset = setting.dataset
    return TrustData(
        dataset=dataset.dataset_id, dataset_digest=dataset.digest, protocol=PROTOCOL, profile=setting.profile,
        n=len(setting.tasks), tasks_digest=setting.tasks_digest, judges_digest=judges.digest,
        second_digest=second.digest, neutral_style=opinions.neutral, sessions=opinions.styles_of_session, draws=DRAWS,
        judges=tuple(_judge(fact) for fact in judges.card.classifiers if fact.target != "native"),
        second=tuple(_judge(fact) for fact in second.facts), rows=tuple(rows), curves=tuple(curves),
    )  # fmt: skip


def motions_folders(store: Store) -> dict[str, Path]:
    """Digest of motions -> where a store has them."""
    keys = [path.name for path in (store.root / "motions").glob("*") if store.has("motions", path.name)]
    return {str(store.facts("motions", key)["motions_digest"]): store.folder("motions", key) for key in keys}


def _curves(method: str, title: str, reference: Reference, embedding: Embedding) -> list[Curve]:
    real = reference.real.embedding.content_features
    if embedding.content_features.shape[1] < FEWEST_SAMPLES:
        return []
    return [curve(method, title, metric, real, embedding.content_features) for metric in DISTANCES]


def _judge(fact: ClassifierFacts) -> TrustJudge:
    return TrustJudge(
        id=fact.id, digest=fact.digest, target=fact.target, accuracy=fact.pooled.accuracy, chance=fact.pooled.chance,
        within_session=fact.within_session_accuracy, within_session_chance=fact.within_session_chance,
        unseen_actors=fact.unseen_actor_accuracy,
    )  # fmt: skip
