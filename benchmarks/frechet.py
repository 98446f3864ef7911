"""Frechet distance side by side: our exact path, our Cholesky path, and the usual form by a matrix square root.

Run: ``python -m benchmarks.frechet [--repeats 3] [--quick]``. Pin the threads first (``OMP_NUM_THREADS=1``); times are
medians of interleaved repeats, and ratios within a run mean more than times. The Cholesky path serves bootstraps only,
so its time is that of one of 8 replicates, preparation included; the other two forms pay in full for every replicate.
All counts are one there: resampled rows that leave fewer than d different ones are sent to the exact path.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import statistics
import time
import warnings
from collections.abc import Callable, Mapping

import numpy as np
import scipy.linalg

from bench.arrays import FloatArray
from bench.metrics.frechet import frechet_distance, frechet_replicates

FULL_RANK = ((2500, 64), (2500, 256), (2500, 512), (2500, 2048))
FEW_SAMPLES = ((300, 512), (1000, 2048), (1228, 2048))
N_REPLICATES = 200
SHARED_REPLICATES = 8


def exact_path(real: FloatArray, generated: FloatArray) -> float:
    return frechet_distance(real, generated).value


def cholesky_path(real: FloatArray, generated: FloatArray) -> float:
    """Eight replicates that take every sample once; the first is returned."""
    counts = np.ones((SHARED_REPLICATES, len(generated)), dtype=np.int32)
    return float(frechet_replicates(real, generated, counts)[0])


def square_root_form(real: FloatArray, generated: FloatArray) -> float:
    """The covariances' product under scipy.linalg.sqrtm, as most published evaluators do."""
    covariances = np.cov(real, rowvar=False), np.cov(generated, rowvar=False)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        root = scipy.linalg.sqrtm(covariances[0] @ covariances[1])
    gap = real.mean(axis=0) - generated.mean(axis=0)
    return float(gap @ gap + np.trace(covariances[0]) + np.trace(covariances[1]) - 2.0 * np.trace(root).real)


def timed(
    functions: Mapping[str, Callable[[FloatArray, FloatArray], float]],
    sets: tuple[FloatArray, FloatArray],
    repeats: int,
) -> dict[str, tuple[float, float]]:
    """Median seconds and value of each function; the repeats of the functions are interleaved."""
    seconds: dict[str, list[float]] = {name: [] for name in functions}
    values = {}
    for _ in range(repeats):
        for name, function in functions.items():
            start = time.perf_counter()
            values[name] = function(*sets)
            seconds[name].append(time.perf_counter() - start)
    return {name: (statistics.median(seconds[name]), values[name]) for name in functions}


def feature_sets(n: int, d: int, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Two correlated feature sets with a condition number of about 100."""
    mixing = np.linalg.qr(rng.normal(size=(d, d)))[0] * np.logspace(0.0, -1.0, d)
    return rng.normal(size=(n, d)) @ mixing, 0.1 + 1.1 * rng.normal(size=(n, d)) @ mixing


def main() -> None:
    parser = argparse.ArgumentParser(description="Frechet distance: exact path, Cholesky path, square-root form.")
    parser.add_argument("--repeats", type=int, default=3)
    parser.add_argument("--quick", action="store_true", help="leave out d = 2048")
    options = parser.parse_args()
    rng = np.random.default_rng(0)
    print("    n     d   exact ms  cholesky ms   sqrtm ms  exact x  cholesky x  cholesky - exact  sqrtm - exact")
    print("(x: speed-up over sqrtm; differences are relative to the trace)")
    for n, d in FULL_RANK + FEW_SAMPLES:
        if options.quick and d > 512:
            continue
        sets = feature_sets(n, d, rng)
        functions = {"exact": exact_path, "sqrtm": square_root_form}
        if n > d:
            functions["cholesky"] = cholesky_path
        result = timed(functions, sets, options.repeats)
        print(row(n, d, result, frechet_distance(*sets).trace))
    real, generated = feature_sets(2500, 64, rng)
    counts = rng.multinomial(2500, np.full(2500, 1.0 / 2500), size=N_REPLICATES).astype(np.int32)
    start = time.perf_counter()
    frechet_replicates(real, generated, counts)
    print(f"{N_REPLICATES} replicates at n = 2500, d = 64: {time.perf_counter() - start:.2f} s")


def row(n: int, d: int, result: dict[str, tuple[float, float]], trace: float) -> str:
    exact, root = result["exact"], result["sqrtm"]
    line = f"{n:5d} {d:5d} {1e3 * exact[0]:10.1f} "
    if "cholesky" in result:
        seconds, value = result["cholesky"][0] / SHARED_REPLICATES, result["cholesky"][1]
        line += f"{1e3 * seconds:12.1f} {1e3 * root[0]:10.1f} {root[0] / exact[0]:8.1f} {root[0] / seconds:11.1f}"
        return line + f" {(value - exact[1]) / trace:17.1e} {(root[1] - exact[1]) / trace:14.1e}"
    line += f"{'-':>12} {1e3 * root[0]:10.1f} {root[0] / exact[0]:8.1f} {'-':>11}"
    return line + f" {'-':>17} {(root[1] - exact[1]) / trace:14.1e}"


if __name__ == "__main__":
    main()
