"""Pictures of every supported skeleton, walking: ``python -m tests.golden.make_skeleton_pictures``.

A generated walk is performed by the source skeleton, written to BVH, read and retargeted as a user's file would be.
Grey: the file's own joints. Blue left, red right, black middle: the canonical 21 joints.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from bench.arrays import FloatArray
from bench.datasets.bvh_files import read_motion
from bench.datasets.bvh_folder import reading_of
from bench.datasets.procedural.dataset import imitated
from bench.motion.bvh import BvhMotion, world_motion
from bench.motion.clip import Clip
from bench.motion.from_positions import SMPL_NAMES, clip_from_smpl
from bench.motion.kinematics import world_positions
from bench.motion.skeleton import CANONICAL_NAMES, CANONICAL_PARENTS
from tests.motion.source_skeletons import SOURCES, on_source, write_motion

FOLDER = Path(__file__).parents[2] / "docs" / "skeletons"
FRAMES = (5, 14, 23, 32)
SPACING_M = 0.9


def walk() -> Clip:
    return imitated("walk_neutral_001", "neutral", "pictures")


def draw(path: Path, title: str, clip: Clip, source: FloatArray | None, parents: tuple[int, ...]) -> None:
    """One row from the side, one from the front; ``source`` is ``[F, J, 3]`` in metres."""
    figure, rows = plt.subplots(2, 1, figsize=(6.0, 6.4), layout="constrained")
    ours = world_positions(clip)
    for axes, (across, name) in zip(rows, ((2, "side"), (0, "front")), strict=True):
        for place, frame in enumerate(FRAMES):
            centre = ours[frame, 0, across]
            if source is not None:
                bones(axes, source[frame], parents, across, place * SPACING_M - centre, None)
            bones(axes, ours[frame], CANONICAL_PARENTS, across, place * SPACING_M - centre, CANONICAL_NAMES)
        axes.set_aspect("equal")
        axes.set_xticks([])
        axes.set_ylabel(f"{name}, m")
    rows[0].set_title(title)
    figure.savefig(path, dpi=70)
    plt.close(figure)


def bones(
    axes: Axes, pose: FloatArray, parents: tuple[int, ...], across: int, shift: float, names: tuple[str, ...] | None
) -> None:
    for joint, parent in enumerate(parents):
        if parent < 0 or not np.isfinite(pose[[parent, joint]]).all():
            continue
        name = names[joint] if names else ""
        colour = "tab:blue" if name.startswith("Left") else "tab:red" if name.startswith("Right") else "black"
        line = pose[[parent, joint]]
        axes.plot(
            line[:, across] + shift,
            line[:, 1],
            color=colour if names else "0.75",
            linewidth=1.4 if names else 5.0,
            solid_capstyle="round",
        )


def main() -> None:
    FOLDER.mkdir(parents=True, exist_ok=True)
    clip = walk()
    with tempfile.TemporaryDirectory() as folder:
        for name, source in SOURCES.items():
            motion = read_motion(write_motion(Path(folder) / f"{name}.bvh", on_source(clip, source)))
            reading = reading_of([motion], {}, Path(folder))
            positions, parents = shown(motion, reading.unit_m)
            draw(FOLDER / f"{name}.png", name, reading.to_clip(motion), positions, parents)
    motion = on_source(clip, SOURCES["smpl"])
    positions = world_motion(motion)[0] * 0.01
    order = [motion.names.index(name) for name in SMPL_NAMES]
    title = "smpl, from joint positions alone"
    draw(FOLDER / "smpl-positions.png", title, clip_from_smpl(positions[:, order], clip.fps), positions, motion.parents)


def shown(motion: BvhMotion, unit_m: float) -> tuple[FloatArray, tuple[int, ...]]:
    """World positions in metres; a joint above the hips, which stands at the origin, is not drawn."""
    positions = world_motion(motion)[0] * unit_m
    if motion.names[0] != "Hips" and "Hips" in motion.names:
        positions[:, 0] = np.nan
    return positions, motion.parents


if __name__ == "__main__":
    main()
