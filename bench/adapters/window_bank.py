"""Windows of the fit part with pose descriptors: what retrieval rows search."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.adapters.piecewise import WINDOW_FPS
from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.motion.clip import Clip
from bench.motion.edit import resample, windows
from bench.motion.representation import window_frame
from bench.motion.skeleton import canonical_skeleton

WINDOW_FRAMES = 64
STRIDE_FRAMES = 8
POSE_STEP_FRAMES = 8
BANK_FILE = "bank.npz"


def describe_window(clip: Clip) -> FloatArray:
    """Joint positions in the window frame of every eighth pose, flattened: ``[T / 8 * 63]``, statures."""
    positions, _ = window_frame(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)
    return positions[::POSE_STEP_FRAMES].reshape(-1)


@dataclass(frozen=True, eq=False)
class WindowBank:
    """All windows of some takes.

    Attributes
    ----------
    rotations_wxyz, root_xyz_m : ``[n, 64, 21, 4]`` float32 and ``[n, 64, 3]`` float32.
    offsets_m : ``[n, 21, 3]`` bones of each window.
    descriptors : ``[n, D]``.
    contents, styles : labels, one a window.
    """

    rotations_wxyz: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
    root_xyz_m: np.ndarray[tuple[int, ...], np.dtype[np.float32]]
    offsets_m: FloatArray
    descriptors: FloatArray
    contents: tuple[str, ...]
    styles: tuple[str, ...]
    fps: float

    @classmethod
    def of(cls, takes: Sequence[Take]) -> WindowBank:
        """Cut labelled takes into windows of 64 frames at 30 fps every 8."""
        pairs = [
            (take, part)
            for take in takes
            for _, part in windows(resample(take.clip, WINDOW_FPS), WINDOW_FRAMES, STRIDE_FRAMES)
        ]
        return cls(
            np.stack([part.rotations_wxyz for _, part in pairs]).astype(np.float32),
            np.stack([part.root_xyz_m for _, part in pairs]).astype(np.float32),
            np.stack([part.skeleton.offsets_m for _, part in pairs]),
            np.stack([describe_window(part) for _, part in pairs]),
            tuple(str(take.content) for take, _ in pairs),
            tuple(str(take.style) for take, _ in pairs),
            WINDOW_FPS,
        )

    def rows(self, *, content: str | None = None, style: str | None = None) -> IntArray:
        """Indices of the windows with these labels; None matches all."""
        keep = np.ones(len(self.styles), dtype=bool)
        if content is not None:
            keep &= np.array(self.contents) == content
        if style is not None:
            keep &= np.array(self.styles) == style
        return np.flatnonzero(keep)

    def clip(self, row: int) -> Clip:
        """One window as a clip with its own bones."""
        skeleton = canonical_skeleton(self.offsets_m[row])
        return Clip(
            skeleton, self.rotations_wxyz[row].astype(np.float64), self.root_xyz_m[row].astype(np.float64), self.fps
        )

    def save(self, folder: Path) -> None:
        """Store the bank as one .npz without pickles."""
        np.savez(
            folder / BANK_FILE,
            rotations=self.rotations_wxyz,
            root=self.root_xyz_m,
            offsets=self.offsets_m,
            descriptors=self.descriptors,
            contents=np.array(self.contents),
            styles=np.array(self.styles),
            fps=np.array(self.fps),
        )

    @classmethod
    def load(cls, folder: Path) -> WindowBank:
        """Restore a bank stored by :meth:`save`."""
        with np.load(folder / BANK_FILE, allow_pickle=False) as stored:
            return cls(
                stored["rotations"],
                stored["root"],
                stored["offsets"],
                stored["descriptors"],
                tuple(str(label) for label in stored["contents"]),
                tuple(str(label) for label in stored["styles"]),
                float(stored["fps"]),
            )
