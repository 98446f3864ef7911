"""A cell's generated motions as arrays: stored once, scored as often as needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadFile
from bench.motion.clip import Clip
from bench.motion.kinematics import forward_kinematics
from bench.motion.representation import JUDGE_SLICES, window_frame
from bench.motion.skeleton import Skeleton, canonical_skeleton
from reports.records import digest_of_arrays

MOTIONS_FILE = "motions.npz"


@dataclass(frozen=True, eq=False)
class Motions:
    """n windows of equal length on canonical skeletons, with the labels they are scored under.

    Attributes
    ----------
    rotations_wxyz : ``[n, T, 21, 4]`` float32.
    root_xyz_m : ``[n, T, 3]`` float32.
    offsets_m : ``[k, 21, 3]`` the different skeletons.
    virtual : ``[k, 21]`` virtual joints of each skeleton.
    skeleton_index : ``[n]`` which skeleton each window has.
    contents, styles : ``[n]`` labels under which each window is scored.
    fps : frames per second.
    """

    rotations_wxyz: NDArray[np.float32]
    root_xyz_m: NDArray[np.float32]
    offsets_m: FloatArray
    virtual: NDArray[np.bool_]
    skeleton_index: NDArray[np.int32]
    contents: NDArray[np.str_]
    styles: NDArray[np.str_]
    fps: float

    @classmethod
    def of(cls, takes: Sequence[Take]) -> Motions:
        """Collect equally long windows."""
        different = {take.clip.skeleton.identity: take.clip.skeleton for take in takes}
        place = {identity: number for number, identity in enumerate(different)}
        skeletons = list(different.values())
        return cls(
            np.stack([take.clip.rotations_wxyz for take in takes]).astype(np.float32),
            np.stack([take.clip.root_xyz_m for take in takes]).astype(np.float32),
            np.stack([skeleton.offsets_m for skeleton in skeletons]),
            np.stack([[name in s.virtual for name in s.names] for s in skeletons]),
            np.array([place[take.clip.skeleton.identity] for take in takes], dtype=np.int32),
            np.array([str(take.content) for take in takes]),
            np.array([str(take.style) for take in takes]),
            takes[0].clip.fps,
        )

    @property
    def n(self) -> int:
        return int(self.rotations_wxyz.shape[0])

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays by name, as stored and digested."""
        return {
            "rotations_wxyz": self.rotations_wxyz,
            "root_xyz_m": self.root_xyz_m,
            "offsets_m": self.offsets_m,
            "virtual": self.virtual,
            "skeleton_index": self.skeleton_index,
            "contents": self.contents,
            "styles": self.styles,
            "fps": np.array(self.fps),
        }

    @property
    def digest(self) -> str:
        return digest_of_arrays(self.arrays())

    def save(self, folder: Path) -> None:
        """Store without pickles."""
        np.savez(folder / MOTIONS_FILE, **self.arrays())  # type: ignore[arg-type]

    @classmethod
    def load(cls, folder: Path) -> Motions:
        """Read what :meth:`save` stored.

        Raises
        ------
        BadFile : missing or damaged.
        """
        path = folder / MOTIONS_FILE
        try:
            with np.load(path, allow_pickle=False) as stored:
                arrays = {name: stored[name] for name in stored.files}
            fps = float(arrays.pop("fps"))
            return cls(**arrays, fps=fps)
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise BadFile(f"stored motions cannot be read: {error}", where=str(path)) from error

    def skeleton(self, index: int) -> Skeleton:
        """One of the skeletons."""
        base = canonical_skeleton(self.offsets_m[index])
        names = frozenset(name for name, virtual in zip(base.names, self.virtual[index], strict=True) if virtual)
        return canonical_skeleton(self.offsets_m[index], names)

    def clip(self, sample: int) -> Clip:
        """One window as a clip."""
        return Clip(
            self.skeleton(int(self.skeleton_index[sample])),
            self.rotations_wxyz[sample].astype(np.float64),
            self.root_xyz_m[sample].astype(np.float64),
            self.fps,
        )

    def world_positions(self) -> FloatArray:
        """World joint positions ``[n, T, 21, 3]``, metres."""
        positions = np.empty((*self.rotations_wxyz.shape[:3], 3))
        for k, rows, rotations, root in self._by_skeleton():
            positions[rows] = forward_kinematics(rotations, root, self.skeleton(k))[0]
        return positions

    def window_features(self) -> FloatArray:
        """What judges read: ``[n, T, 21, 7]``, slices in ``representation.JUDGE_SLICES``."""
        features = np.empty((*self.rotations_wxyz.shape[:3], 7))
        for k, rows, rotations, root in self._by_skeleton():
            positions, turned = window_frame(rotations, root, self.skeleton(k))
            features[rows] = np.concatenate([positions, turned], axis=-1)
        return features

    @cached_property
    def window_positions(self) -> FloatArray:
        """Joint positions in the window frame ``[n, T, 21, 3]``, statures: a slice of :meth:`window_features`."""
        return self.window_features()[..., JUDGE_SLICES["position_statures"]]

    def _by_skeleton(self) -> list[tuple[int, NDArray[np.intp], FloatArray, FloatArray]]:
        groups = []
        for k in range(len(self.offsets_m)):
            rows = np.flatnonzero(self.skeleton_index == k)
            rotations = self.rotations_wxyz[rows].astype(np.float64)
            rotations /= np.linalg.norm(rotations, axis=-1, keepdims=True)
            groups.append((k, rows, rotations, self.root_xyz_m[rows].astype(np.float64)))
        return groups
