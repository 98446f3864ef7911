"""What all scores share: the reference every row is scored against, the row, and the shape of a result."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray, IntArray
from bench.metrics import METRICS, frechet, physics, recognition
from bench.protocols.base import Task
from bench.suite.copying import DescriptorBank
from bench.suite.embedding import Embedding
from bench.suite.motions import Motions
from reports.bootstrap import interval, mean_replicates
from reports.records import Measurement

PRIMARY_SLICE = "different_content"


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
    return {name: mask for name, mask in masks.items() if mask.any()}


@dataclass(frozen=True, eq=False)
class Labelled:
    """Judge outputs of windows with their true label indices ``[n]``."""

    embedding: Embedding
    contents: IntArray
    styles: IntArray


@dataclass(frozen=True, eq=False)
class Reference:
    """What every row of a protocol on a dataset is scored against.

    Attributes
    ----------
    tasks : the protocol's fixed list; clusters are content takes.
    content_labels, style_labels : judged labels; indices refer to them.
    real : windows of the real part.
    floor : n windows of the fit part under their own labels: real motion at the same n.
    style_components, content_components : per judge seed, 16 principal components fitted on the judge part.
    fit_bank, test_bank : descriptors of motion that methods were given.
    copy_threshold : distance below which an output is a copy.
    floor_jerk : jerk ``[n]`` of the floor windows, which are drawn the way sources are, m/s^3.
    floors : metric name -> the distance of ``floor`` from ``real``.
    counts : ``[B, n]`` bootstrap counts shared by all rows.
    """

    tasks: Sequence[Task]
    content_labels: tuple[str, ...]
    style_labels: tuple[str, ...]
    real: Labelled
    floor: Labelled
    style_components: tuple[frechet.PrincipalComponents, ...]
    content_components: tuple[frechet.PrincipalComponents, ...]
    fit_bank: DescriptorBank
    test_bank: DescriptorBank
    copy_threshold: float
    floor_jerk: FloatArray
    floors: Mapping[str, float]
    counts: NDArray[np.int32]

    @cached_property
    def slices(self) -> dict[str, BoolArray]:
        """Slice name -> mask over the tasks."""
        return slices_of(self.tasks, self.content_labels, self.style_labels)


@dataclass(frozen=True, eq=False)
class Row:
    """One cell's motions with what the judges say of them.

    ``given`` is False for rows that were not given a source and a reference (real motion, oracles): their copied share
    is taken against the fit part alone.
    """

    motions: Motions
    embedding: Embedding
    source: Motions
    contents: IntArray
    styles: IntArray
    source_styles: IntArray
    given: bool

    @cached_property
    def positions_m(self) -> FloatArray:
        """World positions of the outputs ``[n, T, 21, 3]``."""
        return self.motions.world_positions()

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

    @cached_property
    def joints(self) -> tuple[int, ...]:
        """Joints that no skeleton of the row has as virtual."""
        return tuple(np.flatnonzero(~self.motions.virtual.any(axis=0)).tolist())


@dataclass(frozen=True, eq=False)
class Scored:
    """One metric of one row."""

    measurements: tuple[Measurement, ...]
    per_sample: dict[str, FloatArray] = field(default_factory=dict)
    replicates: dict[str, FloatArray] = field(default_factory=dict)


Score = Callable[[Row, Reference], Scored]


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
        details=details or {},
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
    for slice_name in slices:
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
