"""One protocol on one dataset: judges and reference first, then its cells on the workers, then their records."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bench.metrics import METRICS
from bench.suite import assemble
from bench.suite.calls import CellAnswer, CellCall, lacks, made_here
from bench.suite.cell import GenerateJob
from bench.suite.embedding import Embedding
from bench.suite.inputs import note_inputs
from bench.suite.judging import JudgesOnDisk, judges_for, stored_embedding
from bench.suite.motions import Motions
from bench.suite.plan import Cell
from bench.suite.reference import build_reference, reference_key
from bench.suite.score import Scorer, ScoreSpec
from bench.suite.session import Session
from bench.suite.setting import Setting
from bench.suite.timed import job_of
from bench.suite.truth import true_answers, truth_key
from bench.suite.workers import Outcome
from reports.records import Record


@dataclass(frozen=True)
class Part:
    """What one setting of a run left: its records, and how many cells were generated and metrics computed anew."""

    records: tuple[Record, ...]
    generated: int
    scored: int


class SettingRun:
    """One protocol on one dataset: judges, reference, then all cells, ``jobs`` at a time."""

    def __init__(self, session: Session, setting: Setting) -> None:
        self.session = session
        self.request = session.request
        self.setting = setting
        self.store = session.store
        self.progress = session.progress
        self.judges = self._judges() if setting.protocol.judged else None
        self.spec = self._spec()
        self.scorer = Scorer(self.spec)

    def run(self, cells: Sequence[Cell], records_folder: Path) -> Part:
        """The records of some cells; what the store has is not done again."""
        self._ensure_reference()
        answers = {place: answer for place, cell in enumerate(cells) if (answer := self._known(cell))}
        waiting = [place for place in range(len(cells)) if place not in answers]
        calls = [self._call(cells[place]) for place in waiting]
        answers |= dict(zip(waiting, self.session.answers(calls, self._name, before=len(answers)), strict=True))
        records = [self._record(cell, answers[place], records_folder) for place, cell in enumerate(cells)]
        note_inputs(records_folder.parent, self.setting, self.spec.truth_key, cells)
        return Part(
            tuple(records),
            sum(answer.generated for answer in answers.values()),
            sum(len(answer.scored) for answer in answers.values()),
        )

    @property
    def _name(self) -> str:
        return f"{self.setting.protocol.label} on {self.setting.dataset.dataset_id}"

    def _judges(self) -> JudgesOnDisk:
        return judges_for(
            self.setting.dataset,
            self.setting.split,
            self.store,
            retrain=self.request.retrain_judges,
            progress=lambda what, done, total: self.progress("judges", what, done, total),
        )

    def _spec(self) -> ScoreSpec:
        setting, judges = self.setting, self.judges
        judges_digest = judges.judges.digest if judges else ""
        names = setting.protocol.metrics
        known = truth_key(setting) if setting.protocol.truth_metrics else ""
        if known:
            names = (*names, *setting.protocol.truth_metrics)
        return ScoreSpec(
            store=str(self.store.root),
            pack=str(setting.pack_folder),
            tasks_file=str(setting.write_tasks(self.store)),
            judges_folder=str(judges.folder) if judges else "",
            judges_digest=judges_digest,
            reference_key=reference_key(setting, judges_digest),
            truth_key=known,
            protocol=setting.protocol.label,
            profile=setting.profile,
            metrics=tuple((name, METRICS[name].version) for name in names),
            content_labels=setting.content_labels,
            style_labels=setting.dataset.style_labels,
            fit_take_ids=setting.fit_take_ids,
        )

    def _ensure_reference(self) -> None:
        if self.spec.truth_key and not self.store.has("truth", self.spec.truth_key):
            self.progress("reference", "rendering true answers", 0, 1)
            self.store.put("truth", self.spec.truth_key, lambda folder: true_answers(self.setting, folder))
        key = self.spec.reference_key
        if self.judges and not self.store.has("reference", key):
            self.progress("reference", "judging real motion", 0, 1)
            judges, basis = self.judges.judges, self.scorer.basis

            def embedded(motions: Motions) -> Embedding:
                return stored_embedding(judges, motions, self.store)

            self.store.put(
                "reference", key, lambda folder: build_reference(self.setting, judges, embedded, basis, folder)
            )
        self.progress("reference", "ready", 1, 1)

    def _known(self, cell: Cell) -> CellAnswer | None:
        """The answer of a cell that needs no work."""
        if cell.settled is not None:
            return self._answer(cell.settled)
        if self.store.has("motions", cell.motions_key):
            facts = self.store.facts("motions", cell.motions_key)
            if not self.scorer.missing(str(facts["motions_digest"]), cell.given):
                return self._answer(Outcome("ok"), facts)
        if self.request.keep_failures:
            failure = self.session.failures.recall(assemble.record_key(self.setting, cell))
            if failure is not None:
                return self._answer(failure)
        return None

    def _answer(self, outcome: Outcome, facts: Mapping[str, Any] | None = None) -> CellAnswer:
        return CellAnswer(outcome, made_here(self.request.command, self.request.limits.threads, facts or {}))

    def _call(self, cell: Cell) -> CellCall:
        protocol, spec = self.setting.protocol, self.spec
        needs = [("takes", self.setting.pack_folder.name)]
        needs += [("truth", spec.truth_key)] if spec.truth_key else []
        needs += [("reference", spec.reference_key)] if spec.judges_folder else []
        job = GenerateJob(cell.motions_key, spec.tasks_file, protocol.track, protocol.fps)
        return CellCall(
            name=assemble.record_key(self.setting, cell),
            folder=str(self.session.folder),
            wanted=self.session.wanted,
            needs=tuple(needs),
            job=job_of(self.setting, cell, self.store, job),
            spec=spec,
            given=cell.given,
            limits=self.request.limits,
            logs=self.session.logs,
            command=self.request.command,
        )

    def _record(self, cell: Cell, answer: CellAnswer, folder: Path) -> Record:
        outcome = self._visible(cell) if answer.outcome.status == "ok" else answer.outcome
        self.session.failures.note(assemble.record_key(self.setting, cell), outcome)
        if outcome.status != "ok":
            record = assemble.record_of(self.setting, cell, outcome, answer.made)
            assemble.write(folder, record)
            return record
        scores = self.scorer.collect(cell.motions_key, given=cell.given)
        arrays = assemble.sample_arrays(scores)
        record = assemble.record_of(
            self.setting,
            cell,
            outcome,
            answer.made,
            measurements=tuple(m for scored in scores.scored.values() for m in scored.measurements),
            arrays=arrays,
            motions_digest=scores.motions_digest,
            judges=self.judges.judges.facts if self.judges else (),
        )
        assemble.write(folder, record, arrays)
        return record

    def _visible(self, cell: Cell) -> Outcome:
        """Whether what a worker stored has arrived here."""
        wait_s = self.session.visible_within_s
        problem = lacks(self.store, [("motions", cell.motions_key)], wait_s)
        if not problem:
            digest = str(self.store.facts("motions", cell.motions_key)["motions_digest"])
            keys = self.scorer.keys(digest, cell.given).values()
            problem = lacks(self.store, [("score", key) for key in keys], wait_s)
        return Outcome("failed", problem) if problem else Outcome("ok")
