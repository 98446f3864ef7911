"""``adapter.toml``: how an outside program is started, what it can do and which files decide its answers.

The smallest one::

    name = "mine"
    command = ["python", "worker.py", "my_code.py"]
    capabilities = ["transfers"]
"""

from __future__ import annotations

import difflib
import json
import shutil
import tomllib
from dataclasses import fields
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, TypeAdapter, ValidationError

from bench.adapters.base import CAPABILITIES, Traits
from bench.errors import BadConfig

MAX_TOML_BYTES = 65536
EXCHANGE = "{exchange}"
"""Stands in ``command`` for the folder through which motions travel; containers mount it."""


def _printable(text: str) -> str:
    """Refuses what could break a line or turn its direction in a table."""
    if not text.isprintable():
        raise ValueError("must be one line of printable text")
    return text


Seconds = Annotated[float, Field(gt=0.0, le=1e6)]
Name = Annotated[str, Field(pattern=r"^[a-z0-9][a-z0-9._+-]{0,63}$")]
Title = Annotated[str, Field(max_length=100), AfterValidator(_printable)]
Sentence = Annotated[str, Field(max_length=300), AfterValidator(_printable)]


class Table(BaseModel):
    """A TOML table: unknown keys are refused, nothing is converted."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Timeouts(Table):
    """Seconds after which the harness gives up; table ``[timeouts]``."""

    start_s: Seconds = 120.0
    """until the program has said hello"""
    task_s: Seconds = 120.0
    """for one task"""
    fit_s: Seconds = 1e6
    """for ``fit``, ``save`` and ``load``"""
    silence_s: Seconds = 120.0
    """without a heartbeat, from programs that promise one"""
    stop_s: Seconds = 5.0
    """to leave, or to answer a cancellation, before it is killed"""


class Program(Table):
    """What ``adapter.toml`` says."""

    name: Name
    title: Title = ""
    description: Sentence = ""
    command: Annotated[tuple[str, ...], Field(min_length=1)]
    """program and arguments; a program with a slash is relative to the file's folder"""
    folder: str = "."
    """working directory, relative to the file's folder"""
    motions: Literal["npz", "bvh"] = "npz"
    """form in which the program reads motions; it may answer in either"""
    exchange_inside: str = ""
    """where the program sees the exchange folder, if a container mounts it elsewhere"""
    capabilities: Annotated[tuple[str, ...], Field(min_length=1)]
    fits: bool = False
    """the program learns from the fit part: it has fit, save and load"""
    files: tuple[str, ...] = ()
    """files or patterns, relative to the folder, that decide the answers; default: those that ``command`` names"""
    environment: dict[str, str] = Field(default_factory=dict)
    timeouts: Timeouts = Timeouts()
    traits: Traits = Traits()
    toml_file: Path

    @property
    def working_folder(self) -> Path:
        return (self.toml_file.parent / self.folder).resolve()

    def digest_files(self) -> tuple[Path, ...]:
        """``adapter.toml`` and the files that decide the answers.

        Raises
        ------
        BadConfig : a listed file does not exist.
        """
        home = self.toml_file.parent
        found = {self.toml_file}
        for pattern in self.files:
            matches = {path for path in _matches(home, pattern, self.toml_file) if path.is_file()}
            if not matches:
                raise BadConfig(
                    f"no file matches {pattern!r}", where=f"{self.toml_file}: files", remedy=f"paths start at {home}"
                )
            found |= matches
        if not self.files:
            beside = [self.working_folder / word for word in self.command[1:] if not word.startswith("/")]
            found |= {path for path in beside if path.is_file()}
        return tuple(sorted(found))

    def command_line(self, exchange: Path) -> list[str]:
        """The command with its placeholder filled and its program found.

        Raises
        ------
        BadConfig : there is no such program or working directory.
        """
        if not self.working_folder.is_dir():
            raise BadConfig(f"no folder {self.working_folder}", where=f"{self.toml_file}: folder")
        first, *rest = (word.replace(EXCHANGE, str(exchange)) for word in self.command)
        if "/" in first:
            first = str(self.toml_file.parent / Path(first).expanduser())
        program = shutil.which(first)
        if program is None:
            raise BadConfig(
                f"no program {first!r} that can be run",
                where=f"{self.toml_file}: command",
                cause="not installed on this machine, its environment not created, or not executable",
                remedy="give the path of the interpreter, for example venv/bin/python",
            )
        return [program, *rest]


def read_program(path: Path) -> Program:
    """Read ``adapter.toml``.

    Raises
    ------
    BadConfig : not readable, not TOML, a key that does not exist, or a value that does not fit.
    """
    where = str(path)
    try:
        if path.stat().st_size > MAX_TOML_BYTES:
            raise BadConfig(f"is larger than {MAX_TOML_BYTES} bytes", where=where, cause="not an adapter.toml")
        table = parse_toml(path.read_bytes(), where)
    except OSError as error:
        raise BadConfig(f"cannot be read ({error.strerror})", where=where) from error
    return program_of(table, path)


def parse_toml(content: bytes, where: str) -> dict[str, Any]:
    """TOML of bounded size as a table.

    Raises
    ------
    BadConfig : not TOML.
    """
    if len(content) > MAX_TOML_BYTES:
        raise BadConfig(f"is larger than {MAX_TOML_BYTES} bytes", where=where)
    try:
        return tomllib.loads(content.decode("utf-8"))
    except (ValueError, RecursionError) as error:
        raise BadConfig(f"is not TOML: {error}", where=where) from None


def program_of(table: dict[str, Any], path: Path) -> Program:
    """The table of an ``adapter.toml`` at ``path``, checked.

    Raises
    ------
    BadConfig : naming the key.
    """
    table = dict(table)
    traits = traits_of(table.pop("traits", {}), str(path))
    for key in ("command", "capabilities", "files"):
        if isinstance(table.get(key), list):
            table[key] = tuple(table[key])
    if "toml_file" in table:
        raise BadConfig("there is no key 'toml_file'", where=str(path))
    try:
        program = Program.model_validate({**table, "traits": traits, "toml_file": path.resolve()})
    except ValidationError as error:
        raise bad_key(error, path, [*Program.model_fields, *Timeouts.model_fields]) from None
    unknown = [name for name in program.capabilities if name not in CAPABILITIES]
    if unknown:
        raise BadConfig(
            f"there is no capability {unknown[0]!r}",
            where=f"{path}: capabilities",
            remedy=f"choose from {', '.join(CAPABILITIES)}",
        )
    return program


def traits_of(table: Any, where: str) -> Traits:
    """A ``[traits]`` table as :class:`Traits`.

    Raises
    ------
    BadConfig : naming the key.
    """
    names = [field.name for field in fields(Traits)]
    if not isinstance(table, dict):
        raise BadConfig("traits must be a table", where=where, remedy="write [traits] on a line of its own")
    for key in table:
        if key not in names:
            raise BadConfig(f"there is no trait {key[:60]!r}", where=where, remedy=_nearest(key, names))
    for key, value in table.items():
        if isinstance(value, str) and not (value.isprintable() and len(value) <= 300):
            raise BadConfig("must be one line of printable text", where=f"{where}: traits.{key}")
    try:
        # By way of JSON, where strict types still let a table become a dataclass.
        return TypeAdapter(Traits).validate_json(json.dumps(table, default=str), strict=True)
    except ValidationError as error:
        raise bad_key(error, Path(where), names, "traits.") from None


def _matches(home: Path, pattern: str, toml_file: Path) -> list[Path]:
    if not any(character in pattern for character in "*?["):
        return [home / pattern]
    try:
        return sorted(home.glob(pattern))
    except (ValueError, NotImplementedError) as error:
        raise BadConfig(f"{pattern!r} is not a pattern: {error}", where=f"{toml_file}: files") from None


def bad_key(error: ValidationError, path: Path, known: list[str], prefix: str = "") -> BadConfig:
    # A misspelt key is also a missing one; the misspelling is what helps.
    errors = sorted(error.errors(include_url=False, include_input=False), key=lambda e: e["type"] != "extra_forbidden")
    first = errors[0]
    key = prefix + ".".join(str(part) for part in first["loc"])
    if first["type"] == "extra_forbidden":
        last = str(first["loc"][-1])
        return BadConfig(f"there is no key {key[:80]!r}", where=str(path), remedy=_nearest(last, known))
    return BadConfig(f"{key[:80]}: {first['msg']}", where=str(path))


def _nearest(key: str, known: list[str]) -> str:
    near = difflib.get_close_matches(key, known, n=1)
    return f"did you mean {near[0]!r}?" if near else f"choose from {', '.join(known)}"
