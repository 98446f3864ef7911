"""What a run is asked for: datasets, methods, protocols, limits; and what is refused before anything is read."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from bench.adapters import ADAPTERS
from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.adapters.post_processed import split_suffix
from bench.adapters.probe import import_failure
from bench.datasets.reading import Overrides
from bench.errors import BadConfig
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol
from bench.suite.workers import Limits
from reports.records import write_text_atomically

OWN_PROTOCOLS = {
    protocol.track: protocol
    for protocol in PROTOCOLS.values()
    if protocol.name == f"stylebench-{protocol.track}" and protocol.condition == "standard"
}
"""Track -> our own protocol for it."""

ANCHORS = tuple(name for name, adapter in ADAPTERS.items() if adapter.kind == "anchor")
"""What runs where no method is named: rows of known meaning, which train in seconds or not at all."""


DEVICES = ("cpu", "cuda")


@dataclass(frozen=True)
class RunRequest:
    """What to run.

    Attributes
    ----------
    data : dataset name -> path (None for generated data).
    overrides : unit, up axis and frame rate of the files of all of them, where they are given.
    methods : names; empty means all anchors, unless ``only_files``.
    adapter_files : ``FILE.py[:Class]`` or ``adapter.toml`` each, run beside the methods.
    only_files : without ``methods``, run nothing but the adapter files: their rows will stand beside others.
    tracks : our own protocol of each of these tracks.
    protocols : labels in PROTOCOLS, run beside the tracks; a name without a condition means all of its conditions.
    profile : ``quick`` or ``standard``.
    out, store : run folder and store folder.
    scheduler : address of a Dask scheduler, or the file that it wrote; empty for ``jobs`` processes of this machine.
    keep_failures : cells that failed in an earlier run with this store keep that outcome and are not tried again.
    seeds : methods that are trained run once with each; all other rows run once, with the first.
    device : where methods are trained, ``cpu`` or ``cuda``; weights of one are not those of the other.
    command : as typed, for the records.
    foreign : as ``data``, of datasets that only give the contents of the foreign condition and have no rows.
    """

    data: dict[str, Path | None]
    out: Path
    store: Path
    methods: tuple[str, ...] = ()
    adapter_files: tuple[str, ...] = ()
    only_files: bool = False
    tracks: tuple[str, ...] = ("transfer",)
    protocols: tuple[str, ...] = ()
    profile: str = "quick"
    jobs: int = 2
    scheduler: str = ""
    keep_failures: bool = False
    seeds: tuple[int, ...] = (0,)
    budget: str = "small"
    device: str = "cpu"
    split: str = "default"
    retrain_judges: bool = False
    limits: Limits = field(default_factory=Limits)
    command: str = ""
    overrides: Overrides | None = None
    foreign: dict[str, Path | None] = field(default_factory=dict)


def sources_of(request: RunRequest) -> list[AdapterSource]:
    """The adapters of a run; files are imported in a process of their own first, and marked where that fails.

    Raises
    ------
    BadConfig : an unknown name or file.
    """
    names = request.methods or (() if request.only_files else ANCHORS)
    sources = [AdapterSource(name) for name in names]
    for source in sources:
        find_adapter(source)
    sources += [_source_of_file(option, request.out) for option in request.adapter_files]
    seen: set[str] = set()
    for source in sources:
        if source.name in seen:
            raise BadConfig(f"two adapters are called {source.name!r}", remedy="give yours another name")
        seen.add(source.name)
    return sources


def _source_of_file(option: str, out: Path) -> AdapterSource:
    plain, _ = split_suffix(option)
    path, _, class_name = plain.partition(":")
    if not Path(path).expanduser().is_file():
        return source_from_option(option)
    failure = import_failure(plain)
    if failure is None:
        return source_from_option(option)
    name = class_name or Path(path).stem
    write_text_atomically(out / "logs" / f"{name}-import.log", failure.log)
    return AdapterSource(name, path, class_name, failure.reason)


def protocols_of(request: RunRequest) -> list[Protocol]:
    """Protocols of the tracks and labels asked for, in the order of the table.

    Raises
    ------
    BadConfig : an unknown track, protocol or profile.
    """
    chosen = {OWN_PROTOCOLS[track].label for track in request.tracks if _known(track, OWN_PROTOCOLS, "track")}
    for name in request.protocols:
        conditions = [label for label in PROTOCOLS if label.partition("/")[0] == name.removesuffix("/*")]
        if name in PROTOCOLS:
            chosen.add(name)
        elif conditions:
            chosen.update(conditions)
        else:
            _known(name, PROTOCOLS, "protocol")
    found = [protocol for label, protocol in PROTOCOLS.items() if label in chosen]
    for protocol in found:
        check_profile(protocol, request.profile)
    return found


def protocol_called(label: str) -> Protocol:
    """One protocol by its label.

    Raises
    ------
    BadConfig : there is none.
    """
    _known(label, PROTOCOLS, "protocol")
    return PROTOCOLS[label]


def check_profile(protocol: Protocol, profile: str) -> None:
    """Refuse a profile that a protocol does not have.

    Raises
    ------
    BadConfig : naming those it has.
    """
    if profile not in protocol.n_samples:
        raise BadConfig(f"unknown profile {profile!r}", remedy=f"choose from {', '.join(protocol.n_samples)}")


def _known(name: str, table: Mapping[str, Protocol], what: str) -> bool:
    if name not in table:
        raise BadConfig(f"unknown {what} {name!r}", remedy=f"choose from {', '.join(sorted(table))}")
    return True


def check_request(request: RunRequest) -> None:
    """Refuse what can be refused without reading any data; writes nothing.

    Raises
    ------
    BadConfig : unknown protocols, seeds that are none, or folders that cannot be written.
    """
    protocols_of(request)
    both = sorted(set(request.data) & set(request.foreign))
    if both:
        raise BadConfig(f"dataset {both[0]!r} is given to --data, too", where="--foreign", remedy="name it once")
    seeds = request.seeds
    if not seeds or len(set(seeds)) < len(seeds) or min(seeds) < 0:
        raise BadConfig(f"expected different numbers from 0 on, got {seeds}", where="--seeds")
    for option, folder in (("--out", request.out), ("--store", request.store)):
        _check_writable(folder, option)


def checked_device(device: str) -> str:
    """The device, if methods can be asked to train there.

    Raises
    ------
    BadConfig : neither ``cpu`` nor ``cuda``.
    """
    if device not in DEVICES:
        raise BadConfig(f"unknown device {device!r}", where="--device", remedy=f"choose {' or '.join(DEVICES)}")
    return device


def _check_writable(folder: Path, option: str) -> None:
    existing = next(parent for parent in (folder.absolute(), *folder.absolute().parents) if parent.exists())
    if not existing.is_dir() or not os.access(existing, os.W_OK):
        raise BadConfig(
            f"{folder} cannot be written: {existing} is not a writable folder", remedy=f"choose another with {option}"
        )


def latest_link(out: Path) -> None:
    """Point ``latest`` beside a run folder at it."""
    link = out.parent / "latest"
    draft = out.parent / f".latest-{os.getpid()}"
    draft.unlink(missing_ok=True)
    draft.symlink_to(out.name)
    if link.is_dir() and not link.is_symlink():
        shutil.rmtree(link)
    draft.replace(link)


def default_out(runs: Path) -> Path:
    """``runs/<date>-<time>``, with a number behind it where that exists."""
    stamp = time.strftime("%Y%m%d-%H%M%S")
    names = [stamp, *(f"{stamp}-{number}" for number in range(2, 100))]
    return next(runs / name for name in names if not (runs / name).exists())
