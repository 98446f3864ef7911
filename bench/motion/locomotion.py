"""Which motions travel."""

from __future__ import annotations

import numpy as np

from bench.motion.clip import Clip

TRAVELS_M_S = 0.3


def travels(clip: Clip) -> bool:
    """Whether the root covers ground: at least 0.3 m of path a second on average, on a body of any size.

    Walks, runs and turns do, gestures on the spot do not.
    """
    if clip.n_frames < 2:
        return False
    steps_m = np.linalg.norm(np.diff(clip.root_xyz_m[:, [0, 2]], axis=0), axis=1)
    return float(steps_m.mean() * clip.fps) >= TRAVELS_M_S
