"""How a row's number would move on other tasks: bootstrap replicates from samples files."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reports.bootstrap import Layout
from reports.records import BadRecord
from reports.rows import Row, Samples

CONTENT_SLICE = "slice/content="
SINGLE_PRECISION = 1e-4
"""Per-sample values are stored as float32, the number they are the mean of is not."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Replicates of one number of one row, averaged over its records.

    Attributes
    ----------
    replicates : ``[B]``.
    degrees_of_freedom : of their spread.
    stored : ``[200]`` replicates of the samples files, takes drawn from all contents alike.
    n_clusters : content takes in the slice.
    values : ``[n]`` what the number is the mean of, one value a sample of the slice; None for numbers of whole sets.
    layout : of those samples; None with a single take.
    """

    replicates: NDArray[np.float64]
    degrees_of_freedom: float
    stored: NDArray[np.float64]
    n_clusters: int
    values: NDArray[np.float64] | None = None
    layout: Layout | None = None


def draws_of(row: Row, metric: str, slice_name: str) -> Draws | None:
    """How a number would move on other tasks, or None if a record does not say.

    Numbers that are means over samples are drawn anew, takes within contents (:class:`reports.bootstrap.Layout`), in
    the same way for all rows scored on the same samples. Of the others the stored replicates are taken.

    Raises
    ------
    BadRecord : replicates of one row differ in number, or are shares where the record says percent.
    """
    stored = _stored_replicates(row, metric, slice_name)
    if stored is None:
        return None
    n_clusters = len(np.unique(row.samples[0]["cluster"][_inside(row.samples[0], slice_name)]))
    values = _values_of(row, metric, slice_name)
    if values is None or n_clusters < 2:
        return Draws(stored, n_clusters - 1.0, stored, n_clusters)
    layout = _layout_of(row.samples[0], slice_name)
    replicates = np.asarray(np.mean([layout.replicates(one) for one in values], axis=0), dtype=np.float64)
    mean = np.asarray(np.mean(values, axis=0), dtype=np.float64)
    freedom = layout.degrees_of_freedom(mean) if np.isfinite(mean).any() else n_clusters - 1.0
    return Draws(replicates, freedom, stored, n_clusters, mean, layout)


def paired_draws(a: Draws, b: Draws) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """Replicates of two rows drawn in the same way, and the degrees of freedom of the spread of their difference.

    Both rows must have been scored on the same samples.
    """
    if a.layout is not None and a.values is not None and b.values is not None:
        difference = a.values - b.values
        if np.isfinite(difference).any():
            return a.replicates, b.replicates, a.layout.degrees_of_freedom(difference)
    return a.stored, b.stored, a.n_clusters - 1.0


def _stored_replicates(row: Row, metric: str, slice_name: str) -> NDArray[np.float64] | None:
    """Mean over the row's records ``[B]``."""
    name = f"replicates/{metric}|{slice_name}"
    if not row.samples or len(row.samples) < len(row.ok) or any(name not in samples for samples in row.samples):
        return None
    stacks = [np.asarray(samples[name], dtype=np.float64) for samples in row.samples]
    if len({stack.shape for stack in stacks}) != 1 or stacks[0].ndim != 1:
        raise BadRecord(f"{row.method.name}: {name} must be [B] in every samples file, got {[s.shape for s in stacks]}")
    mean = np.asarray(np.mean(stacks, axis=0), dtype=np.float64)
    for measurement in row.measurements(metric, slice_name):
        if measurement.unit == "%" and (measurement.value or 0.0) > 5.0 and float(np.nanmax(mean)) <= 1.0:
            raise BadRecord(f"{row.method.name}: {name} are shares up to 1, but the record's value is in percent")
    return mean


def _values_of(row: Row, metric: str, slice_name: str) -> list[NDArray[np.float64]] | None:
    """Per record, the values ``[n]`` in the slice that the number is the mean of; None if it is not their mean."""
    found = []
    for record, samples in zip(row.ok, row.samples, strict=True):
        measurement, values = record.find(metric, slice_name), samples.get(f"per_sample/{metric}")
        if measurement is None or measurement.value is None or values is None:
            return None
        inside = np.asarray(values, dtype=np.float64)[_inside(samples, slice_name)]
        known = inside[np.isfinite(inside)]
        if not known.size:
            return None
        if not np.isclose(known.mean(), measurement.value, rtol=SINGLE_PRECISION, atol=SINGLE_PRECISION):
            return None
        found.append(inside)
    return found


def _layout_of(samples: Samples, slice_name: str) -> Layout:
    """Takes and contents of the samples in a slice; those of unknown content count as one content."""
    contents = np.full(len(samples["cluster"]), "", dtype=object)
    for name in samples:
        if name.startswith(CONTENT_SLICE):
            contents[np.asarray(samples[name], dtype=bool)] = name
    # These slices leave out tasks whose reference shows the source's content; their takes are in other tasks too.
    of_take = {take: content for take, content in zip(samples["cluster"], contents, strict=True) if content}
    inside = _inside(samples, slice_name)
    takes = samples["cluster"][inside]
    return Layout.of(takes, np.array([of_take.get(take, "") for take in takes]))


def _inside(samples: Samples, slice_name: str) -> NDArray[np.bool_]:
    everything = np.ones(len(samples["cluster"]), dtype=bool)
    return np.asarray(samples.get(f"slice/{slice_name}", everything), dtype=bool)
