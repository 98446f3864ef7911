"""What decides a number, as digests: one key a stage, each the blake2b of canonical JSON."""

from __future__ import annotations

import ast
import hashlib
import importlib.util
import inspect
from functools import cache
from pathlib import Path

from bench.adapters import post_processed
from bench.adapters.base import Adapter
from reports.records import digest_of

OWN_PACKAGES = ("bench", "classifiers", "reports")


def adapter_digest(adapter: type[Adapter]) -> str:
    """Digest of an adapter: its file and every file of this project that the file imports, directly or not.

    For an outside program the files that it lists, by content alone: where they lie does not matter. For an adapter
    whose answers are post-processed, its own digest and that of the code behind the post-processing.
    """
    inner = post_processed.plain(adapter)
    if inner is not adapter:
        own = _content_digests(Path(post_processed.__file__).resolve())
        return digest_of({"class": adapter.name, "inner": adapter_digest(inner), "files": own})
    listed = adapter.digest_files()
    if listed:
        return digest_of({"class": adapter.name, "files": sorted(_file_digest(path) for path in listed)})
    source = Path(inspect.getfile(adapter)).resolve()
    return digest_of({"class": adapter.__qualname__, "files": _content_digests(source)})


def _content_digests(start: Path) -> list[str]:
    seen: set[Path] = set()
    waiting = [start]
    while waiting:
        path = waiting.pop()
        if path not in seen:
            seen.add(path)
            waiting.extend(_own_imports(path))
    return sorted(_file_digest(path) for path in seen)


def _file_digest(path: Path) -> str:
    return _digest_as_of(path, *_when(path))


def _own_imports(path: Path) -> tuple[Path, ...]:
    return _imports_as_of(path, *_when(path))


def _when(path: Path) -> tuple[int, int]:
    """What a change of a file changes: a process that lives through one must not answer with the old file."""
    facts = path.stat()
    return facts.st_mtime_ns, facts.st_size


@cache
def _digest_as_of(path: Path, changed_ns: int, size: int) -> str:
    return hashlib.blake2b(path.read_bytes(), digest_size=16).hexdigest()


@cache
def _imports_as_of(path: Path, changed_ns: int, size: int) -> tuple[Path, ...]:
    """Files of this project named in import statements anywhere in ``path``, and files beside a user's adapter."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names.update(alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            names.add(node.module)
            names.update(f"{node.module}.{alias.name}" for alias in node.names)
    own = {name for name in names if name.split(".")[0] in OWN_PACKAGES}
    beside = {path.parent / f"{name.split('.')[0]}.py" for name in names - own}
    return tuple(
        sorted({file for file in map(_module_file, own) if file} | {file for file in beside if file.is_file()})
    )


@cache
def _module_file(name: str) -> Path | None:
    try:
        spec = importlib.util.find_spec(name)
    except ModuleNotFoundError:
        return None
    return Path(spec.origin).resolve() if spec and spec.origin and spec.origin.endswith(".py") else None


def fit_key(adapter: str, fit_part: str, budget: str, seed: int, device: str) -> str:
    """Key of a trained method."""
    return digest_of(
        {"stage": "fit", "adapter": adapter, "fit": fit_part, "budget": budget, "seed": seed, "device": device}
    )


def generate_key(fit: str, tasks: str, seed: int, *, after: str = "") -> str:
    """Key of a set of generated motions; ``fit`` is the fit key, or the adapter digest where nothing is trained.

    ``after`` is the adapter digest where answers are post-processed: such rows share the fit of the plain one.
    """
    return digest_of(
        {"stage": "generate", "fit": fit, "tasks": tasks, "seed": seed} | ({"after": after} if after else {})
    )


EMBEDDING_VERSION = 2
"""Raised when more of what judges say is stored."""


def embed_key(motions: str, judges: str) -> str:
    """Key of what the judges say about a set of motions."""
    return digest_of({"stage": "embed", "version": EMBEDDING_VERSION, "motions": motions, "judges": judges})


def score_key(motions: str, reference: str, given: bool, metric: str, version: int) -> str:
    """Key of one metric of a set of motions.

    ``reference`` is the key of what the motions are scored against: dataset, split, tasks, judges and the version of
    the way it is built. ``given`` says whether source and style reference count as motion the method was given.
    """
    return digest_of(
        {
            "stage": "score",
            "motions": motions,
            "reference": reference,
            "given": given,
            "metric": metric,
            "version": version,
        }
    )
