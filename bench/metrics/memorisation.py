"""Memorisation: is an output a copy of motion that the method was given?

Conventions: a descriptor is one row ``[D]`` of a window: joint positions of some of its poses, root-relative,
yaw-aligned and divided by stature, scaled so that the Euclidean distance of two rows is the RMS joint distance in
statures (0.02 is about 3 cm on an adult). Queries are outputs, the bank is what the method was given: windows of the
fit part, of the source and of the style reference, at every start that counts and mirrored.

- ``pose_descriptors``, ``window_descriptors``, ``mirrored_positions``: motion to descriptors.
- ``nearest_distance``: distance to the nearest row of a bank. ``nearest_distance_within``: of the query's own group.
- ``copy_threshold``, ``copied``: copied share = share of outputs nearer than 5 % of real takes are.
- ``neighbour_ratio``: nearest distance to what was given over that to unseen real motion.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from bench.arrays import BoolArray, FloatArray, IntArray, finite_array
from bench.errors import BadInput
from bench.metrics.conditional import check_labels

Float32Array = NDArray[np.float32]

QUERIES_PER_CHUNK = 256
CANDIDATES_PER_CHUNK = 4096
EXPANSION_ERROR = 32.0 * float(np.finfo(np.float32).eps)
"""Bound, in units of |query|^2 + |row|^2, on the rounding of a squared distance from a float32 matrix product."""


def pose_descriptors(positions_m: ArrayLike, step: int = 8) -> Float32Array:
    """Descriptors ``[n, D]`` of windows ``[n, T, J, 3]``: every ``step``-th pose, from frame 0; D = poses x J x 3.

    Parameters
    ----------
    positions_m : root-relative, yaw-aligned, divided by stature.
    step : frames between the poses; 8 gives 8 poses of a 64-frame window.

    Raises
    ------
    BadInput : another shape, NaN, a step outside 1..T.
    """
    positions = finite_array(positions_m, "positions_m", (None, None, None, 3))
    _check_step(step, positions.shape[1])
    poses = positions[:, ::step]
    scale = 1.0 / np.sqrt(poses.shape[1] * poses.shape[2])
    return np.asarray((poses * scale).reshape(len(poses), -1), dtype=np.float32)


def window_descriptors(
    positions_m: ArrayLike, starts: Sequence[int], *, n_frames: int = 64, step: int = 8
) -> Float32Array:
    """Descriptors ``[len(starts), D]`` of the windows of one motion ``[F, J, 3]`` that begin at ``starts``.

    Raises
    ------
    BadInput : as ``pose_descriptors``, or a window that reaches beyond the motion.
    """
    positions = finite_array(positions_m, "positions_m", (None, None, 3))
    first = np.asarray(starts, dtype=np.int64)
    if first.size == 0 or first.min() < 0 or first.max() + n_frames > len(positions):
        raise BadInput(f"windows of {n_frames} frames must lie within {len(positions)} frames", where="starts")
    _check_step(step, n_frames)
    poses = positions[first[:, None] + np.arange(0, n_frames, step)]
    return pose_descriptors(poses, step=1)


def mirrored_positions(positions_m: ArrayLike, mirror_joints: Sequence[int]) -> FloatArray:
    """Left-right mirror of positions ``[..., J, 3]``: x changes sign, joints change sides.

    Raises
    ------
    BadInput : NaN, or ``mirror_joints`` that is not a permutation of the J joints.
    """
    positions = np.asarray(positions_m, dtype=np.float64)
    if positions.ndim < 2 or positions.shape[-1] != 3 or not np.isfinite(positions).all():
        raise BadInput(f"positions_m must be finite [..., J, 3], got {list(positions.shape)}", where="positions_m")
    if sorted(mirror_joints) != list(range(positions.shape[-2])):
        raise BadInput(f"mirror_joints must permute {positions.shape[-2]} joints", where="mirror_joints")
    return np.asarray(positions[..., list(mirror_joints), :] * np.array([-1.0, 1.0, 1.0]))


def nearest_distance(
    queries: ArrayLike,
    bank: ArrayLike,
    *,
    query_groups: ArrayLike | None = None,
    bank_groups: ArrayLike | None = None,
) -> FloatArray:
    """Distance from each query ``[n, D]`` to its nearest row of ``bank`` ``[m, D]``: ``[n]``.

    A float32 matrix product finds every row that could be the nearest; those are measured exactly in float64.

    Parameters
    ----------
    query_groups, bank_groups : ``[n]`` or ``[n, g]``, and ``[m]`` integers, both or none: rows of a query's own groups
        (the takes it was made from) are passed over.

    Raises
    ------
    BadInput : NaN, different D, one of the groups alone, a query without a row left.
    """
    wanted, rows = _checked_pair(queries, bank)
    own = _checked_groups(query_groups, bank_groups, len(wanted), len(rows))
    centre = rows.mean(axis=0, dtype=np.float64).astype(np.float32)
    bank_centred = rows - centre
    bank_squares = np.einsum("md,md->m", bank_centred, bank_centred)
    result = np.empty(len(wanted))
    for first in range(0, len(wanted), QUERIES_PER_CHUNK):
        part = slice(first, first + QUERIES_PER_CHUNK)
        query = wanted[part] - centre
        query_squares = np.einsum("nd,nd->n", query, query)[:, None]
        squared = query @ bank_centred.T
        squared *= -2.0
        squared += bank_squares
        squared += query_squares
        if own is not None:
            for group in own[0][part].T:
                squared[group[:, None] == own[1]] = np.inf
        best = squared.min(axis=1, keepdims=True)
        _refuse_empty(best, first)
        slack = 2.0 * EXPANSION_ERROR * (query_squares + bank_squares.max())
        result[part] = _exact_minimum(wanted[part], rows, squared <= best + slack)
    return result


def nearest_distance_within(
    queries: ArrayLike, bank: ArrayLike, *, query_groups: ArrayLike, bank_groups: ArrayLike
) -> FloatArray:
    """Like ``nearest_distance``, among the rows of the query's own group only (its source, its style reference).

    Raises
    ------
    BadInput : as ``nearest_distance``; a query whose group has no row.
    """
    wanted, rows = _checked_pair(queries, bank)
    of_bank = check_labels(bank_groups, "bank_groups", len(rows))
    of_queries = check_labels(query_groups, "query_groups", len(wanted))
    order = np.argsort(of_bank, kind="stable")
    result = np.empty(len(wanted))
    for group in np.unique(of_queries).tolist():
        begin, end = np.searchsorted(of_bank[order], [group, group + 1])
        if begin == end:
            raise BadInput(f"group {group} has no row in the bank", where="bank_groups")
        members = np.flatnonzero(of_queries == group)
        result[members] = nearest_distance(wanted[members], rows[order[begin:end]])
    return result


def copy_threshold(real_distances: ArrayLike, quantile: float = 0.05) -> float:
    """Distance below which an output counts as a copy: a low quantile of the same distance for real takes ``[n]``.

    Raises
    ------
    BadInput : NaN, negative distances, a quantile outside 0..1.
    """
    distances = _checked_distances(real_distances, "real_distances")
    if not 0.0 < quantile < 1.0:
        raise BadInput(f"quantile must lie between 0 and 1, got {quantile}", where="quantile")
    return float(np.quantile(distances, quantile))


def copied(distances: ArrayLike, threshold: float) -> BoolArray:
    """Whether each output ``[n]`` is nearer to given motion than ``threshold``: ``[n]``; its mean is the copied share.

    Raises
    ------
    BadInput : NaN, negative distances, a threshold that is not positive (real takes that repeat each other).
    """
    if not np.isfinite(threshold) or threshold <= 0.0:
        raise BadInput(f"threshold must be positive, got {threshold}", where="threshold", cause="duplicate real takes")
    return np.asarray(_checked_distances(distances, "distances") < threshold)


def neighbour_ratio(given_distances: ArrayLike, unseen_distances: ArrayLike) -> float:
    """Median nearest distance of outputs to given motion over that to unseen real motion (1 ideal, below 1 memorised).

    The larger bank has the nearer neighbours by chance: give both the same size.

    Raises
    ------
    BadInput : NaN, negative distances, a median of zero to unseen motion.
    """
    unseen = float(np.median(_checked_distances(unseen_distances, "unseen_distances")))
    given = float(np.median(_checked_distances(given_distances, "given_distances")))
    if unseen <= 0.0:
        raise BadInput("the median must be positive, got 0", where="unseen_distances", cause="outputs of unseen takes")
    return given / unseen


def _exact_minimum(queries: Float32Array, bank: Float32Array, candidates: BoolArray) -> FloatArray:
    """Float64 distance of each query to the nearest of its candidate rows, which are at least one each."""
    query_index, bank_index = np.nonzero(candidates)
    smallest = np.full(len(queries), np.inf)
    for first in range(0, len(query_index), CANDIDATES_PER_CHUNK):
        part = slice(first, first + CANDIDATES_PER_CHUNK)
        gap = queries[query_index[part]].astype(np.float64) - bank[bank_index[part]]
        np.minimum.at(smallest, query_index[part], np.einsum("kd,kd->k", gap, gap))
    return np.asarray(np.sqrt(smallest))


def _refuse_empty(best: Float32Array, first: int) -> None:
    lonely = np.flatnonzero(np.isinf(best[:, 0]))
    if lonely.size:
        raise BadInput(
            f"query {first + int(lonely[0])} has no row left in the bank", where="bank_groups", cause="one group only"
        )


def _checked_pair(queries: ArrayLike, bank: ArrayLike) -> tuple[Float32Array, Float32Array]:
    checked = []
    for values, name in ((queries, "queries"), (bank, "bank")):
        array = np.ascontiguousarray(values, dtype=np.float32)
        if array.ndim != 2 or 0 in array.shape or not np.isfinite(array).all():
            raise BadInput(f"{name} must be finite [rows, D], got shape {list(array.shape)}", where=name)
        checked.append(array)
    if checked[0].shape[1] != checked[1].shape[1]:
        raise BadInput(
            f"queries must have {checked[1].shape[1]} columns like the bank, got {checked[0].shape[1]}",
            where="queries",
            cause="another window length or step",
        )
    return checked[0], checked[1]


def _checked_groups(
    query_groups: ArrayLike | None, bank_groups: ArrayLike | None, n_queries: int, n_bank: int
) -> tuple[IntArray, IntArray] | None:
    if bank_groups is None and query_groups is None:
        return None
    if bank_groups is None or query_groups is None:
        missing = "bank_groups" if bank_groups is None else "query_groups"
        raise BadInput(f"{missing} is missing: give both groups or none", where=missing)
    groups = np.asarray(query_groups)
    columns = groups[:, None] if groups.ndim == 1 else groups
    if columns.ndim != 2 or 0 in columns.shape:
        raise BadInput(f"query_groups must be [n] or [n, g], got {list(groups.shape)}", where="query_groups")
    own = [check_labels(column, "query_groups", n_queries) for column in columns.T]
    return np.stack(own, axis=1), check_labels(bank_groups, "bank_groups", n_bank)


def _checked_distances(values: ArrayLike, name: str) -> FloatArray:
    distances = finite_array(values, name, (None,))
    if (distances < 0.0).any():
        raise BadInput(f"{name} must not be negative, got {distances.min():.3g}", where=name)
    return distances


def _check_step(step: int, n_frames: int) -> None:
    if not 1 <= step <= n_frames:
        raise BadInput(f"step must lie in 1..{n_frames}, got {step}", where="step")
