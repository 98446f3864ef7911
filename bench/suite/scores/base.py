"""What all scores share: the reference every row is scored against, the row, and the shape of a result."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray, IntArray
from bench.datasets.pack import Pack
from bench.metrics import METRICS, frechet, physics, recognition
from bench.protocols.base import Task
from bench.suite.copying import DescriptorBank
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet
from bench.suite.motions import Motions
from reports.bootstrap import interval, mean_replicates
from reports.records import Measurement

PRIMARY_SLICE = "different_content"
TAG = "slice:"
"""A task group with this prefix is a slice of its own: ``slice:intra``."""


def slices_of(
    tasks: Sequence[Task], content_labels: Sequence[str], style_labels: Sequence[str]
) -> dict[str, BoolArray]:
    """Slice name -> mask over the tasks; slices by content or style hold different-content tasks."""
    same = np.array([task.same_content for task in tasks])
    masks = {PRIMARY_SLICE: ~same, "same_content": same, "all": np.ones(len(same), dtype=bool)}
    contents = np.array([task.content for task in tasks])
    targets = np.array([task.target_style for task in tasks])
    masks |= {f"content={name}": (contents == name) & ~same for name in content_labels}
    masks |= {f"style={name}": (targets == name) & ~same for name in style_labels}
    parts = list(dict.fromkeys(task.part for task in tasks if task.part))
    masks |= {f"part={name}": np.array([task.part == name for task in tasks]) for name in parts}
    lengths = sorted({task.n_frames for task in tasks})
    if len(lengths) > 1:
        masks |= {f"frames={n}": np.array([task.n_frames == n for task in tasks]) for n in lengths}
    tags = sorted({task.group for task in tasks if task.group.startswith(TAG)})
    masks |= {tag.removeprefix(TAG): np.array([task.group == tag for task in tasks]) for tag in tags}
    return {name: mask for name, mask in masks.items() if mask.any()}


@dataclass(frozen=True, eq=False)
class Labelled:
    """Judge outputs of windows with their true label indices ``[n]``."""

    embedding: Embedding
    contents: IntArray
    styles: IntArray


@dataclass(frozen=True, eq=False, kw_only=True)
class Basis:
    """What all rows of a setting share, judged or not.

    Attributes
    ----------
    tasks : what is scored, one a sample; clusters are content takes.
    content_labels, style_labels : indices refer to them.
    counts : ``[B, n]`` bootstrap counts shared by all rows.
    pack : every take by its id, with the labels of the setting.
    fit_take_ids : what methods are trained on.
    truth : the true answer of every sample, where the dataset knows it.
    trials : draws for metrics that are means over trials, each ``[m]`` sample indices.
    """

    tasks: Sequence[Task]
    content_labels: tuple[str, ...]
    style_labels: tuple[str, ...]
    counts: NDArray[np.int32]
    pack: Pack
    fit_take_ids: tuple[str, ...] = ()
    truth: Motions | None = None
    trials: tuple[IntArray, ...] = ()

    @cached_property
    def slices(self) -> dict[str, BoolArray]:
        """Slice name -> mask over the tasks."""
        return slices_of(self.tasks, self.content_labels, self.style_labels)

    def present(self, names: Iterable[str]) -> list[str]:
        """Those of the named slices that hold a task."""
        return [name for name in names if name in self.slices]


@dataclass(frozen=True, eq=False, kw_only=True)
class Reference(Basis):
    """What every row of a judged protocol on a dataset is scored against.

    Attributes
    ----------
    real : windows of the real part.
    floor : n windows of other real motion under their own labels.
    style_components, content_components : per judge seed, 16 principal components fitted on the judge part.
    activations : clip cut -> 512 auto-encoder activations of the real windows ``[S, m, 512]``; empty where no metric
        needs them.
    fit_bank, test_bank : descriptors of motion that methods were given; None where no metric looks for copies.
    copy_threshold : distance below which an output is a copy.
    floor_jerk : jerk ``[n]`` of the floor windows, which are drawn the way sources are, m/s^3.
    floors : metric name -> the distance of ``floor`` from ``real``.
    judges : asked where stored outputs do not say enough.
    """

    real: Labelled
    floor: Labelled
    style_components: tuple[frechet.PrincipalComponents, ...]
    content_components: tuple[frechet.PrincipalComponents, ...]
    activations: Mapping[str, NDArray[np.float32]]
    fit_bank: DescriptorBank | None
    test_bank: DescriptorBank | None
    copy_threshold: float
    floor_jerk: FloatArray
    floors: Mapping[str, float]
    judges: JudgeSet | None = None


@dataclass(frozen=True, eq=False)
class PlainRow:
    """One cell's motions beside their sources."""

    motions: Motions
    source: Motions

    @cached_property
    def positions_m(self) -> FloatArray:
        """World positions of the outputs ``[n, T, 21, 3]``."""
        return self.motions.world_positions()

    @cached_property
    def source_positions_m(self) -> FloatArray:
        """World positions of the sources ``[n, T, 21, 3]``."""
        return self.source.world_positions()

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Joints that no skeleton of the row has as virtual."""
        return self.motions.real_joints


@dataclass(frozen=True, eq=False)
class Row(PlainRow):
    """One cell's motions with what the judges say of them.

    ``given`` is False for rows that were not given a source and a reference (real motion, oracles): their copied share
    is taken against the fit part alone. ``source_styles`` is -1 where the source's style is none of this dataset's.
    """

    embedding: Embedding
    contents: IntArray
    styles: IntArray
    source_styles: IntArray
    given: bool

    @cached_property
    def jerk(self) -> FloatArray:
        """Mean jerk of each output, ``[n]`` m/s^3."""
        return physics.jerk_per_sample(self.positions_m, self.motions.fps, joints=self.joints)

    @cached_property
    def content_correct(self) -> BoolArray:
        """``[S, n]`` content right, by judge seed."""
        return np.stack([recognition.correct(self.contents, seen) for seen in self.embedding.content_predicted])

    @cached_property
    def style_correct(self) -> BoolArray:
        """``[S, n]`` style right, by judge seed."""
        return np.stack([recognition.correct(self.styles, seen) for seen in self.embedding.style_predicted])


@dataclass(frozen=True, eq=False)
class Scored:
    """One metric of one row."""

    measurements: tuple[Measurement, ...]
    per_sample: dict[str, FloatArray] = field(default_factory=dict)
    replicates: dict[str, FloatArray] = field(default_factory=dict)


AnyRow = TypeVar("AnyRow", bound=PlainRow, contravariant=True)
AnyBasis = TypeVar("AnyBasis", bound=Basis, contravariant=True)


class AnyScore(Protocol[AnyRow, AnyBasis]):
    """One metric of one row."""

    def __call__(self, row: AnyRow, basis: AnyBasis, /) -> Scored: ...


def measure(
    name: str,
    slice_name: str,
    value: float,
    n: int,
    *,
    replicates: FloatArray | None = None,
    judge_values: Sequence[float] = (),
    floor: float | None = None,
    details: dict[str, float] | None = None,
    reason: str = "",
) -> Measurement:
    """A measurement with unit, version and direction from METRICS; a NaN becomes None and needs ``reason``."""
    metric = METRICS[name]
    known = bool(np.isfinite(value))
    spread = {"judge_spread": float(np.std(judge_values, ddof=1))} if len(judge_values) > 1 else {}
    low, high = interval(value, replicates) if known and replicates is not None else (float("nan"), float("nan"))
    return Measurement(
        name=name,
        version=metric.version,
        slice=slice_name,
        value=float(value) if known else None,
        unit=metric.unit,
        better=metric.better,
        n=n,
        low=low if np.isfinite(low) else None,
        high=high if np.isfinite(high) else None,
        judge_values=tuple(float(v) for v in judge_values),
        floor=floor,
        details={**(details or {}), **spread},
        reason=reason or None,
    )


def share_score(
    name: str,
    correct: FloatArray,
    reference: Reference,
    *,
    slices: Sequence[str],
    details: dict[str, float] | None = None,
) -> Scored:
    """A percent metric from per-judge, per-sample hits ``[S, n]`` (NaN = does not count)."""
    per_sample = 100.0 * recognition.share_of_judges(correct)
    measurements, replicates = [], {}
    for slice_name in reference.present(slices):
        mask = reference.slices[slice_name]
        shares = [recognition.percent(hits[mask]) for hits in correct]
        draws = mean_replicates(per_sample[mask], reference.counts[:, mask])
        replicates[f"{name}|{slice_name}"] = draws
        values = [share.percent for share in shares]
        value = float(np.mean(values))
        measurements.append(
            measure(name, slice_name, value, shares[0].n, replicates=draws, judge_values=values, details=details)
        )
    return Scored(tuple(measurements), {name: per_sample}, replicates)


def mean_score(
    name: str,
    values: FloatArray,
    basis: Basis,
    *,
    slices: Sequence[str],
    details: dict[str, float] | None = None,
    undefined: str = "",
) -> Scored:
    """A metric that is the mean of per-sample values ``[n]``; NaN values do not count and are explained."""
    measurements, replicates = [], {}
    for slice_name in basis.present(slices):
        mask = basis.slices[slice_name] & np.isfinite(values)
        left_out = int(basis.slices[slice_name].sum() - mask.sum())
        reason = f"{left_out} samples left out: {undefined}" if left_out else ""
        if not mask.any():
            measurements.append(measure(name, slice_name, float("nan"), 0, reason=undefined or "no sample"))
            continue
        draws = mean_replicates(values[mask], basis.counts[:, mask])
        replicates[f"{name}|{slice_name}"] = draws
        measurements.append(
            measure(
                name, slice_name, float(values[mask].mean()), int(mask.sum()), replicates=draws, details=details,
                reason=reason,
            )
        )  # fmt: skip
    return Scored(tuple(measurements), {name: values}, replicates)
