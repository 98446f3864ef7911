"""Scores of the prediction track: z-scored features of single frames (Mason 2022, section 4.3)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from bench.arrays import FloatArray
from bench.metrics import prediction
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.kinematics import facing_yaw, forward_kinematics, world_positions
from bench.motion.skeleton import CANONICAL_PARENTS
from bench.suite.scores.base import Basis, PlainRow, Scored, mean_score

FIT_FRAMES_PER_TAKE = 20
FEATURE_GROUPS = {"position": slice(0, 3), "rotation": slice(3, 9), "velocity": slice(9, 12)}
"""Kinds of features by their channels; the error over each is in the details."""


def frame_features(before: Clip, frame: Clip) -> FloatArray:
    """Features ``[21 * 12]`` of a frame in the local frame of the one before it.

    Per joint position (m), forward and up axis of its rotation, and velocity (m/s), with ground position and heading
    of the frame before removed.
    """
    last = world_positions(before)[-1]
    yaw = facing_yaw(last)
    turn = quat.from_rotation_vector(np.array([0.0, -float(yaw), 0.0]))
    positions, rotations = forward_kinematics(frame.rotations_wxyz[0], frame.root_xyz_m[0], frame.skeleton)
    origin = last[0] * np.array([1.0, 0.0, 1.0])
    matrices = quat.to_matrix(quat.multiply(np.broadcast_to(turn, rotations.shape), rotations))
    local, moved = (quat.rotate(np.broadcast_to(turn, (21, 4)), v) for v in (positions - origin, positions - last))
    features = np.concatenate([local, matrices[..., 2], matrices[..., 1], moved * frame.fps], axis=-1)
    return np.asarray(features.reshape(-1))


def next_frame_error(row: PlainRow, basis: Basis) -> Scored:
    """Mean squared difference of z-scores between predicted and true frame."""
    pairs = []
    for index, task in enumerate(basis.tasks):
        take = basis.pack.take(task.content_take_id)
        before = crop(take.clip, task.start_frame - 1, 1)
        true = frame_features(before, crop(take.clip, task.start_frame, 1))
        pairs.append((true, frame_features(before, row.motions.clip(index))))
    fit = _fit_features(basis)
    statistics = prediction.feature_statistics(fit)
    values = [prediction.next_frame_error(true[None], predicted[None], statistics) for true, predicted in pairs]
    details = {group: _group_error(pairs, fit, channels) for group, channels in FEATURE_GROUPS.items()}
    return mean_score("next_frame_error", np.array(values), basis, slices=_slices(basis), details=details)


def _group_error(pairs: Sequence[tuple[FloatArray, FloatArray]], fit: FloatArray, channels: slice) -> float:
    """The same error over one kind of feature."""
    true, predicted, known = (
        values.reshape(len(values), 21, 12)[..., channels].reshape(len(values), -1)
        for values in (*(np.stack(side) for side in zip(*pairs, strict=True)), fit)
    )
    return prediction.next_frame_error(true, predicted, prediction.feature_statistics(known))


def bone_length_loss(row: PlainRow, basis: Basis) -> Scored:
    """Mean absolute difference of bone lengths, cm."""
    virtual = [joint for joint in range(21) if joint not in row.joints]
    values = [
        100.0 * prediction.bone_length_loss_m(source, output, CANONICAL_PARENTS, virtual)
        for source, output in zip(row.source_positions_m, row.positions_m, strict=True)
    ]
    return mean_score("bone_length_loss", np.array(values), basis, slices=("all",))


def _slices(basis: Basis) -> list[str]:
    return ["all", *(name for name in basis.slices if name.startswith(("content=", "style=")))]


@lru_cache(maxsize=1)
def _fit_features(basis: Basis) -> FloatArray:
    """Features of evenly spread frames of every fit take."""
    rows = []
    for take_id in basis.fit_take_ids:
        clip = basis.pack.take(take_id).clip
        for frame in np.linspace(1, clip.n_frames - 1, FIT_FRAMES_PER_TAKE).astype(int):
            rows.append(frame_features(crop(clip, int(frame) - 1, 1), crop(clip, int(frame), 1)))
    return np.stack(rows)
