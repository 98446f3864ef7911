"""What a worker machine must have before anything runs on it: this code, the store with the data, the adapters."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from bench.adapters.loading import AdapterSource, find_adapter
from bench.errors import BenchError
from bench.suite.calls import STORE_VARIABLE, Home
from bench.suite.keys import OWN_PACKAGES, adapter_digest
from bench.suite.provenance import ROOT
from bench.suite.store import Store

SEEN_WITHIN_S = 10.0
DECISIVE = (".py", ".toml", ".csv", ".safetensors")
"""Endings of the files that decide numbers."""


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
