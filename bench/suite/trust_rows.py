"""One row of a run under both judge families: its numbers by seed, by kind of source, and with sessions in mind."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray, IntArray
from bench.datasets.take import Take
from bench.metrics.frechet import PrincipalComponents
from bench.metrics.kernel import LabelledFeatures, conditional_kid
from bench.protocols.base import neutral_style
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet
from bench.suite.judging import stored_embedding
from bench.suite.motions import Motions
from bench.suite.reference import (
    CONDITIONAL_COMPONENTS,
    JUDGE_STRIDE_FRAMES,
    REAL_STRIDE_FRAMES,
    floor_windows,
    label_indices,
    windows_of,
)
from bench.suite.scores import SCORES
from bench.suite.scores.base import PRIMARY_SLICE, Labelled, Reference, Row
from bench.suite.scores.distances import floors
from bench.suite.second_judges import SecondJudges
from bench.suite.setting import Setting
from bench.suite.store import Store
from reports.bootstrap import Layout, interval
from reports.records import Measurement, Record, read_samples
from reports.rows import StoredRecord
from reports.trust import JudgedNumber, SessionNumbers, Source, SplitNumber, TrustRow

SPLIT_METRICS = ("joint_recognition", "cra", "sra")
FIRST_ONLY = ("fmd[dae]",)
"""Metrics of judges that the second family does not have."""


@dataclass(frozen=True, eq=False)
class Judged:
    """One row's motions with what both families say of them."""

    motions: Motions
    first: Embedding
    second: Embedding


@dataclass(frozen=True, eq=False)
class Opinions:
    """What rows of one setting are compared with, under both families.

    Attributes
    ----------
    reference : the first family's, as rows were scored.
    """

    setting: Setting
    judges: JudgeSet
    second: SecondJudges
    reference: Reference
    store: Store

    def judged(self, motions: Motions) -> Judged:
        """Ask both families, or remember what they said."""
        first = stored_embedding(self.judges, motions, self.store)
        return Judged(motions, first, self.second.stored_embedding(motions, self.store))

    def row(self, stored: StoredRecord, judged: Judged) -> TrustRow:
        """Everything that is stored of one row."""
        record = stored.record
        answers = np.array_equal(judged.motions.styles, [task.target_style for task in self.setting.tasks])
        numbers = tuple(self._numbers(record, judged))
        return TrustRow(
            method=record.method.row_name, title=record.method.row_title, kind=record.method.kind, seed=record.seed,
            motions_digest=record.motions_digest, numbers=numbers,
            splits=tuple(self._splits(stored, judged)) if answers else (),
            sessions=self._sessions(judged, answers) if self.styles_of_session else None,
        )  # fmt: skip

    @cached_property
    def neutral(self) -> str:
        """The style without style."""
        return neutral_style(self.setting.dataset.style_labels)

    @cached_property
    def styles_of_session(self) -> dict[str, tuple[str, ...]]:
        """Session -> its styles; empty unless every take names its session and every style has one session only."""
        found = sessions_of(self.setting.takes)
        return found if sum(map(len, found.values())) == len(self.setting.dataset.style_labels) else {}

    @cached_property
    def second_reference(self) -> Reference:
        """The second family's, with one replicate that draws every sample once: no interval rests on it."""
        setting = self.setting
        asked = {
            "real": windows_of(setting.part(*setting.protocol.real_parts), REAL_STRIDE_FRAMES),
            "floor": floor_windows(setting, len(self.reference.tasks)),
        }
        sides = {name: self._labelled(motions) for name, motions in asked.items()}
        part = self.second.stored_embedding(windows_of(setting.part("judge"), JUDGE_STRIDE_FRAMES), self.store)
        whole = replace(
            self.reference,
            counts=np.ones((1, len(self.reference.tasks)), dtype=np.int32),
            real=sides["real"],
            floor=sides["floor"],
            style_components=_components(part.style_features),
            content_components=_components(part.content_features),
        )
        known = tuple(metric for metric in setting.protocol.metrics if metric not in FIRST_ONLY)
        return replace(whole, floors=floors(whole, known))

    def _labelled(self, motions: Motions) -> Labelled:
        dataset = self.setting.dataset
        contents = label_indices(motions.contents, dataset.content_labels)
        styles = label_indices(motions.styles, dataset.style_labels)
        return Labelled(self.second.stored_embedding(motions, self.store), contents, styles)

    def _numbers(self, record: Record, judged: Judged) -> Iterable[JudgedNumber]:
        row = self._second_row(judged)
        for name, found in judged_measurements(record).items():
            second: tuple[float, ...] = ()
            if name not in FIRST_ONLY:
                scored = SCORES[name](row, self.second_reference).measurements
                second = next((other.judge_values for other in scored if other.slice == found.slice), ())
            yield JudgedNumber(
                metric=name, slice=found.slice, unit=found.unit, better=found.better, first=found.judge_values,
                second=second, low=found.low, high=found.high,
            )  # fmt: skip

    def _second_row(self, judged: Judged) -> Row:
        motions, reference = judged.motions, self.second_reference
        return Row(
            motions=motions,
            source=motions,  # no judged metric looks at the source's motion
            embedding=judged.second,
            contents=label_indices(motions.contents, reference.content_labels),
            styles=label_indices(motions.styles, reference.style_labels),
            source_styles=label_indices([task.source_style for task in reference.tasks], reference.style_labels),
            given=True,
        )

    def _splits(self, stored: StoredRecord, judged: Judged) -> Iterable[SplitNumber]:
        samples = read_samples(stored.path, stored.record)
        different = np.asarray(samples[f"slice/{PRIMARY_SLICE}"], dtype=bool)
        neutral = np.array([task.source_style == self.neutral for task in self.setting.tasks])
        contents = np.array([task.content for task in self.setting.tasks])
        masks: dict[Source, BoolArray] = {"neutral": different & neutral, "other": different & ~neutral}
        for source, mask in masks.items():
            for metric in SPLIT_METRICS:
                values = np.asarray(samples[f"per_sample/{metric}"], dtype=np.float64)[mask]
                value, layout = float(values.mean()), Layout.of(samples["cluster"][mask], contents[mask])
                freedom = layout.degrees_of_freedom(values)
                low, high = interval(value, layout.replicates(values), degrees_of_freedom=freedom)
                yield SplitNumber(
                    source=source, metric=metric, value=value, low=max(low, 0.0), high=min(high, 100.0),
                    n=int(mask.sum()),
                )  # fmt: skip
            value = self._conditional_kid(judged, mask)
            yield SplitNumber(
                source=source, metric="conditional_kid", value=value, low=None, high=None, n=int(mask.sum())
            )

    def _conditional_kid(self, judged: Judged, mask: BoolArray) -> float:
        """Conditional KID of some samples under the first family, mean over seeds."""
        real, reference = self.reference.real, self.reference
        styles = label_indices(judged.motions.styles, reference.style_labels)[mask]
        contents = label_indices(judged.motions.contents, reference.content_labels)[mask]
        by_seed = [
            conditional_kid(
                LabelledFeatures(
                    real.embedding.style_features[seed], real.styles, judged.first.style_features[seed][mask], styles
                ),
                LabelledFeatures(
                    real.embedding.content_features[seed], real.contents, judged.first.content_features[seed][mask],
                    contents,
                ),
            ).value
            for seed in range(judged.first.n_seeds)
        ]  # fmt: skip
        return float(np.mean(by_seed))

    def _sessions(self, judged: Judged, answers: bool) -> SessionNumbers:
        labels = self.setting.dataset.style_labels
        place = {style: number for number, group in enumerate(self.styles_of_session.values()) for style in group}
        session_of_style = np.array([place[style] for style in labels])
        wanted = label_indices(judged.motions.styles, labels)
        sources = label_indices([task.source_style for task in self.setting.tasks], labels)
        mask = np.asarray(self.reference.slices[PRIMARY_SLICE])
        facts = session_facts(judged.first.style_log_probabilities[:, mask], wanted[mask], session_of_style)
        other = session_facts(judged.second.style_log_probabilities[:, mask], wanted[mask], session_of_style)
        same = session_of_style[sources[mask]] == session_of_style[wanted[mask]]
        right = 100.0 * (judged.first.style_predicted[:, mask] == wanted[mask])
        return SessionNumbers(
            n=int(mask.sum()), session_right=facts.session_right, within=facts.within, within_second=other.within,
            chance=facts.chance,
            same_session=float(right[:, same].mean()) if answers and same.any() else None,
            other_session=float(right[:, ~same].mean()) if answers and not same.all() else None,
            n_same=int(same.sum()) if answers else 0,
        )  # fmt: skip


@dataclass(frozen=True)
class SessionFacts:
    """Percent of outputs in the wanted session, with the wanted style likeliest within it, and the latter's chance."""

    session_right: float
    within: float
    chance: float


def session_facts(log_probabilities: NDArray[np.float32], wanted: IntArray, session_of_style: IntArray) -> SessionFacts:
    """Style recognition with sessions in mind, mean over judge seeds.

    Parameters
    ----------
    log_probabilities : ``[S, n, K]`` over styles.
    wanted : ``[n]`` style that was asked for.
    session_of_style : ``[K]`` the one session in which each style was recorded.
    """
    allowed = session_of_style[None, :] == session_of_style[wanted][:, None]
    within = np.where(allowed, log_probabilities, -np.inf).argmax(axis=-1) == wanted
    seen = session_of_style[log_probabilities.argmax(axis=-1)] == session_of_style[wanted]
    return SessionFacts(
        100.0 * float(seen.mean()), 100.0 * float(within.mean()), 100.0 * float((1.0 / allowed.sum(axis=1)).mean())
    )


def sessions_of(takes: Iterable[Take]) -> dict[str, tuple[str, ...]]:
    """Session -> its styles; empty where a take names no session."""
    found: dict[str, set[str]] = {}
    for take in takes:
        if take.session is None:
            return {}
        found.setdefault(take.session, set()).add(str(take.style))
    return {session: tuple(sorted(found[session])) for session in sorted(found)}


def judged_measurements(record: Record) -> Mapping[str, Measurement]:
    """Metric -> its measurement, of every metric that depends on a judge; in the slice that ranks where it has one."""
    found: dict[str, Measurement] = {}
    for measurement in record.measurements:
        judged = len(measurement.judge_values) > 1 and measurement.slice in (PRIMARY_SLICE, "all")
        if judged and (measurement.name not in found or measurement.slice == PRIMARY_SLICE):
            found[measurement.name] = measurement
    return found


def _components(features: NDArray[np.float32]) -> tuple[PrincipalComponents, ...]:
    return tuple(PrincipalComponents.fit(_exact(one), CONDITIONAL_COMPONENTS) for one in features)


def _exact(features: NDArray[np.float32]) -> FloatArray:
    return features.astype(np.float64)
