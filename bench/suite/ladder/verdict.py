"""What every metric made of every ladder, and whether that is what was declared."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bench.metrics import METRICS
from bench.suite.ladder.declared import Claim
from reports.ladder import Cell, Rung

N_SD = 2.0
"""Changes within so many bootstrap standard deviations are chance."""
ARITHMETIC = 1e-6
"""Smaller changes, in the metric's unit, are rounding."""
MOVES_FROM = 0.02
"""A metric moves where it changes by more than this share of its range."""
IGNORES_UP_TO = 0.005
"""What must be ignored may change a metric by this share of its range: arithmetic in single precision."""
BLIND_UP_TO = 0.5
"""A metric is blind to a corruption that worsens it by less than this share of its range."""
SETBACK = 0.1
"""A step back of up to this share of a ladder's whole change does not break its direction."""


@dataclass(frozen=True)
class Range:
    """How far the ladders of one dataset move one metric, and what share of that a change is.

    Attributes
    ----------
    widest : the largest change that any ladder brings about.
    knee : changes of percentages are counted on a straight scale (``inf``). Other numbers have no end: swapped joints
        move a distance a hundred thousand times as far as another style does. Their changes are counted as
        log(1 + change / knee), with the median change of all rungs as knee.
    """

    widest: float
    knee: float

    @classmethod
    def of(cls, rungs: Iterable[Rung]) -> Range:
        """The range of one metric, from all its rungs."""
        by_ladder: dict[str, list[Rung]] = {}
        for rung in rungs:
            by_ladder.setdefault(rung.ladder, []).append(rung)
        changes = np.array(
            [abs(step.value - start.value) for start, *steps in map(_by_level, by_ladder.values()) for step in steps]
        )
        changes = changes[changes > ARITHMETIC]
        straight = METRICS[next(iter(by_ladder.values()))[0].metric].unit == "%"
        if not changes.size:
            return cls(0.0, np.inf)
        return cls(float(changes.max()), np.inf if straight else float(np.median(changes)))

    def share(self, change: float) -> float:
        """-1..1, with the sign of ``change``; 0 for rounding and undefined changes."""
        if not abs(change) > ARITHMETIC or self.widest == 0.0:
            return 0.0
        if np.isinf(self.knee):
            return change / self.widest
        return float(np.sign(change) * np.log1p(abs(change) / self.knee) / np.log1p(self.widest / self.knee))


def cells_of(rungs: Iterable[Rung], declared: Mapping[str, Mapping[str, Claim]]) -> list[Cell]:
    """One cell a metric and ladder of one dataset, in the order of the rungs."""
    by_metric: dict[str, list[Rung]] = {}
    by_cell: dict[tuple[str, str], list[Rung]] = {}
    for rung in rungs:
        by_metric.setdefault(rung.metric, []).append(rung)
        by_cell.setdefault((rung.metric, rung.ladder), []).append(rung)
    ranges = {metric: Range.of(found) for metric, found in by_metric.items()}
    return [
        _cell(_by_level(steps), ranges[metric], declared[metric][ladder]) for (metric, ladder), steps in by_cell.items()
    ]


def _by_level(steps: Sequence[Rung]) -> list[Rung]:
    return sorted(steps, key=lambda rung: rung.level)


def _cell(steps: Sequence[Rung], span: Range, claim: Claim) -> Cell:
    first, last = steps[0], next((step for step in reversed(steps) if np.isfinite(step.value)), steps[-1])
    observed = _observed(steps, span)
    directed = METRICS[first.metric].better != "none"
    worsening = span.share(_badness(last) - _badness(first)) if directed else 0.0
    return Cell(
        metric=first.metric,
        ladder=first.ladder,
        claim=str(claim),
        observed=observed,
        change=span.share(last.value - first.value),
        worsening=worsening,
        contradiction=_contradiction(claim, observed, worsening, steps, span),
    )


def _observed(steps: Sequence[Rung], span: Range) -> str:
    """``up``, ``down``, ``flat``, ``mixed`` or ``undefined``."""
    known = [step for step in steps if np.isfinite(step.value)]
    if len(known) < 2 or not np.isfinite(steps[0].value):
        return "undefined"
    start, end = known[0], known[-1]
    if not any(_moves(step.value - start.value, step.change_sd, span) for step in known[1:]):
        return "flat"
    whole = end.value - start.value
    if not _moves(whole, end.change_sd, span):
        return "mixed"
    sign = 1.0 if whole > 0.0 else -1.0
    for before, after in pairwise(known):
        back = -sign * (after.value - before.value)
        if back > SETBACK * abs(whole) and _moves(back, after.step_sd, span):
            return "mixed"
    return "up" if sign > 0.0 else "down"


def _moves(change: float, sd: float, span: Range) -> bool:
    chance = N_SD * sd if np.isfinite(sd) else 0.0
    return abs(change) > chance and abs(span.share(change)) > MOVES_FROM


def _contradiction(claim: Claim, observed: str, worsening: float, steps: Sequence[Rung], span: Range) -> str:
    """Why what was observed is not what was declared; empty where it is."""
    match claim:
        case Claim.UP | Claim.DOWN:
            return "" if observed == claim else f"declared {claim}, observed {observed}"
        case Claim.IGNORE:
            share = max(abs(span.share(step.value - steps[0].value)) for step in steps)
            return "" if share <= IGNORES_UP_TO else f"declared to ignore it, changes by {share:.1%} of its range"
        case Claim.BLIND:
            seen = worsening > BLIND_UP_TO
            return f"declared blind, worsens by {worsening:.0%} of its range" if seen else ""
        case Claim.OPEN:
            return ""


def _badness(rung: Rung) -> float:
    """Larger is worse, in the metric's own unit."""
    match METRICS[rung.metric].better:
        case "higher":
            return -rung.value
        case "one":
            return abs(rung.value - 1.0)
        case _:
            return rung.value
