"""Recognition scores: content, style, both on the same sample, and the source's style that stayed."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.arrays import IntArray
from bench.metrics import recognition
from bench.suite.scores.base import PRIMARY_SLICE, Reference, Row, Scored, measure, share_score
from reports.bootstrap import mean_replicates


def joint_recognition(row: Row, reference: Reference) -> Scored:
    """Content and style both right, over all slices."""
    both = np.stack(
        [recognition.joint_correct(c, s) for c, s in zip(row.content_correct, row.style_correct, strict=True)]
    )
    return share_score("joint_recognition", both.astype(np.float64), reference, slices=tuple(reference.slices))


def joint_recognition_ratio(row: Row, reference: Reference) -> Scored:
    """Joint recognition over that of real disjoint motion, judge by judge."""
    floor = reference.floor
    real = [
        float(np.mean((c == floor.contents) & (s == floor.styles)))
        for c, s in zip(floor.embedding.content_predicted, floor.embedding.style_predicted, strict=True)
    ]
    both = row.content_correct & row.style_correct
    mask = reference.slices[PRIMARY_SLICE]
    ratios = [float(hits[mask].mean()) / share for hits, share in zip(both, real, strict=True)]
    scaled = (both / np.array(real)[:, None]).mean(axis=0)
    draws = mean_replicates(scaled[mask], reference.counts[:, mask])
    name = "joint_recognition_ratio"
    found = measure(
        name, PRIMARY_SLICE, float(np.mean(ratios)), int(mask.sum()), replicates=draws, judge_values=ratios,
        details={"real_disjoint_percent": 100.0 * float(np.mean(real))},
    )  # fmt: skip
    return Scored((found,), {}, {f"{name}|{PRIMARY_SLICE}": draws})


def cra(row: Row, reference: Reference) -> Scored:
    """Content recognition accuracy."""
    return share_score(
        "cra",
        row.content_correct.astype(np.float64),
        reference,
        slices=tuple(reference.slices),
        details=_class_facts(row.contents, len(reference.content_labels)),
    )


def sra(row: Row, reference: Reference) -> Scored:
    """Style recognition accuracy."""
    return share_score(
        "sra",
        row.style_correct.astype(np.float64),
        reference,
        slices=tuple(reference.slices),
        details=_class_facts(row.styles, len(reference.style_labels)),
    )


def _class_facts(labels: IntArray, n_classes: int) -> dict[str, float]:
    return {
        "chance": recognition.chance_percent(n_classes),
        "majority_rate": recognition.majority_rate_percent(labels),
    }


def _balanced(name: str, true: IntArray, predicted: NDArray[np.int16], reference: Reference) -> Scored:
    measurements, replicates = [], {}
    for slice_name in reference.present((PRIMARY_SLICE, "all")):
        mask = reference.slices[slice_name]
        values = [recognition.balanced_accuracy_percent(true[mask], seen[mask]) for seen in predicted]
        counts = reference.counts[:, mask]
        by_judge = [recognition.balanced_accuracy_replicates(true[mask], seen[mask], counts) for seen in predicted]
        draws = np.mean(by_judge, axis=0)
        replicates[f"{name}|{slice_name}"] = draws
        measurements.append(
            measure(name, slice_name, float(np.mean(values)), int(mask.sum()), replicates=draws, judge_values=values)
        )
    return Scored(tuple(measurements), {}, replicates)


def cra_balanced(row: Row, reference: Reference) -> Scored:
    """Balanced content recognition."""
    return _balanced("cra_balanced", row.contents, row.embedding.content_predicted, reference)


def sra_balanced(row: Row, reference: Reference) -> Scored:
    """Balanced style recognition."""
    return _balanced("sra_balanced", row.styles, row.embedding.style_predicted, reference)


def source_style_residue(row: Row, reference: Reference) -> Scored:
    """Outputs still judged to have the source's style."""
    kept = np.stack(
        [recognition.kept_source_style(row.source_styles, row.styles, seen) for seen in row.embedding.style_predicted]
    )
    if np.isnan(kept).all():
        found = measure(
            "source_style_residue",
            PRIMARY_SLICE,
            float("nan"),
            0,
            reason="scored under its source's own style: nothing was to be removed",
        )
        return Scored((found,))
    return share_score("source_style_residue", kept, reference, slices=(PRIMARY_SLICE, "all"))
