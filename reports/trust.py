"""How far numbers can be trusted: rows under each judge seed and both judge families, and what follows from them.

One JSON file a dataset holds everything that ``docs/trust.md`` says; ``bench.suite.trust`` measures it.
"""

from __future__ import annotations

from itertools import combinations
from pathlib import Path
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import BaseModel, ConfigDict, ValidationError
from scipy.stats import kendalltau

from reports.records import BadRecord, Better, write_text_atomically

Floats = NDArray[np.float64]
Family = Literal["first", "second"]
Source = Literal["neutral", "other"]
TAU_BAR = 0.9
"""Agreement that the two columns which rank must reach."""
BARRED = ("joint_recognition", "conditional_kid")
FEWEST_ROWS = 3


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class JudgedNumber(_Strict):
    """One metric of one row under every judge."""

    metric: str
    slice: str
    unit: str
    better: Better
    first: tuple[float, ...]
    """by judge seed; empty where undefined"""
    second: tuple[float, ...]
    """the same of the second family; empty where undefined or where it has no such judge"""
    low: float | None = None
    """lower end of the 95 % interval over tasks, first family"""
    high: float | None = None


class SplitNumber(_Strict):
    """One metric of one row on the tasks whose source is neutral, or on the others; first family, mean over seeds."""

    source: Source
    metric: str
    value: float
    low: float | None
    high: float | None
    n: int


class SessionNumbers(_Strict):
    """Style recognition of one row with the recording session in mind; percent, mean over judge seeds."""

    n: int
    session_right: float
    """outputs judged to have any style of the wanted style's session"""
    within: float
    """the wanted style is the likeliest among those of its session"""
    within_second: float
    """the same under the second family"""
    chance: float
    """of ``within``"""
    same_session: float | None = None
    """style recognition on tasks whose source is of the wanted style's session: no session has to change"""
    other_session: float | None = None
    """the same on the other tasks"""
    n_same: int = 0


class TrustRow(_Strict):
    """One row of a run."""

    method: str
    title: str
    kind: Literal["anchor", "method"]
    seed: int
    motions_digest: str
    numbers: tuple[JudgedNumber, ...]
    splits: tuple[SplitNumber, ...] = ()
    """empty for rows that do not answer the tasks, as real motion"""
    sessions: SessionNumbers | None = None
    """None where sessions are not known"""


class Curve(_Strict):
    """A set distance against the number of samples: mean and deviation over random draws, mean over judge seeds."""

    method: str
    """``floor`` is real motion of the fit part against the real part"""
    title: str
    metric: str
    n: tuple[int, ...]
    mean: tuple[float, ...]
    sd: tuple[float, ...]


class TrustJudge(_Strict):
    """One judge, as its card has it."""

    id: str
    digest: str
    target: str
    accuracy: float
    chance: float
    within_session: float | None
    within_session_chance: float | None
    unseen_actors: float | None


class TrustData(_Strict):
    """What was measured on one dataset."""

    dataset: str
    dataset_digest: str
    protocol: str
    profile: str
    n: int
    tasks_digest: str
    judges_digest: str
    second_digest: str
    neutral_style: str
    sessions: dict[str, tuple[str, ...]]
    """recording session -> its styles; empty where the dataset names no sessions"""
    draws: int
    """random draws behind each point of a curve"""
    judges: tuple[TrustJudge, ...]
    second: tuple[TrustJudge, ...]
    rows: tuple[TrustRow, ...]
    curves: tuple[Curve, ...]

    @property
    def identity(self) -> tuple[str, ...]:
        """What rows must share to be compared."""
        return (self.dataset_digest, self.protocol, self.profile, self.tasks_digest, self.judges_digest,
                self.second_digest)  # fmt: skip

    def values(self, metric: str, family: Family) -> Floats:
        """``[methods, S]`` in the order of :attr:`methods`, mean over a method's seeds; NaN where undefined."""
        by_method: dict[str, list[tuple[float, ...]]] = {name: [] for name in self.methods}
        for row in self.rows:
            for found in row.numbers:
                if found.metric == metric and getattr(found, family):
                    by_method[row.method].append(getattr(found, family))
        n_seeds = max((len(values) for rows in by_method.values() for values in rows), default=1)
        undefined = np.full(n_seeds, np.nan)
        return np.stack([np.mean(rows, axis=0) if rows else undefined for rows in by_method.values()])

    @property
    def methods(self) -> dict[str, str]:
        """Method -> title, in a fixed order."""
        return {row.method: row.title for row in sorted(self.rows, key=lambda row: (row.kind, row.method, row.seed))}


class Turned(NamedTuple):
    """Two rows that the two families order differently."""

    titles: tuple[str, str]
    """the lower one under the first family first"""
    first: tuple[float, float]
    second: tuple[float, float]
    separable: bool
    """whether their 95 % intervals under the first family leave each other out"""


class LeftOut(NamedTuple):
    """The row without which an order agrees best."""

    title: str
    first: tuple[float, ...]
    """its number by judge seed of the first family"""
    second: tuple[float, ...]
    tau: float
    """agreement without it"""


class Agreement(NamedTuple):
    """Kendall's tau of the order of rows by one metric; NaN where there is nothing to compare."""

    metric: str
    slice: str
    n_rows: int
    seeds: float
    """mean over the pairs of seeds of the first family"""
    seeds_least: float
    second_seeds: float
    """the same of the second family"""
    second_seeds_least: float
    families: float
    """between the means over seeds of both families"""
    turned: tuple[Turned, ...]
    seeds_without: LeftOut
    """of ``seeds``"""
    families_without: LeftOut
    """of ``families``"""


def order_agreement(first: ArrayLike, second: ArrayLike) -> float:
    """Kendall's tau-b between two lists of numbers of the same rows; rows that lack either do not count.

    NaN with fewer than three rows, or where one list says the same of all.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    known = np.isfinite(a) & np.isfinite(b)
    if known.sum() < FEWEST_ROWS or len(set(a[known])) == 1 or len(set(b[known])) == 1:
        return float("nan")
    return float(kendalltau(a[known], b[known]).statistic)


def agreements(data: TrustData) -> list[Agreement]:
    """The agreement of every judged metric, in the order in which rows have them."""
    slices = {found.metric: found.slice for row in data.rows for found in row.numbers}
    return [_agreement(data, metric, slice_name) for metric, slice_name in slices.items()]


def _agreement(data: TrustData, metric: str, slice_name: str) -> Agreement:
    first, second = data.values(metric, "first"), data.values(metric, "second")
    seeds, least = _between_seeds(first)
    second_seeds, second_least = _between_seeds(second)
    means = first.mean(axis=1), second.mean(axis=1)
    n_rows = int(np.isfinite(means[0]).sum())
    turned = _turned(data, metric, *means)
    families = order_agreement(*means)
    without = [np.arange(len(first)) != place for place in range(len(first))]
    return Agreement(
        metric, slice_name, n_rows, seeds, least, second_seeds, second_least, families, turned,
        _left_out(data, metric, [_between_seeds(first[kept])[0] for kept in without]),
        _left_out(data, metric, [order_agreement(means[0][kept], means[1][kept]) for kept in without]),
    )  # fmt: skip


def _left_out(data: TrustData, metric: str, taus: list[float]) -> LeftOut:
    """The row with the best agreement among those ``[rows]`` without one row each."""
    best = int(np.argmax(np.nan_to_num(taus, nan=-2.0)))
    first, second = (tuple(data.values(metric, family)[best].tolist()) for family in ("first", "second"))
    return LeftOut(list(data.methods.values())[best], first, second, taus[best])


def _between_seeds(values: Floats) -> tuple[float, float]:
    """Mean and least tau over the pairs of seeds ``[rows, S]``."""
    found = [order_agreement(values[:, a], values[:, b]) for a, b in combinations(range(values.shape[1]), 2)]
    known = [tau for tau in found if np.isfinite(tau)]
    return (float(np.mean(known)), min(known)) if known else (float("nan"), float("nan"))


def _turned(data: TrustData, metric: str, first: Floats, second: Floats) -> tuple[Turned, ...]:
    titles, spans = list(data.methods.values()), _intervals(data, metric)
    return tuple(
        Turned(
            (titles[low], titles[high]),
            (float(first[low]), float(first[high])),
            (float(second[low]), float(second[high])),
            spans[low][1] < spans[high][0],
        )
        for low, high in combinations(np.argsort(first).tolist(), 2)
        if first[low] < first[high] and second[low] > second[high]
    )


def _intervals(data: TrustData, metric: str) -> list[tuple[float, float]]:
    """Widest interval of each method over its seeds; without end where a row has none."""
    spans = {name: (np.inf, -np.inf) for name in data.methods}
    for row in data.rows:
        for found in row.numbers:
            if found.metric == metric:
                low, high = spans[row.method]
                spans[row.method] = (min(low, -np.inf if found.low is None else found.low),
                                     max(high, np.inf if found.high is None else found.high))  # fmt: skip
    return list(spans.values())


def judge_agreements(data: TrustData) -> dict[str, float]:
    """Judge id -> tau between its order of the rows and that of the other family's mean, by its target's recognition.

    Judges without enough rows are left out.
    """
    found = {}
    for target, metric in (("content", "cra"), ("style", "sra")):
        by_family = {"stgcn": data.values(metric, "first"), "temporal": data.values(metric, "second")}
        for family, other in (("stgcn", "temporal"), ("temporal", "stgcn")):
            mean = by_family[other].mean(axis=1)
            for seed in range(by_family[family].shape[1]):
                found[f"{family}-{target}/{seed}"] = order_agreement(by_family[family][:, seed], mean)
    return {judge: tau for judge, tau in found.items() if np.isfinite(tau)}


def merged(old: TrustData, new: TrustData) -> TrustData:
    """``new`` with those rows and curves of ``old`` that it does not measure again.

    Raises
    ------
    BadRecord : they were measured under other tasks, data or judges.
    """
    if old.identity != new.identity:
        differ = [a for a, b in zip(old.identity, new.identity, strict=True) if a != b]
        raise BadRecord(
            f"{new.dataset}: the stored rows were measured under another protocol, data or judges "
            f"({', '.join(differ)}); remove the stored file and give all run folders at once"
        )
    rows = {(row.method, row.seed): row for row in (*old.rows, *new.rows)}
    curves = {(curve.method, curve.metric): curve for curve in (*old.curves, *new.curves)}
    return new.model_copy(
        update={
            "rows": tuple(rows[key] for key in sorted(rows)),
            "curves": tuple(curves[key] for key in sorted(curves)),
        }
    )


def read_trust(folder: Path) -> dict[str, TrustData]:
    """Dataset -> what was measured, from a folder of stored files; empty where there is no such folder.

    Raises
    ------
    BadRecord : a file is not of this schema.
    """
    found = {}
    for path in sorted(folder.glob("*.json")):
        try:
            data = TrustData.model_validate_json(path.read_text(encoding="utf-8"))
        except ValidationError as error:
            first = error.errors()[0]
            place = ".".join(str(part) for part in first["loc"])
            raise BadRecord(f"{path}: not measured by `stylebench trust`: {place}: {first['msg']}") from error
        found[data.dataset] = data
    return found


def write_trust(folder: Path, data: TrustData) -> Path:
    """Store what was measured on one dataset."""
    path = folder / f"{data.dataset}.json"
    write_text_atomically(path, data.model_dump_json(indent=1) + "\n")
    return path


def stored_judge_agreements(folder: Path, dataset: str) -> dict[str, float]:
    """Digest of a judge -> its tau, for the judge table of a leaderboard; empty where nothing is stored."""
    data = read_trust(folder).get(dataset)
    if data is None:
        return {}
    found = judge_agreements(data)
    return {judge.digest: found[judge.id] for judge in (*data.judges, *data.second) if judge.id in found}
