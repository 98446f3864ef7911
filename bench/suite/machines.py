"""What a worker machine must have before anything runs on it: this code, the store with the data, the adapters."""

from __future__ import annotations

import hashlib
import os
import platform
from dataclasses import dataclass, fields, is_dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, TypeVar

from bench.adapters.loading import AdapterSource, find_adapter
from bench.errors import BadConfig, BenchError
from bench.suite.keys import OWN_PACKAGES, adapter_digest
from bench.suite.provenance import ROOT
from bench.suite.store import Store

STORE_VARIABLE = "STYLEBENCH_STORE"
"""Environment variable of a worker machine: where it sees the store."""
SEEN_WITHIN_S = 10.0
DECISIVE = (".py", ".toml", ".csv", ".safetensors")
"""Endings of the files that decide numbers."""

Plain = TypeVar("Plain")


@dataclass(frozen=True)
class Home:
    """Where the machine that makes the calls has its store, its run's folder in it, and this project."""

    store: str
    run: str
    project: str = str(ROOT)

    @property
    def store_here(self) -> Path:
        """The store as this machine sees it."""
        return Path(os.environ.get(STORE_VARIABLE) or self.store)

    def here(self, value: Plain) -> Plain:
        """The same plain data with the caller's paths replaced by this machine's."""
        found = value
        for theirs, ours in ((self.store, str(self.store_here)), (self.project, str(ROOT))):
            if theirs != ours:
                found = _moved(found, theirs, ours)
        return found


def _moved(value: Any, theirs: str, ours: str) -> Any:
    if isinstance(value, str):
        return ours + value[len(theirs) :] if value == theirs or value.startswith(theirs + "/") else value
    if isinstance(value, tuple):
        return tuple(_moved(item, theirs, ours) for item in value)
    if is_dataclass(value) and not isinstance(value, type):
        return replace(value, **{f.name: _moved(getattr(value, f.name), theirs, ours) for f in fields(value)})
    return value


@dataclass(frozen=True)
class Wanted:
    """What a run asks of every machine, by digest.

    Attributes
    ----------
    code : :func:`code_digest` of the machine that makes the calls.
    datasets : dataset id and the key of its takes in the store.
    adapters : where each comes from, with its digest.
    """

    home: Home
    code: str
    datasets: tuple[tuple[str, str], ...]
    adapters: tuple[tuple[AdapterSource, str], ...]


@cache
def code_digest() -> str:
    """Digest of the source files and judges of this project, as they were when this process first asked."""
    digest = hashlib.blake2b(digest_size=16)
    for package in OWN_PACKAGES:
        for path in sorted((ROOT / package).rglob("*")):
            if path.suffix in DECISIVE:
                digest.update(f"{path.relative_to(ROOT)}\0".encode() + path.read_bytes())
    return digest.hexdigest()


def problems_here(wanted: Wanted) -> str:
    """Why this machine cannot take part in a run; empty where it can."""
    if code_digest() != wanted.code:
        return "has another version of this project: install the same one there and start the worker again"
    root = wanted.home.store_here
    if not root.is_dir():
        return f"has no store at {root}: {_how_to_share()}"
    try:
        store = Store(root)
    except BenchError as error:
        return str(error)
    store.sweep()
    lacking = [f"{name} (takes/{key})" for name, key in wanted.datasets
               if store.missing([("takes", key)], SEEN_WITHIN_S)]  # fmt: skip
    if lacking:
        return f"has no dataset {', '.join(lacking)} in {root}: {_how_to_share()}"
    if not Path(wanted.home.here(wanted.home.run)).is_dir():
        return f"has the data in {root}, but that is not the store of this run: {_how_to_share()}"
    for source, digest in wanted.adapters:
        problem = _adapter_problem(wanted.home.here(source), digest)
        if problem:
            return problem
    return ""


def problem_here(wanted: Wanted | None) -> str:
    """:func:`problems_here` for one more call of a run: looked at once by each process that can take part."""
    try:
        return _fit(wanted) if wanted else ""
    except BadConfig as error:
        return error.problem


@lru_cache(maxsize=4)
def _fit(wanted: Wanted) -> str:
    problem = problems_here(wanted)
    if problem:  # raised, for what is raised is not remembered
        raise BadConfig(f"{platform.node()} {problem}")
    return ""


def _how_to_share() -> str:
    return f"mount the store folder of the run there, and set {STORE_VARIABLE} to it before the worker starts"


def _adapter_problem(source: AdapterSource, digest: str) -> str:
    if source.file and not Path(source.file).is_file():
        return f"has no {source.file}: adapters must lie in a folder that all machines see"
    try:
        found = adapter_digest(find_adapter(source))
    except BenchError as error:
        return f"cannot load adapter {source.name}: {error}"
    return "" if found == digest else f"has another version of adapter {source.name}"
