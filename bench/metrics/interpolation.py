"""Does a style interpolation move steadily from one style to the other and keep the content (this benchmark's own).

The papers show interpolations as pictures only (Motion Puzzle, Figure 12; Style-ERD, Figure 6; Mason 2022, Figure 8).
Outputs come at W equally spaced weights, the first 0 (start style) and the last 1 (target style).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import rankdata

from bench.arrays import FloatArray, IntArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import check_labels

WEIGHTS = (0.0, 0.25, 0.5, 0.75, 1.0)


def target_log_odds(class_scores: ArrayLike, start_class: int, target_class: int) -> FloatArray:
    """Log odds of target against start style: the difference of their logits (or log probabilities).

    Parameters
    ----------
    class_scores : ``[..., C]`` a judge's logits or log probabilities, C at least 2.
    start_class, target_class : two different classes.

    Returns
    -------
    ``[...]``; 0 where the judge is undecided between the two, positive towards the target.

    Raises
    ------
    BadInput : no class axis, not finite, classes that are equal or do not exist.
    """
    scores = np.asarray(class_scores, dtype=np.float64)
    if scores.ndim == 0 or scores.size == 0 or scores.shape[-1] < 2:
        raise BadInput(
            f"class_scores must have shape [..., at least 2], got {list(scores.shape)}", where="class_scores"
        )
    finite_array(scores.reshape(-1), "class_scores", (None,))
    for name, chosen in (("start_class", start_class), ("target_class", target_class)):
        if not 0 <= chosen < scores.shape[-1]:
            raise BadInput(f"{name} must be one of {scores.shape[-1]} classes, got {chosen}", where=name)
    if start_class == target_class:
        raise BadInput(f"target_class must differ from start_class, both are {start_class}", where="target_class")
    return np.asarray(scores[..., target_class] - scores[..., start_class])


def monotonicity(weights: ArrayLike, log_odds: ArrayLike) -> FloatArray:
    """Spearman correlation of interpolation weight and target log odds, for every sample.

    Parameters
    ----------
    weights : ``[W]`` different weights, at least 3.
    log_odds : ``[N, W]`` as from ``target_log_odds``.

    Returns
    -------
    ``[N]`` in -1..1, 1 where the odds rise with every step; NaN where they are the same at all weights.

    Raises
    ------
    BadInput : wrong shape, no sample, not finite, lengths that differ, equal weights, fewer than 3.
    """
    weight_array = finite_array(weights, "weights", (None,))
    if len(weight_array) < 3 or len(np.unique(weight_array)) < len(weight_array):
        raise BadInput(f"weights must be at least 3 different numbers, got {weight_array.tolist()}", where="weights")
    odds = finite_array(log_odds, "log_odds", (None, len(weight_array)))
    weight_ranks = _centred_ranks(weight_array[None])
    odds_ranks = _centred_ranks(odds)
    norms = np.linalg.norm(weight_ranks) * np.linalg.norm(odds_ranks, axis=1)
    covariances = (weight_ranks * odds_ranks).sum(axis=1)
    return np.asarray(np.divide(covariances, norms, out=np.full(len(odds), np.nan), where=norms > 0.0))


def evenness(positions_m: ArrayLike) -> float:
    """Largest step between neighbouring weights over the mean step, in pose space; 1 is perfectly even.

    A step is the mean over frames and joints of the joint distances between two outputs.

    Parameters
    ----------
    positions_m : ``[W, T, J, 3]`` positions of the outputs of one sample, W at least 3 equally spaced weights.

    Returns
    -------
    1 to W - 1 (all change in one step); NaN where the outputs are all the same.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, fewer than 3 weights.
    """
    positions = finite_array(positions_m, "positions_m", (None, None, None, 3))
    if len(positions) < 3:
        raise BadInput(f"positions_m needs at least 3 weights, got {len(positions)}", where="positions_m")
    steps = np.linalg.norm(np.diff(positions, axis=0), axis=-1).mean(axis=(1, 2))
    mean = float(steps.mean())
    return float(steps.max()) / mean if mean > 0.0 else float("nan")


def ends_right(
    predicted_contents: ArrayLike,
    predicted_styles: ArrayLike,
    contents: ArrayLike,
    start_styles: ArrayLike,
    target_styles: ArrayLike,
) -> FloatArray:
    """Share of the two outputs at the ends whose content and style are both judged right, for every sample.

    Parameters
    ----------
    predicted_contents, predicted_styles : ``[N, W]`` predicted labels.
    contents, start_styles, target_styles : ``[N]`` the labels wanted; start at the first weight, target at the last.

    Returns
    -------
    ``[N]`` 0, 0.5 or 1.

    Raises
    ------
    BadInput : not integer labels, wrong shape, no sample, lengths that differ, fewer than 2 weights.
    """
    seen_contents, wanted_contents = _labels(predicted_contents, contents, "predicted_contents", "contents", 2)
    seen_styles, starts = _labels(predicted_styles, start_styles, "predicted_styles", "start_styles", 2)
    _, targets = _labels(predicted_styles, target_styles, "predicted_styles", "target_styles", 2)
    if seen_styles.shape != seen_contents.shape:
        raise BadInput(
            f"predicted_styles must have the shape of predicted_contents, {list(seen_contents.shape)}, "
            f"got {list(seen_styles.shape)}",
            where="predicted_styles",
        )
    ends = (0, -1)
    right_content = seen_contents[:, ends] == wanted_contents[:, None]
    right_style = seen_styles[:, ends] == np.stack([starts, targets], axis=1)
    return np.asarray((right_content & right_style).mean(axis=1))


def end_recognition_percent(
    predicted_contents: ArrayLike,
    predicted_styles: ArrayLike,
    contents: ArrayLike,
    start_styles: ArrayLike,
    target_styles: ArrayLike,
) -> float:
    """Share of the 2N outputs at both ends whose content and style are both judged right, in percent.

    Parameters and errors as in :func:`ends_right`.
    """
    return 100.0 * float(ends_right(predicted_contents, predicted_styles, contents, start_styles, target_styles).mean())


def middle_right(predicted_contents: ArrayLike, contents: ArrayLike) -> FloatArray:
    """Share of the outputs strictly between the ends whose content is judged right, for every sample.

    Parameters
    ----------
    predicted_contents : ``[N, W]`` predicted labels, W at least 3.
    contents : ``[N]`` labels wanted.

    Returns
    -------
    ``[N]`` in 0..1.

    Raises
    ------
    BadInput : not integer labels, wrong shape, no sample, lengths that differ, fewer than 3 weights.
    """
    seen, wanted = _labels(predicted_contents, contents, "predicted_contents", "contents", 3)
    return np.asarray((seen[:, 1:-1] == wanted[:, None]).mean(axis=1))


def middle_content_percent(predicted_contents: ArrayLike, contents: ArrayLike) -> float:
    """Share of the outputs strictly between the ends whose content is judged right, in percent.

    Parameters and errors as in :func:`middle_right`.
    """
    return 100.0 * float(middle_right(predicted_contents, contents).mean())


def _centred_ranks(values: FloatArray) -> FloatArray:
    """Ranks along the last axis of ``[N, W]``, ties averaged, minus their mean."""
    return np.asarray(rankdata(values, axis=1) - (values.shape[1] + 1) / 2.0)


def _labels(
    predicted: ArrayLike, wanted: ArrayLike, predicted_name: str, wanted_name: str, min_weights: int
) -> tuple[IntArray, IntArray]:
    """Predicted labels ``[N, W]`` and the ``[N]`` wanted ones."""
    seen = np.asarray(predicted)
    if seen.ndim != 2 or seen.size == 0 or seen.shape[1] < min_weights:
        raise BadInput(
            f"{predicted_name} must have shape [any, at least {min_weights}], got {list(seen.shape)}",
            where=predicted_name,
        )
    flat = check_labels(seen.reshape(-1), predicted_name, seen.size)
    return flat.reshape(seen.shape), check_labels(wanted, wanted_name, len(seen))
