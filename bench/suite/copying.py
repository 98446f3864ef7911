"""Which motions a method was given, as descriptors to search for copies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.metrics.memorisation import (
    mirrored_positions,
    nearest_distance,
    nearest_distance_within,
    pose_descriptors,
)
from bench.motion.clip import Clip
from bench.motion.edit import pad_to
from bench.motion.kinematics import FOOT_JOINTS, facing_yaw, world_positions
from bench.motion.skeleton import MIRROR_JOINTS

WINDOW_FRAMES = 64
POSE_STEP_FRAMES = 8


@dataclass(frozen=True, eq=False)
class DescriptorBank:
    """Descriptors ``[m, D]`` of windows of takes, mirrored ones included, and the take index ``[m]`` of each."""

    descriptors: NDArray[np.float32]
    take_index: IntArray
    take_ids: tuple[str, ...]

    @classmethod
    def of(cls, takes: Sequence[Take], stride_frames: int) -> DescriptorBank:
        """All windows that start every ``stride_frames`` in each take."""
        parts, owners = [], []
        for index, take in enumerate(takes):
            positions = poses_of_windows(take.clip, stride_frames)
            both = np.concatenate([positions, mirrored_positions(positions, MIRROR_JOINTS)])
            parts.append(pose_descriptors(both, step=1))
            owners.append(np.full(len(both), index))
        return cls(np.concatenate(parts), np.concatenate(owners), tuple(take.take_id for take in takes))

    def nearest(self, queries: NDArray[np.float32]) -> FloatArray:
        """Distance of each query to its nearest window."""
        return nearest_distance(queries, self.descriptors)

    def nearest_of_take(self, queries: NDArray[np.float32], take_ids: Sequence[str]) -> FloatArray:
        """Distance of each query to the nearest window of its named take."""
        index = {take_id: number for number, take_id in enumerate(self.take_ids)}
        groups = np.array([index[take_id] for take_id in take_ids])
        return nearest_distance_within(queries, self.descriptors, query_groups=groups, bank_groups=self.take_index)


def poses_of_windows(clip: Clip, stride_frames: int) -> FloatArray:
    """Every eighth pose of the windows of a clip, each window in its own window frame: ``[w, 8, 21, 3]`` statures."""
    clip = pad_to(clip, WINDOW_FRAMES)
    positions = world_positions(clip)
    starts = np.arange(0, clip.n_frames - WINDOW_FRAMES + 1, stride_frames)
    frames = starts[:, None] + np.arange(WINDOW_FRAMES)
    yaw = facing_yaw(positions)[frames]
    mean_yaw = np.arctan2(np.sin(yaw).mean(axis=1), np.cos(yaw).mean(axis=1))
    floor = positions[:, FOOT_JOINTS, 1].min(axis=1)[frames].min(axis=1)
    poses = positions[frames[:, ::POSE_STEP_FRAMES]]
    poses[..., [0, 2]] -= poses[:, :, :1, [0, 2]]
    poses[..., 1] -= floor[:, None, None]
    cos, sin = np.cos(mean_yaw)[:, None, None], np.sin(mean_yaw)[:, None, None]
    turned = np.stack(
        [cos * poses[..., 0] - sin * poses[..., 2], poses[..., 1], sin * poses[..., 0] + cos * poses[..., 2]], axis=-1
    )
    return np.asarray(turned / clip.skeleton.stature_m)
