"""Scores on the motion itself, without judges: copies and neighbours, jerk, speed, timing, bones."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics import memorisation, physics
from bench.motion.edit import pad_to
from bench.motion.kinematics import world_positions
from bench.motion.skeleton import CANONICAL_PARENTS
from bench.protocols.transfer import WINDOW_FRAMES
from bench.suite.copying import DescriptorBank
from bench.suite.scores.base import PRIMARY_SLICE, Reference, Row, Scored, measure, share_score
from reports.bootstrap import mean_replicates

SAME_MOTION_STATURES = 1e-3
"""Two windows nearer than this, under 2 mm on an adult, are one motion."""


def copied_share(row: Row, reference: Reference) -> Scored:
    """Outputs nearer to the fit part, their source or their style reference than the copy threshold.

    Raises
    ------
    BadInput : the reference was built without the motion that methods were given.
    """
    if reference.fit_bank is None or reference.test_bank is None:
        raise BadInput("a search for copies needs the motion that methods were given", where="reference")
    queries = memorisation.pose_descriptors(row.motions.window_positions)
    distances = reference.fit_bank.nearest(queries)
    if row.given:
        for takes in ([t.content_take_id for t in reference.tasks], [t.style_take_id for t in reference.tasks]):
            distances = np.minimum(distances, reference.test_bank.nearest_of_take(queries, takes))
    hits = memorisation.copied(distances, reference.copy_threshold).astype(np.float64)[None]
    scored = share_score(
        "copied_share",
        hits,
        reference,
        slices=("all", PRIMARY_SLICE),
        details={"threshold_statures": reference.copy_threshold},
    )
    return Scored(scored.measurements, scored.per_sample | {"copy_distance": distances}, scored.replicates)


def neighbour_ratio(row: Row, reference: Reference) -> Scored:
    """Median nearest distance to the fit part over that to the test part, less the task's own source and style take.

    The larger of the two is thinned to the size of the smaller, whole takes at a time.

    Raises
    ------
    BadInput : the reference was built without the motion that methods were given.
    """
    if reference.fit_bank is None or reference.test_bank is None:
        raise BadInput("a search for neighbours needs the motion that methods were given", where="reference")
    name, queries = "neighbour_ratio", memorisation.pose_descriptors(row.motions.window_positions)
    fit, test = _equally_large(reference.fit_bank, reference.test_bank)
    to_fit, to_test = fit.nearest(queries), _nearest_other(queries, test, reference)
    details = {
        "median_to_fit": float(np.median(to_fit)),
        "median_to_test": float(np.median(to_test)),
        "windows_of_fit": float(len(fit.descriptors)),
        "windows_of_test": float(len(test.descriptors)),
    }
    per_sample = {"fit_distance": to_fit, "test_distance": to_test}
    if details["median_to_test"] < SAME_MOTION_STATURES:
        reason = "undefined: the outputs are themselves motion of the test part"
        return Scored((measure(name, "all", float("nan"), row.motions.n, details=details, reason=reason),), per_sample)
    value = memorisation.neighbour_ratio(to_fit, to_test)
    draws = np.array(
        [
            memorisation.neighbour_ratio(np.repeat(to_fit, count), np.repeat(to_test, count))
            for count in reference.counts
        ]
    )
    found = measure(name, "all", value, row.motions.n, replicates=draws, details=details)
    return Scored((found,), per_sample, {f"{name}|all": draws})


def _equally_large(fit: DescriptorBank, test: DescriptorBank) -> tuple[DescriptorBank, DescriptorBank]:
    share = len(test.descriptors) / len(fit.descriptors)
    return (_thinned(fit, share), test) if share < 1.0 else (fit, _thinned(test, 1.0 / share))


def _thinned(bank: DescriptorBank, share: float) -> DescriptorBank:
    """Evenly spread takes that hold about this share of a bank's windows."""
    n = len(bank.take_ids)
    kept = np.unique(np.linspace(0, n - 1, max(1, round(share * n))).round().astype(np.int64))
    rows = np.isin(bank.take_index, kept)
    return DescriptorBank(bank.descriptors[rows], bank.take_index[rows], bank.take_ids)


def _nearest_other(queries: NDArray[np.float32], test: DescriptorBank, reference: Reference) -> FloatArray:
    """Distance to the nearest test window that is neither of the source nor of the style reference."""
    index = {take_id: number for number, take_id in enumerate(test.take_ids)}
    own = np.array([[index[t.content_take_id], index[t.style_take_id]] for t in reference.tasks])
    return memorisation.nearest_distance(queries, test.descriptors, query_groups=own, bank_groups=test.take_index)


def jerk_ratio(row: Row, reference: Reference) -> Scored:
    """Mean jerk over that of real motion with the same mixture of contents."""
    of_floor = [reference.floor_jerk[reference.floor.contents == c] for c in range(len(reference.content_labels))]
    expected = np.array([values.mean() if len(values) else np.nan for values in of_floor])
    return _ratio("jerk_ratio", row.jerk, expected, row, reference)


def speed_ratio(row: Row, reference: Reference) -> Scored:
    """Mean joint speed over that of the fit part with the same mixture of contents."""
    speed = physics.speed_per_sample(row.positions_m, row.motions.fps, joints=row.joints)
    return _ratio("speed_ratio", speed, _fit_speed(reference, row.joints), row, reference)


@lru_cache(maxsize=1)
def _fit_speed(reference: Reference, joints: tuple[int, ...]) -> FloatArray:
    """Mean joint speed of the fit part by content, m/s; NaN for a content that it lacks."""
    by_content: dict[str, list[float]] = {name: [] for name in reference.content_labels}
    for take_id in reference.fit_take_ids:
        take = reference.pack.take(take_id)
        positions = world_positions(pad_to(take.clip, WINDOW_FRAMES))
        by_content[str(take.content)].append(
            float(physics.speed_per_sample(positions[None], take.clip.fps, joints=joints)[0])
        )
    return np.array([np.mean(speeds) if speeds else np.nan for speeds in by_content.values()])


def _ratio(name: str, values: FloatArray, per_content: FloatArray, row: Row, reference: Reference) -> Scored:
    """Mean of ``values`` ``[n]`` over that of real motion ``per_content`` ``[K]``, mixed as outputs' contents are."""
    expected = per_content[row.contents]
    comparable = np.isfinite(expected)
    contents = [s for s in reference.slices if s.startswith("content=")]
    measurements, replicates = [], {}
    for slice_name in reference.present(("all", PRIMARY_SLICE, *contents)):
        mask = reference.slices[slice_name] & comparable
        left_out = int((reference.slices[slice_name] & ~comparable).sum())
        reason = f"{left_out} samples left out: no real motion of their content to compare with" if left_out else ""
        if not mask.any():
            measurements.append(measure(name, slice_name, float("nan"), 0, reason=reason))
            continue
        counts = reference.counts[:, mask]
        draws = mean_replicates(values[mask], counts) / mean_replicates(expected[mask], counts)
        replicates[f"{name}|{slice_name}"] = draws
        value = physics.ratio_to_reference(expected[mask], values[mask])
        measurements.append(measure(name, slice_name, value, int(mask.sum()), replicates=draws, reason=reason))
    return Scored(tuple(measurements), {name.removesuffix("_ratio"): values}, replicates)


def jerk_ratio_worst_content(row: Row, reference: Reference) -> Scored:
    """The per-content jerk ratio that is farthest from 1, as a factor."""
    ratios = physics.ratio_per_content(reference.floor_jerk, reference.floor.contents, row.jerk, row.contents)
    with np.errstate(divide="ignore"):
        worst = max(ratios, key=lambda content: abs(np.log(ratios[content])))
    details = {f"content={reference.content_labels[c]}": ratio for c, ratio in ratios.items()}
    return Scored((measure("jerk_ratio_worst_content", "all", ratios[worst], row.motions.n, details=details),))


def time_correlation(row: Row, reference: Reference) -> Scored:
    """Correlation over time with the source."""
    values = physics.time_correlation(row.source.window_positions, row.motions.window_positions, joints=row.joints)
    measurements, replicates = [], {}
    for slice_name in reference.present(("all", PRIMARY_SLICE)):
        mask = reference.slices[slice_name] & np.isfinite(values)
        if not mask.any():
            reason = "undefined: the outputs do not move"
            measurements.append(measure("time_correlation", slice_name, float("nan"), 0, reason=reason))
            continue
        draws = mean_replicates(values[mask], reference.counts[:, mask])
        replicates[f"time_correlation|{slice_name}"] = draws
        measurements.append(
            measure("time_correlation", slice_name, float(values[mask].mean()), int(mask.sum()), replicates=draws)
        )
    return Scored(tuple(measurements), {"time_correlation": values}, replicates)


def bone_drift(row: Row, reference: Reference) -> Scored:
    """Departure of bone lengths from the output's own skeleton."""
    lengths = np.linalg.norm(row.motions.offsets_m, axis=-1)[row.motions.skeleton_index]
    values = physics.bone_drift(row.positions_m, CANONICAL_PARENTS, lengths)
    found = measure(
        "bone_drift", "all", float(values.mean()), len(values), replicates=mean_replicates(values, reference.counts)
    )
    return Scored((found,), {"bone_drift": values})
