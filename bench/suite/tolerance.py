"""How far numbers that are scored again may be from the recorded ones, on a machine of other arithmetic."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from reports.records import Measurement

RESCORE_TOLERANCE = 1e-4
"""Relative, for numbers scored again where the arithmetic of this machine is not bit for bit that of the record."""
COUNTED = ("joint_range",)
"""Metrics in percent that count places beyond a limit: one that stands on it may fall to either side elsewhere."""
COUNT_TOLERANCE = 0.1
"""Percentage points, for those."""


def same_array(name: str, one: NDArray[Any] | None, other: NDArray[Any] | None) -> bool:
    """Whether an array of a samples file, found twice, may be the same; ``name`` as in the file, None where missing."""
    if one is None or other is None or one.shape != other.shape or one.dtype != other.dtype:
        return False
    if one.dtype.kind != "f":
        # Judges of another arithmetic may change their mind on a sample that stands between two classes.
        return bool(np.mean(one != other) <= 1e-3) if one.dtype.kind == "i" else bool(np.array_equal(one, other))
    if name.partition("/")[2].partition("|")[0] in COUNTED:
        # One place more or less is much of one short sample, so the mean over samples or replicates is held.
        apart = np.abs(one - other)[~np.isnan(one)]
        same_gaps = np.array_equal(np.isnan(one), np.isnan(other))
        return bool(same_gaps and apart.sum() <= COUNT_TOLERANCE * apart.size)
    return bool(np.allclose(one, other, rtol=RESCORE_TOLERANCE, atol=RESCORE_TOLERANCE, equal_nan=True))


def same_number(said: Measurement | None, found: Measurement | None, exact: bool) -> bool:
    """Whether a recorded number and the one found again may be the same; ``exact`` allows no difference at all."""
    if said is None or found is None:
        return False
    if exact:
        return said == found
    if _without_numbers(said) != _without_numbers(found):
        return False
    pairs = [(said.value, found.value), (said.low, found.low), (said.high, found.high), (said.floor, found.floor)]
    return all(_close(said.name, one, other) for one, other in pairs)


def _without_numbers(measurement: Measurement) -> Measurement:
    """What is left must be equal on every machine."""
    numbers: dict[str, object] = {
        "value": None,
        "low": None,
        "high": None,
        "floor": None,
        "judge_values": (),
        "details": {},
    }
    return measurement.model_copy(update={**numbers, "reason": ""})


def _close(metric: str, one: float | None, other: float | None) -> bool:
    if one is None or other is None:
        return one is other
    allowed = COUNT_TOLERANCE if metric in COUNTED else RESCORE_TOLERANCE * max(1.0, abs(one))
    return bool(abs(one - other) <= allowed)
