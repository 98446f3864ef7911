"""Scores of the interpolation track: groups of five outputs, one a weight."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bench.arrays import IntArray
from bench.metrics import interpolation
from bench.metrics.interpolation import WEIGHTS
from bench.protocols.base import Task
from bench.suite.scores.base import Reference, Row, Scored, mean_score, share_score

N_WEIGHTS = len(WEIGHTS)
Number = TypeVar("Number", bound=np.generic)


def groups_of(tasks: Sequence[Task]) -> list[Task]:
    """One task a group, the last of its five, which asks for the target style alone."""
    return list(tasks[N_WEIGHTS - 1 :: N_WEIGHTS])


def monotonicity(row: Row, reference: Reference) -> Scored:
    """Spearman of weight against target-minus-start log odds, mean over judge seeds."""
    targets, starts = _of_groups(row.styles), _start_styles(row, reference)
    by_judge = []
    for log_probabilities in row.embedding.style_log_probabilities:
        grouped = _grouped(log_probabilities.astype(np.float64))
        odds = [
            interpolation.target_log_odds(scores, int(start), int(target))
            for scores, start, target in zip(grouped, starts, targets, strict=True)
        ]
        by_judge.append(interpolation.monotonicity(WEIGHTS, np.stack(odds)))
    values = np.mean(by_judge, axis=0)
    undefined = "the outputs are the same at all weights"
    return mean_score("monotonicity", values, reference, slices=_slices(reference), undefined=undefined)


def evenness(row: Row, reference: Reference) -> Scored:
    """Largest step over mean step in pose space."""
    positions = _grouped(row.motions.window_positions[:, :, list(row.joints)])
    values = np.array([interpolation.evenness(group) for group in positions])
    undefined = "the outputs are the same at all weights"
    return mean_score("evenness", values, reference, slices=_slices(reference), undefined=undefined)


def end_recognition(row: Row, reference: Reference) -> Scored:
    """Content and style judged right at both ends: a group counts 0, one half, or 1."""
    contents, targets = _of_groups(row.contents), _of_groups(row.styles)
    starts = _start_styles(row, reference)
    right = [
        interpolation.ends_right(_grouped(seen_contents), _grouped(seen_styles), contents, starts, targets)
        for seen_contents, seen_styles in zip(
            row.embedding.content_predicted, row.embedding.style_predicted, strict=True
        )
    ]
    return share_score("end_recognition", np.stack(right), reference, slices=_slices(reference))


def middle_content(row: Row, reference: Reference) -> Scored:
    """Content judged right strictly between the ends."""
    contents = _of_groups(row.contents)
    right = [interpolation.middle_right(_grouped(seen), contents) for seen in row.embedding.content_predicted]
    return share_score("middle_content", np.stack(right), reference, slices=_slices(reference))


def _slices(reference: Reference) -> tuple[str, ...]:
    return ("all", *(name for name in reference.slices if name.startswith("part=")))


def _start_styles(row: Row, reference: Reference) -> IntArray:
    """``[G]`` style index at weight 0: the start reference's, or the source's own."""
    index = {label: place for place, label in enumerate(reference.style_labels)}
    named = [reference.pack.take(t.start_take_id).style if t.start_take_id else None for t in reference.tasks]
    return np.array(
        [style if name is None else index[str(name)] for name, style in zip(named, row.source_styles, strict=True)]
    )


def _grouped(values: NDArray[Number]) -> NDArray[Number]:
    """``[G * W, ...]`` to ``[G, W, ...]``."""
    return values.reshape(-1, N_WEIGHTS, *values.shape[1:])


def _of_groups(labels: IntArray) -> IntArray:
    """``[G * W]`` wanted labels to ``[G]``, those of the last weight."""
    return labels[N_WEIGHTS - 1 :: N_WEIGHTS]
