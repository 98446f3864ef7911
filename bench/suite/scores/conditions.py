"""Scores of the transfer track's conditions and of the true answer: errors against motion that is known."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadInput
from bench.metrics import paired, physics
from bench.motion.kinematics import world_positions
from bench.protocols.base import Task
from bench.protocols.transfer import WINDOW_FRAMES
from bench.suite.motions import Motions
from bench.suite.scores.base import (
    PRIMARY_SLICE,
    Basis,
    PlainRow,
    Reference,
    Row,
    Scored,
    mean_score,
    measure,
)
from reports.bootstrap import mean_replicates

SEGMENT_FRAMES = WINDOW_FRAMES
BLEND_FRAMES = 10
"""Frames after a join that belong to neither piece: 0.3 s of blending."""
JOIN_REACH_FRAMES = 8

PAIRED_ERRORS = {
    "paired_rotation": "rotation_deg",
    "paired_position": "position_cm",
    "paired_rotation_aligned": "aligned_rotation_deg",
    "paired_position_aligned": "aligned_position_cm",
}
"""Metric -> the field of ``PairedErrors`` it is."""


def paired_truth(name: str, row: Row, reference: Reference) -> Scored:
    """One of the four errors against the true answer. Where a motion starts on the floor does not count.

    Raises
    ------
    BadInput : the reference has no true answers.
    """
    values = np.array([getattr(error, PAIRED_ERRORS[name]) for error in _paired_errors(row, reference)])
    return mean_score(name, values, reference, slices=("all", PRIMARY_SLICE))


@lru_cache(maxsize=1)
def _paired_errors(row: Row, reference: Reference) -> list[paired.PairedErrors]:
    """All four errors of every sample: the alignment that some of them need is found once."""
    truth = reference.truth
    if truth is None:
        raise BadInput("paired errors need true answers", where="reference")
    joints = [joint for joint in row.joints if joint in truth.real_joints]
    rotations, outputs = truth.window_rotations_wxyz[:, :, joints], row.motions.window_rotations_wxyz[:, :, joints]
    positions, placed = _from_origin(truth.world_positions()), _from_origin(row.positions_m)
    return [
        paired.paired_errors(rotations[i], outputs[i], positions[i][:, joints], placed[i][:, joints])
        for i in range(row.motions.n)
    ]


def _from_origin(positions_m: FloatArray) -> FloatArray:
    """Positions ``[n, T, J, 3]`` moved over the floor so that every root starts above the origin."""
    return np.asarray(positions_m - positions_m[:, :1, :1] * np.array([1.0, 0.0, 1.0]))


def reconstruction_position(row: Row, reference: Reference) -> Scored:
    """Joint distance between output and source."""
    joints = list(row.joints)
    errors = [
        paired.position_errors_cm(source[:, joints], output[:, joints]).mean()
        for source, output in zip(row.source_positions_m, row.positions_m, strict=True)
    ]
    return mean_score("reconstruction_position", np.array(errors), reference, slices=("all",))


def reconstruction_rotation(row: Row, reference: Reference) -> Scored:
    """Angle between the joint rotations of output and source."""
    joints = list(row.joints)
    pairs = zip(row.source.window_rotations_wxyz, row.motions.window_rotations_wxyz, strict=True)
    errors = [paired.rotation_errors_deg(source[:, joints], output[:, joints]).mean() for source, output in pairs]
    return mean_score("reconstruction_rotation", np.array(errors), reference, slices=("all",))


def prefix_error(row: PlainRow, basis: Basis) -> Scored:
    """Joint distance of the answer to the first frames from the same frames of the answer to all."""
    longest: dict[str, FloatArray] = {}
    positions = [world_positions(row.motions.clip(index))[:, list(row.joints)] for index in range(row.motions.n)]
    for task, found in zip(basis.tasks, positions, strict=True):
        if len(found) >= len(longest.get(task.group, ())):
            longest[task.group] = found
    values = np.array(
        [
            paired.position_errors_cm(longest[task.group][: len(found)], found).mean()
            for task, found in zip(basis.tasks, positions, strict=True)
        ]
    )
    lengths = sorted({task.n_frames for task in basis.tasks})
    return mean_score("prefix_error", values, basis, slices=[f"frames={n}" for n in lengths[:-1]])


@dataclass(frozen=True, eq=False)
class SegmentRow(Row):
    """A row of long sequences: ``motions`` are the judged segments, ``uncut`` and ``uncut_source`` the sequences."""

    uncut: Motions
    uncut_source: Motions
    sequences: tuple[Task, ...]


def segments_of(task: Task, n_frames: int) -> list[Task]:
    """The judged segments of one long task: every 64 frames inside a piece, clear of the blend at its start."""
    ends = [*(start for start, _ in task.segments[1:]), n_frames]
    found = []
    for (start, content), end in zip(task.segments, ends, strict=True):
        first = start + (BLEND_FRAMES if start else 0)
        for segment in range(first, min(end, n_frames) - SEGMENT_FRAMES + 1, SEGMENT_FRAMES):
            found.append((segment, content))
    return [
        replace(
            task,
            sample_id=f"{task.sample_id}-{segment:04d}",
            start_frame=segment,
            n_frames=SEGMENT_FRAMES,
            content=content,
            segments=(),
        )
        for segment, content in found
    ]


def path_drift(row: Row, reference: Reference) -> Scored:
    """Ground distance of output and source at the end of each judged stretch."""
    values = physics.path_drift(row.source_positions_m[:, :, 0], row.positions_m[:, :, 0])
    return mean_score("path_drift", values, reference, slices=("all",))


def join_jerk_ratio(row: SegmentRow, reference: Reference) -> Scored:
    """Jerk around joins over jerk inside segments, output over source."""
    ratios = []
    for motions in (row.uncut, row.uncut_source):
        around = [
            world_positions(motions.clip(index))[start - JOIN_REACH_FRAMES : start + BLEND_FRAMES + JOIN_REACH_FRAMES]
            for index, task in enumerate(row.sequences)
            for start, _ in task.segments[1:]
            if start + BLEND_FRAMES + JOIN_REACH_FRAMES <= motions.lengths[index]
        ]
        ratios.append(physics.jerk_per_sample(np.stack(around), motions.fps, joints=row.joints))
    inside = physics.jerk_per_sample(row.source_positions_m, row.source.fps, joints=row.joints)
    at_output, at_source = ratios
    name = "join_jerk_ratio"
    if row.jerk.mean() == 0.0:
        return Scored((measure(name, "all", float("nan"), 0, reason="undefined: the outputs do not move"),))
    value = (at_output.mean() / row.jerk.mean()) / (at_source.mean() / inside.mean())
    draws = mean_replicates(inside, reference.counts) / mean_replicates(row.jerk, reference.counts)
    draws = draws * at_output.mean() / at_source.mean()
    details = {
        "joins": float(len(at_output)),
        "jerk_at_joins": float(at_output.mean()),
        "jerk_at_joins_of_source": float(at_source.mean()),
    }
    found = measure(name, "all", float(value), row.motions.n, replicates=draws, details=details)
    return Scored((found,), {}, {f"{name}|all": draws})
