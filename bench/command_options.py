"""What options of several commands mean: names, seeds and datasets as they are typed."""

from __future__ import annotations

import re
import shlex
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from bench.errors import BadConfig

if TYPE_CHECKING:
    from bench.datasets.reading import Overrides
    from bench.suite.submit import Data

RUNS = Path("runs")
STORE = RUNS / "store"
_FOLDERS = re.compile(r"(^|=)/(?:[^/=,]+/)*")


def command_line(arguments: Sequence[str]) -> str:
    """The command as typed, for records; absolute paths lose their folders, which belong to one machine."""
    return shlex.join(["stylebench", *(_FOLDERS.sub(r"\1", argument) for argument in arguments)])


def names_of(option: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in option.split(",") if name.strip())


def seeds_of(option: str) -> tuple[int, ...]:
    names = names_of(option)
    if not all(name.isdecimal() for name in names):
        raise BadConfig(
            f"expected numbers from 0 on, got {option!r}", where="--seeds", remedy="for example --seeds 0,1,2"
        )
    return tuple(int(name) for name in names)


def data_of(option: str, overrides: Overrides | None = None) -> Data:
    from bench.suite.submit import Data

    [(name, path)] = datasets_of([option]).items()
    return Data(name, path, overrides)


def datasets_of(options: list[str]) -> dict[str, Path | None]:
    found: dict[str, Path | None] = {}
    for option in options:
        name, has_path, path = option.partition("=")
        if name in found:
            raise BadConfig(f"dataset {name!r} is given twice", where="--data")
        found[name] = Path(path).expanduser() if has_path else None
    return found
