"""The HIERARCHY block of a BVH file, and why a text is refused."""

from __future__ import annotations

import re
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bench.arrays import FloatArray, read_only

CHANNEL_NAMES = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
MAX_JOINTS = 10_000
CUT_OFF = "the file is cut off"
_CHANNELS = {name.lower(): name for name in CHANNEL_NAMES}
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_NOT_A_NUMBER = ("nan", "inf", "infinity", "1.#qnan", "1.#ind", "1.#inf")


class Refusal(Exception):
    """Why a text is refused, and on which line; the reader adds the file's name."""

    def __init__(
        self, line: int, problem: str, cause: str = "", remedy: str = "correct that line, or export the file again"
    ) -> None:
        super().__init__(problem)
        self.line, self.problem, self.cause, self.remedy = line, problem, cause, remedy


@dataclass(frozen=True)
class Hierarchy:
    """Joints in file order; see :class:`bench.motion.bvh.BvhMotion`."""

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: FloatArray
    channels: tuple[tuple[str, ...], ...]


def number(token: str, line: int, problem: str) -> float:
    """``float(token)`` for a finite decimal; everything else Python would take (nan, 1_000) is refused."""
    if _DECIMAL.fullmatch(token):
        value = float(token)
        if np.isfinite(value):
            return value
    cause = "decimal commas" if "," in token else ""
    if token.lower().lstrip("+-") in _NOT_A_NUMBER:
        cause = "lost markers or a failed export"
    raise Refusal(line, f"{problem}, got {token[:30]!r}", cause)


@lru_cache(maxsize=64)
def parse_hierarchy(header: bytes) -> Hierarchy:
    """The tree in ``header``: everything before the MOTION line, HIERARCHY included.

    Raises
    ------
    Refusal : not a hierarchy.
    """
    return _HierarchyReader(header).read()


def _decoded(header: bytes) -> str:
    """UTF-8, else Latin-1 as older exporters write it, so that no two joint names become one."""
    try:
        return header.decode("utf-8")
    except UnicodeDecodeError:
        return header.decode("latin-1")


class _HierarchyReader:
    """Reads the tree token by token; keywords count only where a keyword may stand, so joints may be named like one."""

    def __init__(self, header: bytes) -> None:
        text = _decoded(header).replace("{", " { ").replace("}", " } ")
        self.tokens = [(token, n) for n, line in enumerate(text.split("\n"), 1) for token in line.split()]
        self.last_line = text.count("\n") + 1
        self.at = 0
        self.names: list[str] = []
        self.taken: set[str] = set()
        self.parents: list[int] = []
        self.offsets: list[tuple[float, ...] | None] = []
        self.channels: list[tuple[str, ...] | None] = []
        self.open_joints: list[tuple[int, int]] = []

    def read(self) -> Hierarchy:
        keywords = {"root": self._joint, "joint": self._joint, "end": self._end_site, "offset": self._offset}
        keywords |= {"channels": self._channels, "}": self._close}
        first, line = self._next()
        if first.lower() != "hierarchy":
            raise Refusal(line, f"expected HIERARCHY, got {first[:20]!r}", "not a BVH file")
        while self.at < len(self.tokens):
            token, line = self._next()
            if token.lower() not in keywords:
                raise Refusal(line, f"expected JOINT, OFFSET, CHANNELS, End Site or a brace, got {token[:30]!r}")
            keywords[token.lower()](token.lower(), line)
        if self.open_joints:
            joint, line = self.open_joints[-1]
            raise Refusal(line, f"the brace of joint {self.names[joint]} is never closed", CUT_OFF)
        if not self.names:
            raise Refusal(self.last_line, "HIERARCHY has no ROOT")
        if not any(self.channels):
            raise Refusal(self.last_line, "no joint has CHANNELS")
        offsets = read_only(np.array(self.offsets, dtype=np.float64))
        return Hierarchy(
            tuple(self.names), tuple(self.parents), offsets, tuple(channels or () for channels in self.channels)
        )

    def _next(self) -> tuple[str, int]:
        if self.at >= len(self.tokens):
            raise Refusal(self.last_line, "the hierarchy ends too early", CUT_OFF)
        self.at += 1
        return self.tokens[self.at - 1]

    def _open_brace(self) -> None:
        token, line = self._next()
        if token != "{":
            raise Refusal(line, f"expected an opening brace, got {token!r}")

    def _rest_of_line(self, line: int) -> str:
        words = []
        while self.at < len(self.tokens) and self.tokens[self.at][1] == line and self.tokens[self.at][0] != "{":
            words.append(self._next()[0])
        return " ".join(words)

    def _joint(self, keyword: str, line: int) -> None:
        name = self._rest_of_line(line)
        if not name:
            raise Refusal(line, f"{keyword.upper()} without a name")
        if name in self.taken:
            raise Refusal(line, f"joint {name} appears twice", remedy="rename one of the two")
        if keyword == "root" and self.names:
            raise Refusal(line, f"a second ROOT {name}", "several characters in one file", "export them separately")
        if keyword == "joint" and not self.open_joints:
            raise Refusal(line, f"joint {name} stands outside the root")
        if len(self.names) >= MAX_JOINTS:
            raise Refusal(line, f"more than {MAX_JOINTS} joints")
        self._open_brace()
        self.parents.append(self.open_joints[-1][0] if self.open_joints else -1)
        self.open_joints.append((len(self.names), line))
        self.names.append(name)
        self.taken.add(name)
        self.offsets.append(None)
        self.channels.append(None)

    def _end_site(self, keyword: str, line: int) -> None:
        if not self.open_joints:
            raise Refusal(line, "End Site stands outside a joint")
        self._rest_of_line(line)
        self._open_brace()
        while (token_line := self._next())[0] != "}":
            token, inner_line = token_line
            if token.lower() != "offset":
                raise Refusal(inner_line, f"expected OFFSET or a closing brace in End Site, got {token!r}")
            self._three_numbers(inner_line)

    def _current(self, line: int, keyword: str) -> int:
        if not self.open_joints:
            raise Refusal(line, f"{keyword.upper()} stands outside a joint")
        return self.open_joints[-1][0]

    def _three_numbers(self, line: int) -> tuple[float, ...]:
        return tuple(number(self._next()[0], line, "OFFSET needs three numbers") for _ in range(3))

    def _offset(self, keyword: str, line: int) -> None:
        joint = self._current(line, keyword)
        if self.offsets[joint] is not None:
            raise Refusal(line, f"joint {self.names[joint]} has two OFFSETs")
        self.offsets[joint] = self._three_numbers(line)

    def _channels(self, keyword: str, line: int) -> None:
        joint = self._current(line, keyword)
        if self.channels[joint] is not None:
            raise Refusal(line, f"joint {self.names[joint]} has two CHANNELS")
        count, _ = self._next()
        if count not in tuple("0123456"):
            raise Refusal(line, f"CHANNELS needs a count of 0 to 6, got {count[:30]!r}")
        names = []
        for _ in range(int(count)):
            token, _ = self._next()
            if token.lower() not in _CHANNELS:
                cause = "fewer channels than CHANNELS says, or a typo"
                raise Refusal(line, f"unknown channel {token[:30]!r}", cause)
            names.append(_CHANNELS[token.lower()])
        if len(set(names)) != len(names):
            raise Refusal(line, f"joint {self.names[joint]} lists a channel twice")
        self.channels[joint] = tuple(names)

    def _close(self, keyword: str, line: int) -> None:
        if not self.open_joints:
            raise Refusal(line, "a closing brace without an opening one")
        joint, _ = self.open_joints.pop()
        if self.offsets[joint] is None:
            raise Refusal(line, f"joint {self.names[joint]} has no OFFSET")
