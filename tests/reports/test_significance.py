"""The statistics keep their promises on synthetic data: coverage, ties of equals, separation of unequals."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from reports.aggregate import tie_groups
from reports.bootstrap import cluster_counts, interval, mean_replicates
from reports.rows import load_run, rows_of
from reports.significance import SIGNIFICANCE, replicate_difference
from tests.reports.factory import FakeMethod, FakeTasks, clustered_hits, make_row, write_row

N_CLUSTERS = 197
N_SAMPLES = 2500
N_REPEATS = 200
PRIMARY = ("joint_recognition", "different_content")

Values = NDArray[np.float64]


def clusters() -> NDArray[np.int64]:
    return np.arange(N_SAMPLES) % N_CLUSTERS


def repeat(shares: tuple[float, float], seed: int) -> tuple[Values, Values, NDArray[np.int32]]:
    """Samples (percent) of two methods that find the same clusters hard, and shared replicate counts."""
    rng = np.random.default_rng([seed, 5])
    difficulty = rng.standard_normal(N_CLUSTERS)
    a, b = (
        np.where(clustered_hits(clusters(), share, rng, spread=0.6, difficulty=difficulty), 100.0, 0.0)
        for share in shares
    )
    return a, b, cluster_counts(clusters(), seed=seed)


def differences(shares: tuple[float, float], judge: Callable[[float, float, float], bool]) -> float:
    """Share of repeats in which ``judge(low, high, p)`` of the paired difference holds."""
    told = 0
    for seed in range(N_REPEATS):
        a, b, counts = repeat(shares, seed)
        found = replicate_difference(
            a.mean(), b.mean(), mean_replicates(a, counts), mean_replicates(b, counts), N_CLUSTERS
        )
        told += judge(found.low, found.high, found.p)
    return told / N_REPEATS


@pytest.mark.slow
@pytest.mark.parametrize("share", [0.1, 0.5, 0.9])
def test_interval_of_joint_recognition_covers_the_truth(share: float) -> None:
    covered = 0
    for seed in range(N_REPEATS):
        values, _, counts = repeat((share, share), seed)
        low, high = interval(values.mean(), mean_replicates(values, counts))
        covered += low <= 100.0 * share <= high
    assert 0.92 <= covered / N_REPEATS <= 0.98


@pytest.mark.slow
@pytest.mark.parametrize("shares", [(0.5, 0.5), (0.45, 0.5), (0.1, 0.6)])
def test_interval_of_a_paired_difference_covers_the_truth(shares: tuple[float, float]) -> None:
    truth = 100.0 * (shares[0] - shares[1])
    assert 0.92 <= differences(shares, lambda low, high, p: low <= truth <= high) <= 0.98


@pytest.mark.slow
def test_equal_methods_are_rarely_separated() -> None:
    assert differences((0.5, 0.5), lambda low, high, p: p >= SIGNIFICANCE) >= 0.95


@pytest.mark.slow
def test_five_points_are_separated_mostly() -> None:
    assert differences((0.45, 0.5), lambda low, high, p: p < SIGNIFICANCE) >= 0.80


def write_methods(folder: Path, shares: dict[str, float], tasks: FakeTasks) -> None:
    for name, share in shares.items():
        write_row(folder, *make_row(FakeMethod(name, name, joint=share, copied_share=1.0), tasks))


def test_tie_groups_of_records_at_standard_size(tmp_path: Path) -> None:
    tasks = FakeTasks(n=N_SAMPLES, n_clusters=N_CLUSTERS)
    write_methods(tmp_path, {"good": 70.0, "twin": 70.0, "fair": 50.0, "poor": 20.0}, tasks)
    ranks = tie_groups(rows_of(load_run(tmp_path)), *PRIMARY)
    assert ranks == {"good": 1, "twin": 1, "fair": 3, "poor": 4}


def test_a_single_method_leads_alone(tmp_path: Path) -> None:
    write_methods(tmp_path, {"only": 50.0}, FakeTasks(n=60, n_clusters=12))
    assert tie_groups(rows_of(load_run(tmp_path)), *PRIMARY) == {"only": 1}
