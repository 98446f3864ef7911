"""Scores of the parts track: which joints move when one body part is to change (Motion Puzzle 2022, Table 1)."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from bench.arrays import FloatArray
from bench.metrics import locality
from bench.metrics.paired import rotation_errors_deg
from bench.motion.skeleton import CANONICAL_NAMES, N_JOINTS, PARTS
from bench.suite.scores.base import Basis, PlainRow, Scored, measure

WHOLE = "all"
"""The group that leaves no joint untouched: it has displacements, but no leak."""


def rotation_leak(row: PlainRow, basis: Basis) -> Scored:
    """Change of local rotations outside over inside the part."""
    return _leak("leak_ratio", _rotation_change_deg(row), row, basis)


def position_leak(row: PlainRow, basis: Basis) -> Scored:
    """Displacement of joints outside over inside the part, from squared displacements."""
    return _leak("leak_ratio[position]", displacements(row, squared=True), row, basis)


def mean_squared_displacement(row: PlainRow, basis: Basis) -> Scored:
    """The paper's quantity: mean squared displacement, statures squared."""
    return _displacement("locality_msd", displacements(row, squared=True), row, basis)


def mean_displacement(row: PlainRow, basis: Basis) -> Scored:
    """Plain distance instead of its square, statures."""
    return _displacement("locality_distance", displacements(row, squared=False), row, basis)


def joints_above(name: str, threshold: float, row: PlainRow, basis: Basis) -> Scored:
    """How many joints are displaced by more than the threshold; the details name them with their displacement."""
    change = displacements(row, squared=True)
    measurements = []
    for part in _parts(basis):
        rows = basis.slices[f"part={part}"]
        mean = change[rows].mean(axis=0)
        above = locality.joints_above(mean, threshold, _virtual(row))
        details = {f"{joint:02d} {CANONICAL_NAMES[joint]}": float(mean[joint]) for joint in above}
        measurements.append(measure(name, f"part={part}", float(len(above)), int(rows.sum()), details=details))
    return Scored(tuple(measurements))


def displacements(row: PlainRow, *, squared: bool) -> FloatArray:
    """``[n, 21]`` displacement of every joint of every sample."""
    statures = row.motions.statures_m
    pairs = zip(row.source_positions_m, row.positions_m, statures, strict=True)
    return np.stack([locality.joint_displacement(s, o, float(h), squared=squared) for s, o, h in pairs])


def _rotation_change_deg(row: PlainRow) -> FloatArray:
    pairs = zip(row.source.window_rotations_wxyz, row.motions.window_rotations_wxyz, strict=True)
    return np.stack([rotation_errors_deg(source, output).mean(axis=0) for source, output in pairs])


def _parts(basis: Basis) -> list[str]:
    return [name.removeprefix("part=") for name in basis.slices if name.startswith("part=")]


def _virtual(row: PlainRow) -> list[int]:
    return [joint for joint in range(N_JOINTS) if joint not in row.joints]


def _leak(name: str, change: FloatArray, row: PlainRow, basis: Basis) -> Scored:
    """Ratio of mean changes over all samples of a part; ``all`` is the mean over the parts where it is defined."""
    virtual = _virtual(row)
    values, draws, measurements = [], [], []
    for part in _parts(basis):
        rows = basis.slices[f"part={part}"]
        touched = PARTS[part]
        ratio = _ratio_of(touched, virtual)
        value = ratio(change[rows].mean(axis=0))
        replicates = _replicates(change[rows], basis.counts[:, rows], ratio)
        if np.isfinite(value):
            values.append(value)
            draws.append(replicates)
        reason = "no joint is outside the part" if part == WHOLE else "undefined: the part did not move"
        measurements.append(
            measure(name, f"part={part}", value, int(rows.sum()), replicates=replicates,
                    reason="" if np.isfinite(value) else reason)
        )  # fmt: skip
    n = int(sum(basis.slices[f"part={part}"].sum() for part in _parts(basis) if part != WHOLE))
    if not values:
        return Scored((measure(name, "all", float("nan"), n, reason="undefined: no part moved"), *measurements))
    together = np.mean(draws, axis=0)
    first = measure(name, "all", float(np.mean(values)), n, replicates=together)
    return Scored((first, *measurements), {}, {f"{name}|all": together})


def _ratio_of(touched: tuple[int, ...], virtual: list[int]) -> Callable[[FloatArray], float]:
    return lambda displacement: locality.leak_ratio(displacement, touched, virtual)


def _replicates(change: FloatArray, counts: np.ndarray[tuple[int, ...], np.dtype[np.int32]],
                ratio: Callable[[FloatArray], float]) -> FloatArray:  # fmt: skip
    """The ratio under each replicate's counts ``[B, n]``."""
    totals = np.maximum(counts.sum(axis=1, keepdims=True), 1)
    return np.array([ratio(mean) for mean in counts @ change / totals])


def _displacement(name: str, change: FloatArray, row: PlainRow, basis: Basis) -> Scored:
    """Mean over the joints of the part; the details hold every joint that counts, for the heat map."""
    measurements = []
    for part in _parts(basis):
        rows = basis.slices[f"part={part}"]
        mean = change[rows].mean(axis=0)
        inside = [joint for joint in PARTS[part] if joint in row.joints]
        details = {f"{joint:02d} {CANONICAL_NAMES[joint]}": float(mean[joint]) for joint in row.joints}
        measurements.append(measure(name, f"part={part}", float(mean[inside].mean()), int(rows.sum()), details=details))
    return Scored(tuple(measurements))
