"""Registered examples: every frame of the fit part with its partner in every style.

Takes of one content in two styles are aligned by dynamic time warping. The paper registers its data in a way of its
own; this is ours.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.errors import BadData, BadFile
from bench.methods.saved import CONFIG_FILE
from bench.methods.training import Progress
from bench.methods.windows import FPS
from bench.methods.xia2015.poses import mean_reference, read_poses, search_windows
from bench.metrics.dtw import dtw
from bench.motion.clip import Clip
from bench.motion.edit import resample
from bench.motion.skeleton import Skeleton, canonical_skeleton

DATABASE_FILE = "database.npz"
SLOPE_FRAMES = 4
"""The timing of a frame is the slope of the alignment over this many frames to both sides."""


@dataclass(frozen=True)
class XiaConfig:
    """Declared by us where the paper's numbers are not known to us.

    Attributes
    ----------
    neighbours : K. order : past output frames that a model sees.
    search_dims, pose_dims : principal components in which neighbours are searched, and that the models see.
    bandwidth : of the Gaussian weights of neighbours, as a share of the distance of the K-th.
    ridge : of the local regressions. smoothness : weight of the predicted velocity beside the predicted pose.
    candidates : takes of the target style with which a take is aligned; the best stays.
    takes_per_cell : of the fit part that make the database; 0 for all.
    """

    neighbours: int = 96
    order: int = 2
    search_dims: int = 16
    pose_dims: int = 12
    bandwidth: float = 0.5
    ridge: float = 0.1
    smoothness: float = 4.0
    candidates: int = 4
    takes_per_cell: int = 0


CONFIGS = {"smoke": XiaConfig(takes_per_cell=1, candidates=1), "small": XiaConfig(), "paper": XiaConfig()}


@dataclass(frozen=True, eq=False)
class Database:
    """All frames of all takes, one after the other.

    Attributes
    ----------
    reference_wxyz : ``[21, 4]`` mean rotations. offsets_m : ``[21, 3]`` mean bones.
    search_mean, search_basis : ``[D]`` and ``[D, search_dims]``, from windows to where neighbours are near.
    searched : ``[n, search_dims]``.
    pose_basis : ``[64, pose_dims]``, from poses to what the models see.
    poses : ``[n, 64]`` rotation vectors and the root's height in metres.
    styles : ``[n]`` index of each frame's style.
    starts : ``[n]`` the first frame of each frame's take.
    partners : ``[n, n_styles]`` the registered frame in each style. slopes : ``[n, n_styles]`` frames of that style a
        frame of this one.
    style_labels : sorted.
    """

    reference_wxyz: FloatArray
    offsets_m: FloatArray
    search_mean: FloatArray
    search_basis: FloatArray
    searched: FloatArray
    pose_basis: FloatArray
    poses: FloatArray
    styles: IntArray
    starts: IntArray
    partners: IntArray
    slopes: FloatArray
    style_labels: tuple[str, ...]

    @property
    def skeleton(self) -> Skeleton:
        """The mean skeleton."""
        return canonical_skeleton(self.offsets_m)

    def save(self, folder: Path) -> None:
        """Store as one ``.npz`` without pickles."""
        arrays = {name: value for name, value in vars(self).items() if name != "style_labels"}
        np.savez(folder / DATABASE_FILE, style_labels=np.array(self.style_labels, dtype=np.str_), **arrays)

    @classmethod
    def load(cls, folder: Path) -> Database:
        """Restore what :meth:`save` stored.

        Raises
        ------
        BadFile : no such file, or not a database.
        """
        try:
            with np.load(folder / DATABASE_FILE, allow_pickle=False) as stored:
                labels = tuple(str(label) for label in stored["style_labels"])
                return cls(style_labels=labels, **{name: stored[name] for name in stored if name != "style_labels"})
        except (OSError, KeyError, ValueError, TypeError) as error:
            raise BadFile(f"not a database of Xia 2015: {error}", where=str(folder / DATABASE_FILE)) from error


def save_config(folder: Path, config: XiaConfig) -> None:
    """Write the config where :func:`bench.methods.saved.read_config` reads it."""
    (folder / CONFIG_FILE).write_text(json.dumps(dataclasses.asdict(config), indent=1, sort_keys=True))


def build_database(takes: Sequence[Take], config: XiaConfig, progress: Progress) -> Database:
    """Read, register and index labelled takes.

    Raises
    ------
    BadData : no takes, or a take without labels.
    """
    if not takes or any(take.style is None or take.content is None for take in takes):
        raise BadData("registration needs takes with content and style labels", where="takes")
    takes = _limited(takes, config.takes_per_cell)
    clips = [resample(take.clip, FPS) for take in takes]
    reference, offsets = mean_reference(clips), np.mean([clip.skeleton.offsets_m for clip in clips], axis=0)
    windows, poses = zip(*(_read(clip, reference) for clip in clips), strict=True)
    all_windows, all_poses = np.concatenate(windows), np.concatenate(poses)
    mean, basis = search_space(all_windows, config.search_dims)
    style_labels = tuple(sorted({str(take.style) for take in takes}))
    starts = np.cumsum([0, *(clip.n_frames for clip in clips[:-1])])
    searched = (all_windows - mean) @ basis
    pieces = np.split(searched, starts[1:])
    partners, slopes = _registered(takes, style_labels, pieces, starts, config.candidates, progress)
    centred = all_poses - all_poses.mean(axis=0)
    lengths = [clip.n_frames for clip in clips]
    return Database(
        reference_wxyz=reference,
        offsets_m=offsets,
        search_mean=mean,
        search_basis=basis,
        searched=searched,
        pose_basis=_components(centred, config.pose_dims),
        poses=all_poses,
        styles=np.repeat([style_labels.index(str(take.style)) for take in takes], lengths),
        starts=np.repeat(starts, lengths),
        partners=partners,
        slopes=slopes,
        style_labels=style_labels,
    )


def _limited(takes: Sequence[Take], per_cell: int) -> list[Take]:
    if per_cell == 0:
        return list(takes)
    kept: list[Take] = []
    counts: dict[tuple[str | None, str | None], int] = {}
    for take in takes:
        cell = (take.content, take.style)
        counts[cell] = counts.get(cell, 0) + 1
        if counts[cell] <= per_cell:
            kept.append(take)
    return kept


def _read(clip: Clip, reference_wxyz: FloatArray) -> tuple[FloatArray, FloatArray]:
    poses = read_poses(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton, reference_wxyz)
    return search_windows(poses), np.concatenate([poses.vectors, clip.root_xyz_m[:, 1:2]], axis=1)


def search_space(windows: FloatArray, n_dims: int) -> tuple[FloatArray, FloatArray]:
    """Mean ``[D]`` and basis ``[D, n_dims]``; pose, its change and the root's motion count by their own spread."""
    n_pose = (windows.shape[1] - 4) // 2
    scale = np.empty(windows.shape[1])
    for columns in (slice(0, n_pose), slice(n_pose, 2 * n_pose), slice(2 * n_pose, 2 * n_pose + 3), slice(-1, None)):
        part = windows[:, columns]
        scale[columns] = np.sqrt(part.var(axis=0).sum()) + 1e-9
    mean = windows.mean(axis=0)
    return mean, _components((windows - mean) / scale, n_dims) / scale[:, None]


def _components(centred: FloatArray, n_dims: int) -> FloatArray:
    """Leading principal directions ``[D, n_dims]``."""
    values, vectors = np.linalg.eigh(centred.T @ centred)
    return np.ascontiguousarray(vectors[:, np.argsort(values)[::-1][:n_dims]])


def _registered(
    takes: Sequence[Take],
    style_labels: Sequence[str],
    pieces: Sequence[FloatArray],
    starts: IntArray,
    candidates: int,
    progress: Progress,
) -> tuple[IntArray, FloatArray]:
    """Partners and slopes ``[n, n_styles]``; a frame is its own partner in its own style."""
    partners = [np.empty((len(piece), len(style_labels)), dtype=np.int64) for piece in pieces]
    slopes = [np.ones((len(piece), len(style_labels))) for piece in pieces]
    for row, take in enumerate(takes):
        progress("registration", row, len(takes))
        for column, style in enumerate(style_labels):
            if style == take.style:
                partners[row][:, column] = starts[row] + np.arange(len(pieces[row]))
                continue
            there = [other for other, found in enumerate(takes) if found.style == style]
            same = [other for other in there if takes[other].content == take.content]
            pool = same or there
            # the takes of a cell in turn, so that all of them find partners
            chosen = [pool[(row + shift) % len(pool)] for shift in range(min(candidates, len(pool)))]
            paths = [dtw(pieces[row], pieces[other]) for other in chosen]
            best = min(range(len(paths)), key=lambda place: paths[place].cost / len(paths[place].pairs))
            times = warp(paths[best].pairs, len(pieces[row]))
            partners[row][:, column] = starts[chosen[best]] + np.round(times).astype(np.int64)
            slopes[row][:, column] = slope(times)
    progress("registration", len(takes), len(takes))
    return np.concatenate(partners), np.concatenate(slopes)


def warp(pairs: IntArray, n_frames: int) -> FloatArray:
    """The mean partner of every frame along a path ``[L, 2]``, ``[n_frames]``; never decreasing."""
    counts = np.bincount(pairs[:, 0], minlength=n_frames)
    return np.asarray(np.bincount(pairs[:, 0], weights=pairs[:, 1], minlength=n_frames) / counts)


def slope(times: FloatArray) -> FloatArray:
    """Frames of the partner a frame, over a few frames to both sides, ``[T]``; 1 for a single frame."""
    frames = np.arange(len(times))
    low, high = np.maximum(frames - SLOPE_FRAMES, 0), np.minimum(frames + SLOPE_FRAMES, len(times) - 1)
    return np.where(high > low, (times[high] - times[low]) / np.maximum(high - low, 1), 1.0)
