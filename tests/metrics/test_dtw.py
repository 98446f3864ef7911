"""Exact DTW against a brute-force reference, its tie rule, and the FastDTW backend."""

from __future__ import annotations

from typing import cast

import fastdtw as fastdtw_package
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from bench.arrays import FloatArray
from bench.errors import BadConfig, BadInput
from bench.metrics.dtw import Backend, dtw, fastdtw_build

BACKENDS: tuple[Backend, ...] = ("exact", "fastdtw")


def brute_force(a: FloatArray, b: FloatArray) -> tuple[list[tuple[int, int]], float]:
    """The textbook table, cell by cell, channels summed in order; walked back diagonal first, then up, then left."""
    n, m = len(a), len(b)
    table = np.full((n + 1, m + 1), np.inf)
    table[0, 0] = 0.0
    for i in range(n):
        for j in range(m):
            nearest = min(table[i, j], table[i, j + 1], table[i + 1, j])
            table[i + 1, j + 1] = np.sqrt(sum((a[i] - b[j]) ** 2)) + nearest
    i, j = n, m
    pairs = [(i - 1, j - 1)]
    while (i, j) != (1, 1):
        steps = [(i - 1, j - 1), (i - 1, j), (i, j - 1)]
        i, j = min(steps, key=lambda cell: table[cell])
        pairs.append((i - 1, j - 1))
    return pairs[::-1], float(table[n, m])


def path_of(a: FloatArray, b: FloatArray) -> list[tuple[int, int]]:
    return [(int(i), int(j)) for i, j in dtw(a, b).pairs]


@given(data=st.data(), n=st.integers(1, 13), m=st.integers(1, 13))
@settings(max_examples=150, deadline=None)
def test_small_whole_numbers_give_the_brute_force_path_ties_included(data: st.DataObject, n: int, m: int) -> None:
    """One channel of small whole numbers: every sum is exact, so every tie is a true tie."""
    values = st.integers(-2, 2).map(float)
    a = cast(FloatArray, data.draw(arrays(np.float64, (n, 1), elements=values)))
    b = cast(FloatArray, data.draw(arrays(np.float64, (m, 1), elements=values)))
    pairs, cost = brute_force(a, b)
    assert path_of(a, b) == pairs
    assert dtw(a, b).cost == cost


@pytest.mark.parametrize(
    "shape",
    [
        (1, 1, 6),
        (1, 9, 6),
        (9, 1, 6),
        (40, 33, 6),
        (15, 16, 6),
        (16, 16, 6),
        (17, 15, 6),
        (17, 70, 1),
        (25, 25, 7),
        (30, 90, 63),
        (128, 40, 6),
        (129, 131, 6),
        (300, 140, 2),
    ],
)
def test_random_trajectories_give_the_brute_force_path_and_cost_to_the_last_bit(shape: tuple[int, int, int]) -> None:
    n, m, k = shape
    rng = np.random.default_rng(sum(shape))
    for a, b in (
        (rng.standard_normal((n, k)), rng.standard_normal((m, k))),
        (rng.integers(-1, 2, (n, k)).astype(float), rng.integers(-1, 2, (m, k)).astype(float)),
    ):
        pairs, cost = brute_force(a, b)
        assert path_of(a, b) == pairs
        assert dtw(a, b).cost == cost


def test_value_worked_out_by_hand() -> None:
    """[0, 3, 4] against [0, 4]: 0-0 costs 0, 3 goes to 4 at cost 1, 4-4 costs 0."""
    path = dtw([[0.0], [3.0], [4.0]], [[0.0], [4.0]])
    assert path.pairs.tolist() == [[0, 0], [1, 1], [2, 1]]
    assert path.cost == 1.0


def test_ties_go_back_along_the_diagonal_then_up_then_left() -> None:
    """On constant trajectories every path is free: the walk back takes the diagonal as long as it can."""
    assert dtw(np.zeros((4, 2)), np.zeros((2, 2))).pairs.tolist() == [[0, 0], [1, 0], [2, 0], [3, 1]]
    assert dtw(np.zeros((2, 2)), np.zeros((4, 2))).pairs.tolist() == [[0, 0], [0, 1], [0, 2], [1, 3]]


def test_up_goes_before_left_where_both_beat_the_diagonal() -> None:
    """Totals [[1, 1, 2], [1, 2, 1], [2, 1, 2]]: from the last cell up and left both cost 1, the diagonal 2."""
    assert dtw([[0.0], [1.0], [0.0]], [[1.0], [0.0], [1.0]]).pairs.tolist() == [[0, 0], [0, 1], [1, 2], [2, 2]]


@pytest.mark.parametrize("backend", BACKENDS)
def test_a_trajectory_against_itself_is_the_diagonal_at_no_cost(backend: Backend) -> None:
    a = np.random.default_rng(0).standard_normal((50, 6))
    path = dtw(a, a, backend)
    assert path.cost == 0.0 and path.backend == backend
    assert path.pairs.tolist() == [[i, i] for i in range(50)]


@pytest.mark.parametrize("backend", BACKENDS)
def test_cost_is_the_sum_of_the_distances_of_the_pairs(backend: Backend) -> None:
    rng = np.random.default_rng(1)
    a, b = rng.standard_normal((80, 6)), rng.standard_normal((61, 6))
    path = dtw(a, b, backend)
    assert path.distances(a, b).shape == (len(path.pairs),)
    assert path.cost == pytest.approx(float(path.distances(a, b).sum()), rel=1e-12)
    steps = np.diff(path.pairs, axis=0)
    assert path.pairs[0].tolist() == [0, 0] and path.pairs[-1].tolist() == [79, 60]
    assert {tuple(step) for step in steps.tolist()} <= {(0, 1), (1, 0), (1, 1)}


def test_a_path_is_free_for_the_same_motion_at_another_tempo() -> None:
    a = np.random.default_rng(2).standard_normal((30, 6))
    assert dtw(a, np.repeat(a, 3, axis=0)).cost == 0.0


def test_cost_ignores_argument_order_translation_and_time_reversal() -> None:
    rng = np.random.default_rng(3)
    a, b = rng.standard_normal((45, 6)), rng.standard_normal((52, 6))
    cost = dtw(a, b).cost
    assert dtw(b, a).cost == pytest.approx(cost, rel=1e-12)
    assert dtw(a + 7.0, b + 7.0).cost == pytest.approx(cost, rel=1e-12)
    assert dtw(a[::-1], b[::-1]).cost == pytest.approx(cost, rel=1e-12)
    assert dtw(3.0 * a, 3.0 * b).cost == pytest.approx(3.0 * cost, rel=1e-12)


def test_first_column_of_pairs_belongs_to_the_first_argument() -> None:
    rng = np.random.default_rng(4)
    pairs = dtw(rng.standard_normal((12, 2)), rng.standard_normal((31, 2))).pairs
    assert pairs[:, 0].max() == 11 and pairs[:, 1].max() == 30


def test_fastdtw_never_beats_the_exact_path_and_sometimes_misses_it() -> None:
    rng = np.random.default_rng(5)
    overshoot = []
    for _ in range(10):
        a, b = rng.standard_normal((60, 6)), rng.standard_normal((60, 6))
        overshoot.append(dtw(a, b, "fastdtw").cost / dtw(a, b).cost)
    assert min(overshoot) >= 1.0 - 1e-12
    assert max(overshoot) > 1.001


def test_fastdtw_backend_is_radius_one_with_euclidean_cost() -> None:
    rng = np.random.default_rng(6)
    a, b = rng.standard_normal((70, 6)), rng.standard_normal((50, 6))
    cost, pairs = fastdtw_package.fastdtw(a, b, radius=1, dist=lambda x, y: float(np.sqrt(np.sum((x - y) ** 2))))
    path = dtw(a, b, "fastdtw")
    assert path.cost == pytest.approx(cost, rel=1e-12)
    assert [tuple(pair) for pair in path.pairs.tolist()] == pairs


def test_build_of_fastdtw_is_told_by_where_its_function_lives(monkeypatch: pytest.MonkeyPatch) -> None:
    def fake() -> None: ...

    monkeypatch.setattr(fastdtw_package, "fastdtw", fake)
    fake.__module__ = "fastdtw._fastdtw"
    assert fastdtw_build() == "compiled"
    fake.__module__ = "fastdtw.fastdtw"
    assert fastdtw_build() == "pure-python"


GOOD = np.zeros((4, 6))


@pytest.mark.parametrize("bad", [np.zeros((0, 6)), np.zeros(6), np.full((4, 6), np.nan), np.full((4, 6), np.inf)])
def test_refuses_what_is_no_trajectory(bad: FloatArray) -> None:
    with pytest.raises(BadInput, match=r"^a:"):
        dtw(bad, GOOD)
    with pytest.raises(BadInput, match=r"^b:"):
        dtw(GOOD, bad)


def test_refuses_trajectories_of_unlike_width() -> None:
    with pytest.raises(BadInput, match=r"^b:"):
        dtw(GOOD, np.zeros((4, 3)))


def test_refuses_distances_that_overflow() -> None:
    with pytest.raises(BadInput, match="a, b"):
        dtw(np.full((3, 6), 1e200), np.full((3, 6), -1e200))


def test_refuses_an_unknown_backend() -> None:
    with pytest.raises(BadConfig, match="backend"):
        dtw(GOOD, GOOD, cast(Backend, "soft"))
