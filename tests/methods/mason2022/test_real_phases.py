"""Phases of captured walks: they advance, left and right take turns, and no evolutionary search fits better."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import Bounds, differential_evolution

from bench.arrays import FloatArray
from bench.datasets.table import load_dataset
from bench.methods.mason2022.examples import LEFT_TOE_PLACE, axes_of, effector_positions
from bench.methods.mason2022.features import FPS, Body, body_of
from bench.methods.mason2022.phases import (
    Sinusoids,
    circular_mean,
    contact_free_source,
    fit_sinusoids,
    phase_advance,
    source_function,
)
from bench.motion.edit import resample

pytestmark = pytest.mark.slow

STYLES = ("normal", "masculine", "feminine", "youthful")


@cache
def walks(zip_path: Path, style: str) -> list[Body]:
    takes = load_dataset("bandai-namco", zip_path).takes
    return [body_of(resample(t.clip, FPS)) for t in takes if (t.content, t.style) == ("walk", style)]


def sources_of(bodies: list[Body]) -> list[list[FloatArray]]:
    axes = axes_of(bodies)
    return [
        [
            source_function(contact_free_source(effector_positions(body)[:, place], axis), FPS)
            for place, axis in enumerate(axes)
        ]
        for body in bodies
    ]


@pytest.mark.parametrize("style", STYLES)
def test_phases_of_walks_advance_and_feet_take_turns(bandai_namco_zip: Path, style: str) -> None:
    fits = [[fit_sinusoids(s, FPS) for s in take] for take in sources_of(walks(bandai_namco_zip, style))]

    def share(place: int) -> float:
        return float(np.concatenate([phase_advance(take[place].phase) > 0.0 for take in fits]).mean())

    assert min(share(place) for place in range(4)) > 0.95
    left, right = LEFT_TOE_PLACE, LEFT_TOE_PLACE + 1
    apart = circular_mean(np.concatenate([take[left].phase - take[right].phase for take in fits]))
    assert abs(apart - 0.5) < 0.1


def test_fit_is_no_worse_than_evolution_on_captured_motion(bandai_namco_zip: Path) -> None:
    times_s = np.arange(-30, 31) / FPS
    for source in sources_of(walks(bandai_namco_zip, "normal")[:1])[0]:
        found: Sinusoids = fit_sinusoids(source, FPS)
        for frame in (60, 120, 200):
            wanted = source[frame - 30 : frame + 31]

            def error(numbers: FloatArray, wanted: FloatArray = wanted) -> float:
                amplitude, frequency, shift, offset = numbers
                fitted = amplitude * np.sin(2.0 * np.pi * (frequency * times_s - shift)) + offset
                return float(((fitted - wanted) ** 2).mean())

            span = float(np.ptp(wanted))
            bounds = Bounds([0.0, 0.25, -0.5, -span], [span, 4.0, 0.5, span])
            # 50 individuals and 10 generations, as released
            evolved = differential_evolution(error, bounds, popsize=12, maxiter=10, seed=0, polish=False)
            assert found.error[frame] <= evolved.fun + 1e-9
