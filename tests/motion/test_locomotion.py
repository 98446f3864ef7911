"""What counts as travelling."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.datasets.procedural.dataset import load as load_procedural
from bench.datasets.table import load_dataset
from bench.motion.edit import crop, resample
from bench.motion.locomotion import travels


def test_walks_and_runs_travel_and_punches_do_not() -> None:
    takes = load_procedural(None).takes
    assert all(travels(take.clip) for take in takes if take.content in ("walk", "run"))
    assert not any(travels(take.clip) for take in takes if take.content == "punch")


def test_a_single_frame_stands_and_the_threshold_is_a_speed() -> None:
    walk = next(take.clip for take in load_procedural(None).takes if take.content == "walk")
    assert not travels(crop(walk, 0, 1))
    still = walk.with_motion(walk.rotations_wxyz, np.broadcast_to(walk.root_xyz_m[:1], walk.root_xyz_m.shape))
    path = np.arange(walk.n_frames)[:, None] / walk.fps * np.array([1.0, 0.0, 0.0])
    assert not travels(still)
    assert travels(still.with_motion(still.rotations_wxyz, still.root_xyz_m + 0.31 * path))
    assert not travels(still.with_motion(still.rotations_wxyz, still.root_xyz_m + 0.29 * path))


def test_names_of_captured_locomotion_agree(bandai_namco_zip: Path) -> None:
    takes = load_dataset("bandai-namco", bandai_namco_zip).takes
    named = [str(take.content).startswith(("walk", "run")) for take in takes]
    assert np.mean([travels(take.clip) == name for take, name in zip(takes, named, strict=True)]) > 0.99


@pytest.mark.parametrize("fps", [30.0, 120.0])
def test_speed_not_step_length_counts(fps: float) -> None:
    walk = next(take.clip for take in load_procedural(None).takes if take.content == "walk")
    assert travels(resample(walk, fps))
