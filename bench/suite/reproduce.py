"""One record made again from nothing but itself, trained where needed, and its numbers beside the recorded ones."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from bench.errors import BadConfig
from bench.suite.request import RunRequest
from bench.suite.run import run
from bench.suite.session import Progress
from reports.records import USUAL_BUDGET, Measurement, Record, read_record

Outcome = Literal["same", "within the interval", "outside", "no interval", "gone", "a duration"]
WITHIN: tuple[Outcome, ...] = ("same", "within the interval", "a duration")


@dataclass(frozen=True)
class Reproduced:
    """One number of a record beside the same number made again."""

    metric: str
    slice: str
    unit: str
    recorded: float | None
    again: float | None
    low: float | None
    high: float | None
    outcome: Outcome


def reproduce(
    path: Path, data: Mapping[str, Path | None], out: Path, store: Path, progress: Progress, command: str = ""
) -> tuple[Record, Record, list[Reproduced]]:
    """The record, the record made again, and its numbers side by side.

    Raises
    ------
    BadRecord : no record there.
    BadConfig : the record carries no numbers, was made from a folder of answers, or its data is not given.
    """
    record = read_record(path)
    if record.status != "ok":
        raise BadConfig(f"the record is {record.status}: there is nothing to reproduce", where=str(path))
    name = record.dataset.partition("@")[0]
    if name not in data:
        raise BadConfig(f"the record is of {record.dataset}", where="--data", remedy=f"give --data {name}=PATH")
    request = RunRequest(
        data=dict(data),
        out=out,
        store=store,
        methods=(record.method.name,),
        tracks=(),
        protocols=(record.protocol_label,),
        profile=record.profile,
        seeds=(record.seed,),
        budget=record.method.budget or USUAL_BUDGET,
        split=record.split,
        command=command,
    )
    made = [item for item in run(request, progress).records if item.dataset == record.dataset]
    again = next((item for item in made if item.condition == record.condition), made[0])
    if again.status != "ok":
        raise BadConfig(f"the cell is {again.status} here: {again.reason}", where=str(path), cause=str(out / again.log))
    return record, again, [_compared(item, again) for item in record.measurements]


def _compared(said: Measurement, record: Record) -> Reproduced:
    found = record.find(said.name, said.slice)
    again = found.value if found else None
    outcome = _outcome(said, found, record.track)
    return Reproduced(said.name, said.slice, said.unit, said.value, again, said.low, said.high, outcome)


def _outcome(said: Measurement, found: Measurement | None, track: str) -> Outcome:
    if found is None or found.version != said.version:
        return "gone"
    if said.value == found.value:
        return "same"
    if track == "runtime":
        return "a duration"
    if said.value is None or found.value is None or said.low is None or said.high is None:
        return "no interval"
    return "within the interval" if said.low <= found.value <= said.high else "outside"
