"""Exact DTW against FastDTW and dtaidistance, side by side: ``python benchmarks/dtw.py [--frames 2000] [--rounds 7]``.

All candidates return the path of the same pair of trajectories: two smooth 6-D random motions of unequal tempo. They
run in turn, so a busy machine slows all alike; medians and their ratios are printed, then the extra peak memory.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import importlib.util
import statistics
import time
import tracemalloc
from collections.abc import Callable
from typing import Any

import numpy as np
from fastdtw import fastdtw
from scipy.ndimage import gaussian_filter1d
from scipy.spatial.distance import euclidean

from bench.arrays import FloatArray
from bench.metrics.dtw import dtw, fastdtw_build

Aligner = Callable[[FloatArray, FloatArray], Any]


def hand_like(frames: int, rng: np.random.Generator) -> FloatArray:
    """``[frames, 6]`` smooth trajectories with the spread of two hands, metres."""
    return np.asarray(0.3 * gaussian_filter1d(rng.standard_normal((frames, 6)), 12.0, axis=0) * np.sqrt(24.0))


def dtaidistance_path(a: FloatArray, b: FloatArray) -> Any:
    """The fastest exact path of dtaidistance with Euclidean cost: ``warping_path_fast`` ignores ``inner_dist``."""
    from dtaidistance import dtw_ndim
    from dtaidistance.dtw import best_path

    return best_path(dtw_ndim.warping_paths_fast(a, b, inner_dist="euclidean")[1])


def candidates() -> dict[str, Aligner]:
    found: dict[str, Aligner] = {
        "stylebench exact": dtw,
        f"fastdtw ({fastdtw_build()}), dist=euclidean": lambda a, b: fastdtw(a, b, dist=euclidean),
        f"fastdtw ({fastdtw_build()}), dist=2": lambda a, b: fastdtw(a, b, dist=2),
    }
    if importlib.util.find_spec("dtaidistance"):
        found["dtaidistance C, exact"] = dtaidistance_path
    return found


def median_seconds(runs: dict[str, Aligner], a: FloatArray, b: FloatArray, rounds: int) -> dict[str, float]:
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.perf_counter()
            run(a, b)
            seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def peak_megabytes(run: Aligner, a: FloatArray, b: FloatArray) -> float:
    """Highest Python and numpy allocation during one call, MB. C heaps of others are not seen."""
    tracemalloc.start()
    run(a, b)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--frames", type=int, default=2000)
    parser.add_argument("--rounds", type=int, default=7)
    arguments = parser.parse_args()
    rng = np.random.default_rng(0)
    a, b = hand_like(arguments.frames, rng), hand_like(arguments.frames, rng)
    runs = candidates()
    for run in runs.values():
        run(a[:50], b[:50])
    medians = median_seconds(runs, a, b, arguments.rounds)
    ours = medians["stylebench exact"]
    print(f"{arguments.frames} x {arguments.frames} frames, 6-D, path included, median of {arguments.rounds}")
    for name, seconds in medians.items():
        print(f"{name:42s} {1e3 * seconds:9.2f} ms {seconds / ours:7.1f} x")
    print(f"extra memory of stylebench exact: {peak_megabytes(dtw, a, b):.1f} MB")


if __name__ == "__main__":
    main()
