"""Random but plausible clips for tests."""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton, canonical_skeleton

REST_M = {
    1: (0.09, -0.05, 0.0), 2: (0.0, -0.42, 0.0), 3: (0.0, -0.42, 0.0), 4: (0.0, -0.06, 0.14),
    5: (-0.09, -0.05, 0.0), 6: (0.0, -0.42, 0.0), 7: (0.0, -0.42, 0.0), 8: (0.0, -0.06, 0.14),
    9: (0.0, 0.12, 0.0), 10: (0.0, 0.2, 0.0), 11: (0.0, 0.2, 0.0), 12: (0.0, 0.1, 0.0),
    13: (0.17, 0.12, 0.0), 14: (0.28, 0.0, 0.0), 15: (0.25, 0.0, 0.0), 16: (0.08, 0.0, 0.0),
    17: (-0.17, 0.12, 0.0), 18: (-0.28, 0.0, 0.0), 19: (-0.25, 0.0, 0.0), 20: (-0.08, 0.0, 0.0),
}  # fmt: skip


def rest_offsets(scale: float = 1.0) -> FloatArray:
    """Offsets of an adult of about 1.55 m Head over Toes, times ``scale``."""
    offsets = np.zeros((21, 3))
    for joint, offset in REST_M.items():
        offsets[joint] = offset
    return offsets * scale


def person(scale: float = 1.0, virtual: frozenset[str] = frozenset()) -> Skeleton:
    """A symmetric canonical skeleton."""
    return canonical_skeleton(rest_offsets(scale), virtual)


def random_clip(
    n_frames: int = 40, fps: float = 30.0, *, seed: int = 0, amount_rad: float = 0.3, skeleton: Skeleton | None = None
) -> Clip:
    """Smooth random motion around the rest pose, walking forward."""
    rng = np.random.default_rng(seed)
    time = np.arange(n_frames)[:, None, None] / fps
    phases, rates = rng.uniform(0, 2 * np.pi, (1, 21, 3)), rng.uniform(0.3, 1.2, (1, 21, 3))
    vectors = amount_rad * np.sin(2 * np.pi * rates * time + phases)
    root = np.stack(
        [0.1 * np.sin(time[:, 0, 0]), 0.95 + 0.02 * np.sin(3 * time[:, 0, 0]), 1.2 * time[:, 0, 0]], axis=-1
    )
    return Clip(skeleton or person(), quat.from_rotation_vector(vectors), root, fps)
