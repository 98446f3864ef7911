"""The record: one cell's result as JSON, checked on the way in and out; and the samples file that lies beside it."""

from __future__ import annotations

import hashlib
import io
import json
import math
import os
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

SCHEMA_VERSION = 1

Status = Literal["ok", "failed", "timeout", "oom", "invalid", "unsupported", "skipped"]
Better = Literal["higher", "lower", "one", "none"]

TRAINED_HERE = "fit part, budget "
"""How ``trained_on`` starts where this benchmark trained the row; the budget follows, and a comma before more."""
USUAL_BUDGET, PAPER_BUDGET = "small", "paper"


class BadRecord(ValueError):
    """A record or samples file is missing, malformed, or does not belong together with the others."""


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Measurement(_Strict):
    """One number of a cell."""

    name: str
    """metric name as in METRICS, with its variant in brackets: ``fmd[stgcn-content]``"""
    version: int
    """version of the metric's definition"""
    slice: str
    """the samples it is taken over: ``all``, ``different_content``, ``same_content``, ``content=walk``"""
    value: float | None
    """None is undefined, and then ``reason`` says why"""
    unit: str
    """``%``, ``m``, ``1`` for ratios, ``distance`` for Frechet and kernel distances"""
    better: Better
    """the good direction; ``one`` means best at 1, ``none`` means no direction"""
    n: int
    """samples it is taken over"""
    low: float | None = None
    """lower end of the 95 % interval"""
    high: float | None = None
    """upper end of the 95 % interval"""
    judge_values: tuple[float, ...] = ()
    """the number under each judge seed, where it depends on a judge; ``value`` is their mean"""
    floor: float | None = None
    """the same number for real motion against real motion at the same n, where that means something"""
    details: dict[str, float] = Field(default_factory=dict)
    """further facts: ``d``, ``rank``, ``chance``, ``majority_rate``"""
    reason: str | None = None
    """why the value is undefined, or a warning to be shown beside it"""

    @model_validator(mode="after")
    def _undefined_has_a_reason(self) -> Measurement:
        if self.value is None and not self.reason:
            raise ValueError(f"{self.name}: an undefined value needs a reason")
        if self.value is not None and not math.isfinite(self.value):
            raise ValueError(f"{self.name}: value must be finite or None, got {self.value}")
        return self


class JudgeFacts(_Strict):
    """Which judge produced a number, and how good it is on real motion."""

    id: str
    """``stgcn-content/0``: family, target and seed"""
    digest: str
    origin: Literal["canonical", "local"]
    real_accuracy: float | None = None
    """accuracy on real test and real-part windows, percent; None for auto-encoders"""
    chance: float | None = None
    """percent"""
    majority_rate: float | None = None
    """percent of the commonest class in the same windows"""


class MethodFacts(_Strict):
    """What a row is."""

    name: str
    """unique id: ``copy-content``, ``aberman2020``"""
    title: str
    """what tables print"""
    kind: Literal["anchor", "method"]
    description: str = ""
    digest: str
    """adapter digest"""
    parameters: int | None = None
    needs_content_label: bool = False
    needs_style_label: bool = False
    uses_judge: bool = False
    """trained or guided with a judge of this harness"""
    trained_on: str = ""
    """data, budget, training seeds in words; empty for untrained rows"""
    draws_from: str = ""
    """for anchors: which part their motions come from"""

    @property
    def budget(self) -> str:
        """The training budget of a row that was trained here; empty for all others."""
        head, _, rest = self.trained_on.partition(TRAINED_HERE)
        return "" if head else rest.partition(",")[0]

    @property
    def unusual_budget(self) -> str:
        """The budget where it is not the usual one; empty for all other rows."""
        return "" if self.budget == USUAL_BUDGET else self.budget

    @property
    def row_name(self) -> str:
        """What tells rows of a table apart: the name, and an unusual budget."""
        return f"{self.name}@{self.unusual_budget}" if self.unusual_budget else self.name

    @property
    def row_title(self) -> str:
        """The title, or the name where there is none, with the same addition."""
        title = self.title or self.name
        return f"{title} ({self.unusual_budget} budget)" if self.unusual_budget else title


class Provenance(_Strict):
    """Where, when and with what a record was made."""

    commit: str
    dirty: bool
    packages: dict[str, str]
    python: str
    cpu: str
    gpu: str
    threads: int
    time_utc: str
    wall_s: float
    peak_rss_mb: float
    command: str
    retried: str = ""
    """why the cell was run a second time, where the worker at it was lost"""


class Record(_Strict):
    """The result of one cell: method x protocol x dataset x seed."""

    schema_version: Literal[1] = 1
    key: str
    """score key of the cell"""
    method: MethodFacts
    protocol: str
    protocol_version: int
    dataset: str
    """``bandai-namco@1``"""
    dataset_digest: str
    split: str
    """split kind: ``default``, ``contiguous``, ``interleaved``"""
    split_seed: int
    track: str
    condition: str = "standard"
    profile: str
    seed: int
    trial: int = 0
    status: Status
    reason: str = ""
    """one line for every status but ``ok``"""
    log: str = ""
    """path of the log, relative to the run folder"""
    copies: bool = False
    """copied share over 50 %: stands among the anchors and carries no rank"""
    measurements: tuple[Measurement, ...] = ()
    judges: tuple[JudgeFacts, ...] = ()
    protocol_facts: dict[str, str] = Field(default_factory=dict)
    """windows, fps, switches, task-list digest: what a reader needs to rebuild the number"""
    motions_digest: str = ""
    samples_digest: str = ""
    pack_digest: str = ""
    """blake2b of the motion pack; empty where none was made"""
    provenance: Provenance

    @model_validator(mode="after")
    def _status_and_content_agree(self) -> Record:
        if self.status == "ok" and not self.measurements:
            raise ValueError("an ok record needs measurements")
        if self.status != "ok" and (self.measurements or not self.reason):
            raise ValueError(f"a {self.status} record carries a reason and no numbers")
        return self

    @property
    def protocol_id(self) -> str:
        return f"{self.protocol}@{self.protocol_version}"

    @property
    def protocol_label(self) -> str:
        """``stylebench-transfer@1/self``; the standard condition has no name."""
        return self.protocol_id + ("" if self.condition == "standard" else f"/{self.condition}")

    def find(self, name: str, slice_name: str = "all") -> Measurement | None:
        """The measurement of that name and slice, or None."""
        for measurement in self.measurements:
            if measurement.name == name and measurement.slice == slice_name:
                return measurement
        return None


def write_text_atomically(path: Path, text: str) -> None:
    """Write a text file so that readers see the old or the new content, never a part: temp file, fsync, rename."""
    write_bytes_atomically(path, text.encode("utf-8"))


def write_bytes_atomically(path: Path, data: bytes) -> None:
    """Binary twin of :func:`write_text_atomically`."""
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException:
        Path(name).unlink(missing_ok=True)
        raise


def canonical_json(value: Any) -> str:
    """JSON with sorted keys and no blanks: equal values give equal bytes. NaN is refused."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def digest_of(value: Any) -> str:
    """blake2b (16 bytes, hex) of the canonical JSON of ``value``."""
    return hashlib.blake2b(canonical_json(value).encode("utf-8"), digest_size=16).hexdigest()


def digest_of_bytes(data: bytes) -> str:
    """blake2b (16 bytes, hex) of raw bytes."""
    return hashlib.blake2b(data, digest_size=16).hexdigest()


def digest_of_arrays(arrays: Mapping[str, NDArray[Any]]) -> str:
    """blake2b (16 bytes, hex) over names, shapes, dtypes and little-endian bytes, in sorted name order."""
    state = hashlib.blake2b(digest_size=16)
    for name in sorted(arrays):
        array = np.ascontiguousarray(arrays[name])
        array = array.astype(array.dtype.newbyteorder("<"), copy=False)
        state.update(f"{name}|{array.shape}|{array.dtype.str}|".encode())
        state.update(array.tobytes())
    return state.hexdigest()


def write_record(path: Path, record: Record) -> None:
    """Store a record as indented JSON, atomically."""
    write_text_atomically(path, json.dumps(record.model_dump(mode="json"), indent=1, sort_keys=True) + "\n")


def read_record(path: Path) -> Record:
    """Read and check one record.

    Raises
    ------
    BadRecord : not JSON, or not of this schema; the message names the file and the field.
    """
    try:
        return Record.model_validate_json(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadRecord(f"{path}: cannot be read: {error.strerror}") from error
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise BadRecord(f"{path}: not a record of schema {SCHEMA_VERSION}: {place}: {first['msg']}") from error


def samples_path(record_path: Path) -> Path:
    """Where a record's samples file lies: ``<key>.json`` and ``<key>.samples.npz``."""
    return record_path.with_suffix(".samples.npz")


def read_samples(record_path: Path, record: Record) -> dict[str, NDArray[Any]]:
    """Arrays of the samples file beside a record.

    Names: ``sample_id``, ``cluster``, ``slice/<name>`` (bool), ``per_sample/<metric>``,
    ``judge/<judge id>`` (predicted label index), ``replicates/<metric>|<slice>`` (``[B]``).

    Raises
    ------
    BadRecord : missing, or its digest is not the one in the record.
    """
    path = samples_path(record_path)
    try:
        # From memory: numpy leaves the file open where it is no archive.
        with np.load(io.BytesIO(path.read_bytes()), allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
    except (OSError, ValueError, EOFError, zipfile.BadZipFile) as error:
        raise BadRecord(f"{path}: samples file cannot be read: {error}") from error
    found = digest_of_arrays(arrays)
    if found != record.samples_digest:
        raise BadRecord(f"{path}: samples digest is {found}, the record says {record.samples_digest}: file was changed")
    return arrays
