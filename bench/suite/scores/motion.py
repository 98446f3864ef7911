"""Scores on the motion itself, without judges: copies, jerk, timing, bones."""

from __future__ import annotations

import numpy as np

from bench.errors import BadInput
from bench.metrics import memorisation, physics
from bench.motion.skeleton import CANONICAL_PARENTS
from bench.suite.scores.base import PRIMARY_SLICE, Reference, Row, Scored, measure, share_score
from reports.bootstrap import mean_replicates


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


def jerk_ratio(row: Row, reference: Reference) -> Scored:
    """Mean jerk over that of real motion with the same mixture of contents."""
    jerk = row.jerk
    known = [reference.floor_jerk[reference.floor.contents == c] for c in range(len(reference.content_labels))]
    per_content = np.array([values.mean() if len(values) else np.nan for values in known])
    expected = per_content[row.contents]
    comparable = np.isfinite(expected)
    contents = [s for s in reference.slices if s.startswith("content=")]
    measurements, replicates = [], {}
    for slice_name in reference.present(("all", PRIMARY_SLICE, *contents)):
        mask = reference.slices[slice_name] & comparable
        left_out = int((reference.slices[slice_name] & ~comparable).sum())
        reason = f"{left_out} samples left out: no real motion of their content to compare with" if left_out else ""
        if not mask.any():
            measurements.append(measure("jerk_ratio", slice_name, float("nan"), 0, reason=reason))
            continue
        counts = reference.counts[:, mask]
        draws = mean_replicates(jerk[mask], counts) / mean_replicates(expected[mask], counts)
        replicates[f"jerk_ratio|{slice_name}"] = draws
        value = physics.ratio_to_reference(expected[mask], jerk[mask])
        measurements.append(measure("jerk_ratio", slice_name, value, int(mask.sum()), replicates=draws, reason=reason))
    return Scored(tuple(measurements), {"jerk": jerk}, replicates)


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
