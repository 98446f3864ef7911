"""The mutation check: all metrics are in it, and a sample of them is walked here. The whole walk is a command."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bench.metrics import METRICS, kernel
from bench.metrics.kernel import kernel_distance
from tests.mutation import CHANGES, FUNCTIONS, Mutant, applied, changed, mutants_of

ROOT = Path(__file__).resolve().parents[1]
SAMPLE = ("joint_recognition", "conditional_kid", "foot_skate", "latency_p90", "bone_drift")


def test_every_metric_is_walked() -> None:
    assert set(FUNCTIONS) == set(METRICS)
    page = (ROOT / "docs" / "metrics" / "mutation.md").read_text(encoding="utf-8")
    for name in METRICS:
        [line] = [line for line in page.splitlines() if line.startswith(f"| `{name}` |")]
        n, seen = (int(cell) for cell in line.split("|")[2:4])
        assert n == seen == len(mutants_of(name)), f"{name}: walk METRICS again, see tests/mutation.py"


def test_changes_of_every_kind_of_result() -> None:
    assert [changed(3.0, change) for change in CHANGES] == [6.0, -3.0, 4.0]
    hits = np.array([True, False, False])
    assert [changed(hits, change).tolist() for change in CHANGES] == [
        [True, True, True], [False, True, True], [False, True, False],
    ]  # fmt: skip
    assert changed((1, 2), "one more") == (2, 3) and changed({"a": 1.0}, "negated") == {"a": -1.0}


def test_a_change_is_seen_wherever_the_function_was_imported_to_and_taken_back() -> None:
    a, b = np.random.default_rng(0).normal(size=(2, 30, 3))
    right = kernel.kernel_distance(a, b)
    with applied(Mutant("kernel:kernel_distance", "doubled")):
        assert kernel.kernel_distance(a, b) == 2.0 * right
        assert vars(sys.modules[__name__])["kernel_distance"](a, b) == 2.0 * right
    assert kernel_distance(a, b) == kernel.kernel_distance(a, b) == right


@pytest.mark.slow
def test_a_sample_of_metrics_is_under_test() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "tests.mutation", *SAMPLE],
        cwd=ROOT, env=os.environ | {"OMP_NUM_THREADS": "1"}, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout + done.stderr
    assert f"changes of {len(SAMPLE)} metrics, 0 survived" in done.stdout
