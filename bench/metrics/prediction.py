"""Next-frame prediction error: mean squared error on z-scored features and bone length loss (Mason 2022, section 4.3).

Two baselines belong beside every number: the mean pose and the last pose repeated. A held average pose can have a very
low error (Mason 2022, section 5.2.2).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.errors import BadInput


@dataclass(frozen=True, eq=False)
class FeatureStatistics:
    """Mean and standard deviation of each feature over the frames of the fit part.

    Attributes
    ----------
    mean, std : ``[D]``, in the features' own units.
    varies : ``[D]`` False for features that are constant there; they have no z-score and are left out of errors.
    """

    mean: FloatArray
    std: FloatArray
    varies: BoolArray


def feature_statistics(features: ArrayLike, min_std: float = 1e-6) -> FeatureStatistics:
    """Statistics of ``[N, D]`` features for z-scoring.

    Parameters
    ----------
    features : frames of the fit part.
    min_std : features with a standard deviation up to this count as constant.

    Raises
    ------
    BadInput : wrong shape, fewer than 2 frames, not finite, or every feature constant.
    """
    frames = finite_array(features, "features", (None, None))
    if len(frames) < 2:
        raise BadInput("features needs at least 2 frames for a standard deviation, got 1", where="features")
    std = frames.std(axis=0)
    varies = std > min_std
    if not varies.any():
        raise BadInput(f"features are all constant over {len(frames)} frames", where="features")
    return FeatureStatistics(frames.mean(axis=0), std, varies)


def next_frame_error(true_features: ArrayLike, predicted_features: ArrayLike, statistics: FeatureStatistics) -> float:
    """Mean over frames and varying features of the squared difference of z-scores (equation 5a, for one style).

    Parameters
    ----------
    true_features, predicted_features : ``[T, D]`` in the features' own units; row t of both is the same moment.
    statistics : of the fit part.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different shapes, or another D than the statistics.
    """
    true = finite_array(true_features, "true_features", (None, len(statistics.mean)))
    predicted = finite_array(predicted_features, "predicted_features", true.shape)
    difference = (predicted - true)[:, statistics.varies] / statistics.std[statistics.varies]
    return float((difference**2).mean())


def bone_length_loss_m(
    true_positions_m: ArrayLike,
    predicted_positions_m: ArrayLike,
    parents: Sequence[int],
    virtual: Sequence[int] = (),
) -> float:
    """Mean over frames and bones of the absolute difference of bone lengths, metres (equations 5b and 5c).

    Parameters
    ----------
    true_positions_m, predicted_positions_m : ``[T, J, 3]`` metres.
    parents : parent of each joint, -1 for a root; each other joint is the end of one bone.
    virtual : joints whose bones do not count.

    Raises
    ------
    BadInput : wrong shape, no frame, not finite, different shapes; parents that do not fit; no bone left.
    """
    true = finite_array(true_positions_m, "true_positions_m", (None, None, 3))
    predicted = finite_array(predicted_positions_m, "predicted_positions_m", true.shape)
    joints = true.shape[1]
    if len(parents) != joints or any(not -1 <= parent < joints for parent in parents):
        raise BadInput(
            f"parents must name a joint or -1 for each of {joints} joints, got {list(parents)}", where="parents"
        )
    child = [joint for joint in range(joints) if parents[joint] >= 0 and joint not in virtual]
    if not child:
        raise BadInput("parents and virtual leave no bone to compare", where="parents")
    parent = [parents[joint] for joint in child]
    true_lengths = np.linalg.norm(true[:, child] - true[:, parent], axis=-1)
    predicted_lengths = np.linalg.norm(predicted[:, child] - predicted[:, parent], axis=-1)
    return float(np.abs(predicted_lengths - true_lengths).mean())


def mean_pose_prediction(statistics: FeatureStatistics, n_frames: int) -> FloatArray:
    """The baseline that always predicts the fit part's mean, ``[n_frames, D]``.

    Raises
    ------
    BadInput : ``n_frames`` under 1.
    """
    return np.tile(statistics.mean, (_positive(n_frames), 1))


def repeat_last_prediction(past_features: ArrayLike, n_frames: int) -> FloatArray:
    """The baseline that holds the last frame of ``past_features [T, D]``, ``[n_frames, D]``.

    Raises
    ------
    BadInput : wrong shape, no past frame, not finite, or ``n_frames`` under 1.
    """
    past = finite_array(past_features, "past_features", (None, None))
    return np.tile(past[-1], (_positive(n_frames), 1))


def _positive(n_frames: int) -> int:
    if n_frames < 1:
        raise BadInput(f"n_frames must be at least 1, got {n_frames}", where="n_frames")
    return n_frames
