"""Xia et al. 2015, Realtime Style Transfer for Unlabeled Heterogeneous Human Motion (ACM TOG 34, 4).

For every frame: the nearest windows of the database, a mixture of linear autoregressive models fitted to them and to
their registered partners in the wanted style, and the timing of those partners. What comes in needs no labels: each
style among the neighbours has a model of its own in the mixture, with the weight of its neighbours.

How many neighbours, components and past frames the paper uses is not known to us; ours are in :class:`XiaConfig`.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import KDTree

from bench.arrays import FloatArray, IntArray
from bench.errors import BadInput
from bench.methods.windows import at_training_rate
from bench.methods.xia2015.database import Database, XiaConfig
from bench.methods.xia2015.poses import (
    N_VECTORS,
    WINDOW_FRAMES,
    Poses,
    joined_poses,
    last_frames,
    read_poses,
    search_windows,
    to_rotations,
)
from bench.motion.clip import Clip
from bench.motion.edit import crop


class Xia2015:
    """A database with its search tree; everything that a transfer needs."""

    def __init__(self, database: Database, config: XiaConfig) -> None:
        self.database, self.config = database, config
        self.tree = KDTree(database.searched)
        self.skeleton = database.skeleton
        self.codes = database.poses @ database.pose_basis

    def style_index(self, style: str | None) -> int:
        """The column of a style.

        Raises
        ------
        BadInput : a label without examples.
        """
        labels = self.database.style_labels
        if style not in labels:
            raise BadInput(
                f"the database has the styles {', '.join(labels)}, got {style!r}",
                where="style",
                cause="a style is known by its examples, and there are none of this one",
            )
        return labels.index(str(style))

    def neighbours(self, windows: FloatArray) -> tuple[IntArray, FloatArray]:
        """Rows ``[T, K]`` nearest to windows ``[T, D]`` and their weights ``[T, K]``, which sum to 1."""
        database = self.database
        n_neighbours = min(self.config.neighbours, len(database.searched))
        searched = (windows - database.search_mean) @ database.search_basis
        found, rows = self.tree.query(searched, k=[*range(1, n_neighbours + 1)])
        distances = np.asarray(found)
        width = np.maximum(self.config.bandwidth * distances[:, -1:], 1e-9)
        weights = np.exp(-0.5 * np.square(distances / width))
        return np.asarray(rows), weights / weights.sum(axis=1, keepdims=True)


class XiaStream:
    """An open transfer into one style.

    Attributes
    ----------
    timing : frames of the style's own motion that pass while one frame of the source passes, of the last frame.
    """

    def __init__(self, method: Xia2015, style: str | None) -> None:
        self.method, self.style = method, method.style_index(style)
        self.before: Poses | None = None
        self.past: tuple[FloatArray, ...] = ()
        self.timing = 1.0

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Answer one frame: ``[21, 4]`` and ``[3]`` in, the same out."""
        turned, root, _ = self.frames(rotations_wxyz[None], root_xyz_m[None])
        return turned[0], root[0]

    def frames(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Frames that follow those before: rotations ``[T, 21, 4]``, root ``[T, 3]``, timing ``[T]``.

        The root moves as the source's; its height changes as between the registered frames.
        """
        method, database = self.method, self.method.database
        poses = read_poses(rotations_wxyz, root_xyz_m, method.skeleton, database.reference_wxyz)
        rows, weights = method.neighbours(search_windows(poses, self.before))
        joined = poses if self.before is None else joined_poses(self.before, poses)
        self.before = last_frames(joined, WINDOW_FRAMES - 1)
        made, timing = np.empty((len(rows), N_VECTORS + 1)), np.empty(len(rows))
        for t in range(len(rows)):
            made[t], timing[t] = self._frame(poses.vectors[t], rows[t], weights[t])
        self.timing = float(timing[-1])
        rise = np.zeros_like(root_xyz_m)
        rise[:, 1] = made[:, -1]
        return to_rotations(made[:, :-1], poses.yaw_rad, database.reference_wxyz), root_xyz_m + rise, timing

    def _frame(self, vector: FloatArray, rows: IntArray, weights: FloatArray) -> tuple[FloatArray, float]:
        """The pose ``[64]`` of one frame (63 numbers, then the change of height) and its timing."""
        database, config = self.method.database, self.method.config
        partners = database.partners[rows, self.style]
        poses = database.poses
        # the height of a source is that of its own body, so the models see and give differences
        wanted = poses[partners].copy()
        wanted[:, -1] -= poses[rows, -1]
        heights = poses[rows, -1]
        seen = [np.append(vector, weights @ heights)]
        examples = [poses[rows]]
        first = database.starts[partners]
        for back, earlier in enumerate(self.past, start=1):
            there = poses[np.maximum(partners - back, first)].copy()
            there[:, -1] -= heights
            seen.append(earlier)
            examples.append(there)
        basis = database.pose_basis
        code = np.concatenate([one @ basis for one in seen])
        codes = np.concatenate([example @ basis for example in examples], axis=1)
        made = mixture(code, codes, wanted, weights, database.styles[rows], config.ridge)
        slopes = database.slopes[rows, self.style]
        timing = float(weights @ slopes)
        if self.past:
            moved = poses[partners] - poses[np.maximum(partners - 1, first)]
            moved[:, -1] = 0.0
            velocity = weights @ (moved * slopes[:, None])
            made = (made + config.smoothness * (self.past[0] + velocity)) / (1.0 + config.smoothness)
        self.past = (made, *self.past)[: config.order]
        return made, timing

    def copy(self) -> XiaStream:
        """A second stream that goes on from here on its own; what is kept is replaced, never written to."""
        twin = object.__new__(XiaStream)
        twin.__dict__.update(self.__dict__)
        return twin


def mixture(
    code: FloatArray, codes: FloatArray, wanted: FloatArray, weights: FloatArray, styles: IntArray, ridge: float
) -> FloatArray:
    """What a mixture of linear models, one for each style among the examples, makes of a code.

    Each model is the weighted ridge regression of its own examples about their own means, in its dual form; all of them
    are one system of equations, since examples of two styles do not meet. The models' shares are their weights.

    Parameters
    ----------
    code : ``[d]``. codes : ``[K, d]``. wanted : ``[K, p]``.
    weights : ``[K]``, sum 1. styles : ``[K]``.
    ridge : share of the mean squared length of the centred codes.
    """
    member = (styles[:, None] == np.unique(styles)[None]).astype(np.float64)
    shares = weights @ member
    within = member @ (member * weights[:, None]).T / (member @ shares)[:, None]
    code_means, wanted_means = within @ codes, within @ wanted
    centred, targets = codes - code_means, wanted - wanted_means
    gram = centred @ centred.T * (member @ member.T)
    penalty = ridge * (weights @ np.square(centred).sum(axis=1)) + 1e-12
    dual = np.linalg.solve(gram + np.diag(penalty / np.maximum(weights * len(weights), 1e-6)), targets)
    shares_of = member @ shares
    kernel = ((code - code_means) * centred).sum(axis=1) * shares_of
    return np.asarray(weights @ wanted + kernel @ dual)


def transfer(method: Xia2015, content: Clip, style: str | None) -> Clip:
    """A whole clip as a stream of its frames at 30 fps, in step with its source."""

    def answer(clip: Clip) -> Clip:
        turned, root, _ = XiaStream(method, style).frames(clip.rotations_wxyz, clip.root_xyz_m)
        return clip.with_motion(turned, root)

    return at_training_rate(content, answer)


def transfer_with_timing(method: Xia2015, content: Clip, style: str | None) -> Clip:
    """As :func:`transfer`, then played at the style's own timing: as long as the partners of its frames were."""
    turned, root, timing = XiaStream(method, style).frames(content.rotations_wxyz, content.root_xyz_m)
    return retimed(content.with_motion(turned, root), timing)


def retimed(clip: Clip, timing: FloatArray) -> Clip:
    """A clip whose frame ``t`` takes ``timing[t]`` frames; ``[T]``, at least a twentieth of a frame each."""
    ends = np.cumsum(np.maximum(timing[1:], 0.05))
    times = np.concatenate([[0.0], ends])
    n_frames = max(1, int(np.floor(times[-1])) + 1)
    nearest = np.round(np.interp(np.arange(n_frames), times, np.arange(clip.n_frames))).astype(np.int64)
    return crop(clip.with_motion(clip.rotations_wxyz[nearest], clip.root_xyz_m[nearest]), 0, n_frames)
