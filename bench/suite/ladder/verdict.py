"""What every metric made of every ladder, and whether that is what was declared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

import numpy as np

from bench.metrics import METRICS
from bench.suite.ladder.declared import Claim
from reports.ladder import Cell, Rung

N_SD = 2.0
"""Changes within so many bootstrap standard deviations are chance."""
MOVES_FROM = 0.02
"""A metric moves where it changes by more than this share of the widest change that any ladder brings about in it."""
IGNORES_UP_TO = 0.005
"""What must be ignored may change a metric by this share of its widest change: arithmetic in single precision."""
BLIND_UP_TO = 0.15
"""A metric is blind to a corruption that worsens it by less than this share of its widest change."""
SETBACK = 0.1
"""A step back of up to this share of a ladder's whole change does not break its direction."""


def cells_of(rungs: Iterable[Rung], declared: Mapping[str, Mapping[str, Claim]]) -> list[Cell]:
    """One cell a metric and ladder of one dataset, in the order of the rungs."""
    by_cell: dict[tuple[str, str], list[Rung]] = {}
    for rung in rungs:
        by_cell.setdefault((rung.metric, rung.ladder), []).append(rung)
    widest: dict[str, float] = {}
    for (metric, _), steps in by_cell.items():
        widest[metric] = max(widest.get(metric, 0.0), _widest_change(steps))
    return [
        _cell(sorted(steps, key=lambda rung: rung.level), widest[metric], declared[metric][ladder])
        for (metric, ladder), steps in by_cell.items()
    ]


def _widest_change(steps: Sequence[Rung]) -> float:
    values = np.array([step.value for step in steps])
    known = values[np.isfinite(values)]
    return float(np.ptp(known)) if known.size else 0.0


def _cell(steps: Sequence[Rung], widest: float, claim: Claim) -> Cell:
    first, last = steps[0], next((step for step in reversed(steps) if np.isfinite(step.value)), steps[-1])
    observed = _observed(steps, widest)
    worse = _badness(last) - _badness(first)
    widest_badness = widest if METRICS[first.metric].better in ("higher", "lower") else max(widest, 1e-12)
    worsening = worse / widest_badness if widest > 0.0 and np.isfinite(worse) else 0.0
    return Cell(
        metric=first.metric,
        ladder=first.ladder,
        claim=str(claim),
        observed=observed,
        change=(last.value - first.value) / widest if widest > 0.0 and np.isfinite(first.value) else 0.0,
        worsening=worsening,
        contradiction=_contradiction(claim, observed, worsening, steps, widest),
    )


def _observed(steps: Sequence[Rung], widest: float) -> str:
    """``up``, ``down``, ``flat``, ``mixed`` or ``undefined``."""
    known = [step for step in steps if np.isfinite(step.value)]
    if len(known) < 2 or not np.isfinite(steps[0].value):
        return "undefined"
    start, end = known[0], known[-1]
    if not any(_moves(step.value - start.value, step.change_sd, widest) for step in known[1:]):
        return "flat"
    whole = end.value - start.value
    if not _moves(whole, end.change_sd, widest):
        return "mixed"
    sign = 1.0 if whole > 0.0 else -1.0
    for before, after in pairwise(known):
        back = -sign * (after.value - before.value)
        if back > SETBACK * abs(whole) and _moves(back, after.step_sd, widest):
            return "mixed"
    return "up" if sign > 0.0 else "down"


def _moves(change: float, sd: float, widest: float) -> bool:
    chance = N_SD * sd if np.isfinite(sd) else 0.0
    return abs(change) > max(chance, MOVES_FROM * widest)


def _contradiction(claim: Claim, observed: str, worsening: float, steps: Sequence[Rung], widest: float) -> str:
    """Why what was observed is not what was declared; empty where it is."""
    match claim:
        case Claim.UP | Claim.DOWN:
            return "" if observed == claim else f"declared {claim}, observed {observed}"
        case Claim.IGNORE:
            largest = max((abs(step.value - steps[0].value) for step in steps if np.isfinite(step.value)), default=0.0)
            share = largest / widest if widest > 0.0 else 0.0
            return "" if share <= IGNORES_UP_TO else f"declared to ignore it, changes by {share:.1%} of its range"
        case Claim.BLIND:
            seen = worsening > BLIND_UP_TO
            return f"declared blind, worsens by {worsening:.0%} of its range" if seen else ""
        case Claim.OPEN:
            return ""


def _badness(rung: Rung) -> float:
    """Larger is worse, in the metric's own unit; for metrics without a direction the value itself."""
    match METRICS[rung.metric].better:
        case "higher":
            return -rung.value
        case "one":
            return abs(rung.value - 1.0)
        case _:
            return rung.value
