"""``stylebench nightly``: run what changed, compare with the last good night, write page and summary, keep history."""

from __future__ import annotations

import fcntl
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

from bench.errors import BadConfig, BenchError
from bench.suite.output import failures, write_report
from bench.suite.page import build_page
from bench.suite.request import RunRequest
from bench.suite.run import run
from bench.suite.session import Progress
from bench.suite.store import Store
from reports.figures import save_figure
from reports.nightly import (
    FAMILY_WISE,
    Comparison,
    add_to_history,
    compare_nights,
    night_of,
    read_history,
    trend_figure,
)
from reports.nightly import summary as summary_of
from reports.records import BadRecord, write_text_atomically

HISTORY, LOCK, LATEST = "history.jsonl", "lock", "latest.md"
SUMMARY, TREND = "summary.md", "trend.png"
NO_RUN = "the night itself"


@dataclass(frozen=True)
class NightlyConfig:
    """``nightly.toml``; paths are relative to the file.

    Attributes
    ----------
    folder : where nights, history and lock lie.
    data : datasets as NAME or NAME=PATH.
    methods, adapters, tracks, protocols, profile, seeds, budget, device, jobs : as for ``stylebench run``.
    alpha : chance of any false alarm in a night.
    """

    folder: Path
    data: tuple[str, ...] = ("procedural",)
    methods: tuple[str, ...] = ()
    adapters: tuple[str, ...] = ()
    tracks: tuple[str, ...] = ("transfer",)
    protocols: tuple[str, ...] = ()
    profile: str = "quick"
    seeds: tuple[int, ...] = (0,)
    budget: str = "small"
    device: str = "cpu"
    jobs: int = 2
    alpha: float = FAMILY_WISE


@dataclass(frozen=True)
class NightResult:
    """What a night left: its folder, the comparison (None for the first good night), and what failed by name."""

    folder: Path
    comparison: Comparison | None
    failed: Mapping[str, str]

    @property
    def good(self) -> bool:
        bad = self.comparison is not None and (self.comparison.regressions or self.comparison.lost)
        return not self.failed and not bad


def read_config(path: Path) -> NightlyConfig:
    """Read ``nightly.toml``.

    Raises
    ------
    BadConfig : missing, not TOML, an unknown key, or a value of another type.
    """
    try:
        values = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise BadConfig(f"cannot be read: {error.strerror}", where=str(path)) from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise BadConfig(f"is not TOML: {error}", where=str(path)) from error
    known = {field.name for field in fields(NightlyConfig)}
    unknown = sorted(set(values) - known)
    if unknown:
        raise BadConfig(
            f"unknown key {unknown[0]!r}", where=str(path), remedy=f"known keys: {', '.join(sorted(known))}"
        )
    base = path.absolute().parent
    checked = {name: _checked(name, value, path) for name, value in values.items()}
    checked["folder"] = base / str(values.get("folder", "nightly"))
    checked["adapters"] = tuple(str(base / str(option)) for option in checked.get("adapters", ()))
    checked["data"] = tuple(_beside(option, base) for option in checked.get("data", ("procedural",)))
    return NightlyConfig(**checked)


_LISTS = {"data": str, "methods": str, "adapters": str, "tracks": str, "protocols": str, "seeds": int}
_WORDS = {"folder": str, "profile": str, "budget": str, "device": str, "jobs": int, "alpha": float}


def _checked(name: str, value: Any, path: Path) -> Any:
    if name in _LISTS:
        kind = _LISTS[name]
        if not isinstance(value, list) or any(type(item) is not kind for item in value):
            raise BadConfig(f"{name} must be a list of {kind.__name__}, got {value!r}", where=str(path))
        return tuple(value)
    kind = _WORDS[name]
    if type(value) is not kind:
        raise BadConfig(f"{name} must be {kind.__name__}, got {value!r}", where=str(path))
    return value


def _beside(option: str, base: Path) -> str:
    name, has_path, place = option.partition("=")
    return f"{name}={base / Path(place).expanduser()}" if has_path else name


def night(config: NightlyConfig, name: str, command: str, progress: Progress) -> NightResult:
    """Run one night; a method that fails costs its own rows, a run that cannot start is a failed night.

    Parameters
    ----------
    name : of the night's folder, sorting by time: ``2026-11-29T03-00-00Z``.

    Raises
    ------
    BadConfig : another night is running in the same folder.
    """
    with _alone(config.folder):
        folder, history = config.folder / "nights" / name, config.folder / HISTORY
        before = [old for old in read_history(history) if old.good]
        failed: dict[str, str] = {}
        comparison = None
        try:
            run(_request(config, folder, command), progress)
            write_report(folder)
            failed = failures(folder)
            if before:
                comparison = compare_nights(config.folder / "nights" / before[-1].name, folder, config.alpha)
            build_page(folder, Store(config.folder / "store"))
        except (BenchError, BadRecord) as error:
            failed[NO_RUN] = str(error)
        result = NightResult(folder, comparison, failed)
        text = summary_of(name, before[-1].name if before else "", comparison, failed)
        write_text_atomically(folder / SUMMARY, text)
        write_text_atomically(config.folder / LATEST, text)
        if NO_RUN not in failed:
            nights = add_to_history(history, night_of(name, result.good, folder))
            if any(old.values for old in nights):
                save_figure(trend_figure(nights), config.folder / TREND)
        return result


def _request(config: NightlyConfig, folder: Path, command: str) -> RunRequest:
    data: dict[str, Path | None] = {}
    for option in config.data:
        dataset, has_path, place = option.partition("=")
        data[dataset] = Path(place) if has_path else None
    return RunRequest(
        data=data, out=folder, store=config.folder / "store", methods=config.methods, adapter_files=config.adapters,
        only_files=bool(config.adapters), tracks=config.tracks, protocols=config.protocols, profile=config.profile,
        jobs=config.jobs, seeds=config.seeds, budget=config.budget, device=config.device, command=command,
    )  # fmt: skip


@contextmanager
def _alone(folder: Path) -> Iterator[None]:
    """Hold the folder's lock; the system lets go of it if this process dies."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / LOCK).open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise BadConfig(
                "another night is running here",
                where=str(folder),
                remedy="wait for it, or give this one another folder",
            ) from error
        yield
