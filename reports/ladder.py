"""Numbers of the corruption ladder: one line a metric and rung, stored as CSV."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from dataclasses import astuple, dataclass, fields
from pathlib import Path

from reports.records import BadRecord, write_text_atomically


@dataclass(frozen=True)
class Rung:
    """One metric at one level of one ladder.

    Attributes
    ----------
    dataset, samples, judges : what was climbed: dataset, number of windows, digest of the judges.
    metric, version : a row of METRICS.
    ladder, level : which corruption and how much of it; level 0 is real motion.
    value : NaN where undefined.
    change_sd, step_sd : bootstrap standard deviation of the difference to level 0 and to the level before; NaN where
        the metric has no replicates.
    """

    dataset: str
    samples: int
    judges: str
    metric: str
    version: int
    ladder: str
    level: float
    value: float
    change_sd: float
    step_sd: float


@dataclass(frozen=True)
class Cell:
    """What a metric made of a ladder.

    Attributes
    ----------
    claim : what was declared: ``up``, ``down``, ``ignore``, ``blind`` or ``open``.
    observed : ``up``, ``down``, ``flat``, ``mixed`` or ``undefined``.
    change : from real motion to the last level, as a share of the metric's range: of the widest change that any ladder
        brings about, on the scale of ``bench.suite.ladder.verdict.Range``.
    worsening : the same change towards the worse; negative where the corruption looks better, 0 for metrics without a
        good direction.
    contradiction : how the two disagree; empty where they do not.
    """

    metric: str
    ladder: str
    claim: str
    observed: str
    change: float
    worsening: float
    contradiction: str


def write_rungs(path: Path, rungs: Iterable[Rung]) -> None:
    """Store numbers with six digits."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow([field.name for field in fields(Rung)])
    writer.writerows([f"{v:.6g}" if isinstance(v, float) else v for v in astuple(rung)] for rung in rungs)
    write_text_atomically(path, text.getvalue())


def read_rungs(path: Path) -> list[Rung]:
    """What :func:`write_rungs` stored.

    Raises
    ------
    BadRecord : not such a file.
    """
    with path.open(encoding="utf-8", newline="") as file:
        try:
            return [
                Rung(
                    line["dataset"], int(line["samples"]), line["judges"], line["metric"], int(line["version"]),
                    line["ladder"], float(line["level"]), float(line["value"]), float(line["change_sd"]),
                    float(line["step_sd"]),
                )
                for line in csv.DictReader(file)
            ]  # fmt: skip
        except (KeyError, ValueError, TypeError, csv.Error) as error:
            raise BadRecord(f"{path} is no table of ladder numbers: {error!r}") from error
