"""What counts as the same number on a machine of other arithmetic, and what does not."""

from __future__ import annotations

import numpy as np
import pytest

from bench.suite.tolerance import COUNT_TOLERANCE, COUNTED, RESCORE_TOLERANCE, same_array, same_number
from reports.records import Measurement


def measured(name: str, value: float | None, *, n: int = 4) -> Measurement:
    reason = "no samples" if value is None else None
    return Measurement(name=name, slice="all", value=value, unit="%", better="lower", n=n, version=1, reason=reason)


def test_tolerances_are_those_that_the_docs_name() -> None:
    assert (RESCORE_TOLERANCE, COUNT_TOLERANCE, COUNTED) == (1e-4, 0.1, ("joint_range",))


@pytest.mark.parametrize(
    ("found", "same"), [(50.0, True), (50.004, True), (50.006, False), (100.0, False), (None, False)]
)
def test_numbers_may_differ_by_a_ten_thousandth(found: float | None, same: bool) -> None:
    assert same_number(measured("fmd", 50.0), measured("fmd", found), exact=False) is same


@pytest.mark.parametrize(("found", "same"), [(2.09, True), (1.91, True), (2.11, False), (4.0, False)])
def test_counts_may_differ_by_a_tenth_of_a_point(found: float, same: bool) -> None:
    assert same_number(measured("joint_range", 2.0), measured("joint_range", found), exact=False) is same


def test_where_the_samples_are_exact_so_is_the_number() -> None:
    assert same_number(measured("fmd", 50.0), measured("fmd", 50.0), exact=True)
    assert not same_number(measured("fmd", 50.0), measured("fmd", np.nextafter(50.0, 51.0)), exact=True)


def test_a_missing_number_or_another_n_is_never_the_same() -> None:
    assert not same_number(None, measured("fmd", 1.0), exact=False)
    assert not same_number(measured("fmd", 1.0), None, exact=False)
    assert not same_number(measured("fmd", 1.0), measured("fmd", 1.0, n=5), exact=False)


def test_samples_of_numbers_are_held_one_by_one() -> None:
    said = np.array([1.0, 20.0, np.nan])
    assert same_array("per_sample/foot_skate", said, said * (1.0 + 5e-5))
    assert not same_array("per_sample/foot_skate", said, said + np.array([0.0, 0.01, 0.0]))
    assert not same_array("per_sample/foot_skate", said, np.array([1.0, 20.0, 0.0]))


@pytest.mark.parametrize("name", ["per_sample/joint_range", "replicates/joint_range|all"])
def test_samples_of_counts_are_held_by_their_mean(name: str) -> None:
    said = np.array([1.0, 20.0, 3.0, 4.0, np.nan])
    assert same_array(name, said, said + np.array([0.39, 0.0, 0.0, 0.0, 0.0]))
    assert not same_array(name, said, said + np.array([0.41, 0.0, 0.0, 0.0, 0.0]))
    assert not same_array(name, said, np.array([1.0, 20.0, 3.0, np.nan, np.nan]))
    assert same_array(name, np.full(3, np.nan), np.full(3, np.nan))


def test_judges_may_change_their_mind_once_in_a_thousand() -> None:
    said = np.zeros(2000, dtype=np.int64)
    assert same_array("judge/stgcn-style/0", said, np.where(np.arange(2000) < 2, 1, said))
    assert not same_array("judge/stgcn-style/0", said, np.where(np.arange(2000) < 3, 1, said))


def test_names_and_slices_are_equal_or_not() -> None:
    assert same_array("slice/all", np.array([True, False]), np.array([True, False]))
    assert not same_array("slice/all", np.array([True, False]), np.array([True, True]))
    assert not same_array("sample_id", np.array(["a"]), np.array(["a", "b"]))
    assert not same_array("sample_id", None, np.array(["a"]))
