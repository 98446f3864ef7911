"""A cell's generated motions as arrays: stored once, scored as often as needed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.errors import BadFile, BadInput
from bench.motion.clip import Clip
from bench.motion.kinematics import forward_kinematics
from bench.motion.representation import JUDGE_SLICES, window_frame
from bench.motion.skeleton import Skeleton, canonical_skeleton
from bench.suite.store import Store
from reports.records import digest_of_arrays

MOTIONS_FILE = "motions.npz"


def put_given(store: Store, key: str, motions: Motions) -> None:
    """Store motions that were not generated here, as if they had been."""

    def write(draft: Path) -> dict[str, object]:
        motions.save(draft)
        return {"motions_digest": motions.digest, "n": motions.n, "wall_s": 0.0, "peak_rss_mb": 0.0}

    if not store.has("motions", key):
        store.put("motions", key, write)


@dataclass(frozen=True, eq=False)
class Motions:
    """n motions on canonical skeletons, one after the other, with the labels they are scored under.

    Most tracks store windows of equal length, which the array properties stack; sequences may differ in length and are
    taken out one by one with :meth:`clip`.

    Attributes
    ----------
    rotations_wxyz : ``[F, 21, 4]`` float32, F frames of all motions.
    root_xyz_m : ``[F, 3]`` float32.
    lengths : ``[n]`` frames of each motion.
    offsets_m : ``[k, 21, 3]`` the different skeletons.
    virtual : ``[k, 21]`` virtual joints of each skeleton.
    skeleton_index : ``[n]`` which skeleton each motion has.
    contents, styles : ``[n]`` labels under which each motion is scored.
    fps : frames per second.
    """

    rotations_wxyz: NDArray[np.float32]
    root_xyz_m: NDArray[np.float32]
    lengths: NDArray[np.int32]
    offsets_m: FloatArray
    virtual: NDArray[np.bool_]
    skeleton_index: NDArray[np.int32]
    contents: NDArray[np.str_]
    styles: NDArray[np.str_]
    fps: float

    @classmethod
    def of(cls, takes: Sequence[Take]) -> Motions:
        """Collect the clips of some takes."""
        different = {take.clip.skeleton.identity: take.clip.skeleton for take in takes}
        place = {identity: number for number, identity in enumerate(different)}
        skeletons = list(different.values())
        return cls(
            np.concatenate([take.clip.rotations_wxyz for take in takes]).astype(np.float32),
            np.concatenate([take.clip.root_xyz_m for take in takes]).astype(np.float32),
            np.array([take.clip.n_frames for take in takes], dtype=np.int32),
            np.stack([skeleton.offsets_m for skeleton in skeletons]),
            np.stack([[name in s.virtual for name in s.names] for s in skeletons]),
            np.array([place[take.clip.skeleton.identity] for take in takes], dtype=np.int32),
            np.array([str(take.content) for take in takes]),
            np.array([str(take.style) for take in takes]),
            takes[0].clip.fps,
        )

    @property
    def n(self) -> int:
        return len(self.lengths)

    @property
    def n_frames(self) -> int:
        """Frames of every motion.

        Raises
        ------
        BadInput : their lengths differ.
        """
        if (self.lengths != self.lengths[0]).any():
            raise BadInput(
                f"windows of equal length expected, got {self.lengths.min()} to {self.lengths.max()} frames",
                where="motions",
            )
        return int(self.lengths[0])

    @cached_property
    def starts(self) -> IntArray:
        """``[n]`` first frame of each motion."""
        return np.concatenate([[0], np.cumsum(self.lengths)[:-1]]).astype(np.int64)

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays by name, as stored and digested."""
        return {
            "rotations_wxyz": self.rotations_wxyz,
            "root_xyz_m": self.root_xyz_m,
            "lengths": self.lengths,
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

    def take(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Motions:
        """Some of the motions."""
        chosen = np.arange(self.n)[rows]
        frames = np.concatenate([self.starts[i] + np.arange(self.lengths[i]) for i in chosen])
        return replace(
            self,
            rotations_wxyz=self.rotations_wxyz[frames],
            root_xyz_m=self.root_xyz_m[frames],
            lengths=self.lengths[chosen],
            skeleton_index=self.skeleton_index[chosen],
            contents=self.contents[chosen],
            styles=self.styles[chosen],
        )

    def skeleton(self, index: int) -> Skeleton:
        """One of the skeletons."""
        base = canonical_skeleton(self.offsets_m[index])
        names = frozenset(name for name, virtual in zip(base.names, self.virtual[index], strict=True) if virtual)
        return canonical_skeleton(self.offsets_m[index], names)

    @cached_property
    def skeletons(self) -> tuple[Skeleton, ...]:
        """The different skeletons."""
        return tuple(self.skeleton(index) for index in range(len(self.offsets_m)))

    @property
    def real_joints(self) -> tuple[int, ...]:
        """Joints that no skeleton has as virtual."""
        return tuple(np.flatnonzero(~self.virtual.any(axis=0)).tolist())

    @property
    def statures_m(self) -> FloatArray:
        """``[n]`` stature of each motion's skeleton."""
        return np.array([skeleton.stature_m for skeleton in self.skeletons])[self.skeleton_index]

    def clip(self, sample: int) -> Clip:
        """One motion as a clip."""
        frames = slice(self.starts[sample], self.starts[sample] + self.lengths[sample])
        return Clip(
            self.skeletons[int(self.skeleton_index[sample])],
            self.rotations_wxyz[frames].astype(np.float64),
            self.root_xyz_m[frames].astype(np.float64),
            self.fps,
        )

    def world_positions(self) -> FloatArray:
        """World joint positions of equally long motions ``[n, T, 21, 3]``, metres."""
        positions = np.empty((self.n, self.n_frames, 21, 3))
        for k, rows, rotations, root in self._by_skeleton():
            positions[rows] = forward_kinematics(rotations, root, self.skeletons[k])[0]
        return positions

    def window_features(self) -> FloatArray:
        """What judges read, for equally long motions: ``[n, T, 21, 7]``, slices in ``representation.JUDGE_SLICES``."""
        features = np.empty((self.n, self.n_frames, 21, 7))
        for k, rows, rotations, root in self._by_skeleton():
            positions, turned = window_frame(rotations, root, self.skeletons[k])
            features[rows] = np.concatenate([positions, turned], axis=-1)
        return features

    @cached_property
    def window_positions(self) -> FloatArray:
        """Joint positions in the window frame ``[n, T, 21, 3]``, statures: a slice of :meth:`window_features`."""
        return self.window_features()[..., JUDGE_SLICES["position_statures"]]

    @property
    def window_rotations_wxyz(self) -> FloatArray:
        """Local rotations of equally long motions ``[n, T, 21, 4]``, unit quaternions."""
        rotations = self.rotations_wxyz.reshape(self.n, self.n_frames, 21, 4).astype(np.float64)
        return np.asarray(rotations / np.linalg.norm(rotations, axis=-1, keepdims=True))

    def _by_skeleton(self) -> list[tuple[int, NDArray[np.intp], FloatArray, FloatArray]]:
        groups = []
        rotations = self.window_rotations_wxyz
        root = self.root_xyz_m.reshape(self.n, self.n_frames, 3).astype(np.float64)
        for k in range(len(self.offsets_m)):
            rows = np.flatnonzero(self.skeleton_index == k)
            groups.append((k, rows, rotations[rows], root[rows]))
        return groups
