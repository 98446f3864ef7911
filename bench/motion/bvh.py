"""BVH files: read, forward kinematics of what was read, write.

Rotations apply in the order in which a joint lists its channels (intrinsic, degrees). A position channel replaces the
joint's OFFSET on that axis, on any joint; that is how Bandai-Namco's absolute hips and six-channel joints are meant,
and for the usual zero root OFFSET it is the same as adding. Numbers are bit-exact to ``float()``.
"""

from __future__ import annotations

import os
import re
import tempfile
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray, IntArray, read_only
from bench.errors import BadFile, BadMotion
from bench.motion import _bvh_kernels, quat
from bench.motion.clip import Clip

CHANNEL_NAMES = ("Xposition", "Yposition", "Zposition", "Xrotation", "Yrotation", "Zrotation")
MAX_JOINTS = 10_000
_CHANNELS = {name.lower(): name for name in CHANNEL_NAMES}
_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")
_MOTION_LINE = re.compile(rb"^[ \t]*MOTION[ \t]*\r?$", re.MULTILINE | re.IGNORECASE)


@dataclass(frozen=True, eq=False)
class BvhMotion:
    """What a BVH file says, in its own units.

    Attributes
    ----------
    names, parents : joints in file order, the root first, parent -1 for the root; End Sites are not joints.
    offsets : ``[J, 3]`` OFFSET of each joint, file units.
    channels : per joint its channel names, in file order.
    channel_values : ``[F, C]`` the motion block, degrees and file units.
    frame_time_s : seconds per frame, as written.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: FloatArray
    channels: tuple[tuple[str, ...], ...]
    channel_values: FloatArray
    frame_time_s: float

    @property
    def n_frames(self) -> int:
        return int(self.channel_values.shape[0])

    @property
    def fps(self) -> float:
        """Frames per second: the whole number whose printed inverse ``frame_time_s`` is, else its exact inverse.

        0.0333333 gives 30, 0.008333 gives 120, 0.0333667 gives 29.97.
        """
        whole = round(1.0 / self.frame_time_s)
        exponent = Decimal(repr(self.frame_time_s)).as_tuple().exponent
        last_digit = 10.0**exponent if isinstance(exponent, int) else 0.0
        if whole > 0 and abs(1.0 / whole - self.frame_time_s) < last_digit:
            return float(whole)
        return 1.0 / self.frame_time_s


def read_bvh(source: Path | bytes, *, name: str = "") -> BvhMotion:
    """Read a BVH file.

    Parameters
    ----------
    source : a path, or the content of a file.
    name : how messages call it; the path by default.

    Raises
    ------
    BadFile : not readable, not a BVH, or inconsistent; the message starts with ``file:line``.
    """
    if isinstance(source, Path):
        name = name or str(source)
        try:
            source = source.read_bytes()
        except OSError as error:
            raise BadFile(f"cannot be read ({error.strerror})", where=name) from error
    try:
        return _parse(source)
    except _Refusal as refusal:
        where = f"{name or '<bytes>'}:{refusal.line}"
        raise BadFile(refusal.problem, where=where, cause=refusal.cause) from None


def local_motion(bvh: BvhMotion) -> tuple[FloatArray, FloatArray]:
    """Local rotations ``[F, J, 4]`` (w, x, y, z) and translations ``[F, J, 3]`` (file units) of every joint."""
    axes, columns, positions = _channel_columns(bvh.channels)
    return _bvh_kernels.local_motion(bvh.channel_values, bvh.offsets, axes, columns, positions)


def world_motion(bvh: BvhMotion) -> tuple[FloatArray, FloatArray]:
    """World positions ``[F, J, 3]`` (file units) and world rotations ``[F, J, 4]`` of every joint of the file."""
    rotations, translations = local_motion(bvh)
    return _bvh_kernels.world_motion(rotations, translations, np.asarray(bvh.parents, dtype=np.int64))


def write_bvh(path: Path, clip: Clip, *, unit_m: float = 0.01) -> None:
    """Write a clip as BVH: root with position, every joint with Z, X, Y rotation, ``unit_m`` metres per file unit.

    The file appears whole or not at all. World positions survive ``write -> read`` to better than 1e-5 m.

    Raises
    ------
    BadFile : the path cannot be written.
    BadMotion : a joint name that BVH cannot hold.
    """
    for joint in clip.skeleton.names:
        if not joint.strip() or any(c in joint for c in "{}\r\n\0"):
            raise BadMotion(f"joint name {joint!r} cannot be written to BVH", where=str(path))
    rotations = np.degrees(_to_zxy_angles(clip.rotations_wxyz)).reshape(clip.n_frames, -1)
    values = np.concatenate([clip.root_xyz_m / unit_m, rotations], axis=1)
    row = " ".join(["%.6f"] * values.shape[1])
    rows = "\n".join(row % tuple(frame) for frame in values.tolist())
    header = _hierarchy_text(clip, unit_m)
    text = f"HIERARCHY\n{header}MOTION\nFrames: {clip.n_frames}\nFrame Time: {1.0 / clip.fps:.10g}\n{rows}\n"
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        try:
            with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
                file.write(text)
            Path(temporary).chmod(0o644)
            Path(temporary).replace(path)
        except BaseException:
            Path(temporary).unlink(missing_ok=True)
            raise
    except OSError as error:
        raise BadFile(f"cannot be written ({error.strerror})", where=str(path)) from error


def _to_zxy_angles(rotations_wxyz: FloatArray) -> FloatArray:
    """Angles ``[..., 3]`` about Z, X, Y (radians) of R = Rz Rx Ry; at the pole all of it goes to Z."""
    matrix = quat.to_matrix(rotations_wxyz)
    cosine = np.hypot(matrix[..., 2, 0], matrix[..., 2, 2])
    pole = cosine < 1e-9
    x = np.arctan2(matrix[..., 2, 1], cosine)
    z_at_pole = np.arctan2(matrix[..., 1, 0], matrix[..., 0, 0])
    z = np.where(pole, z_at_pole, np.arctan2(-matrix[..., 0, 1], matrix[..., 1, 1]))
    y = np.where(pole, 0.0, np.arctan2(-matrix[..., 2, 0], matrix[..., 2, 2]))
    return np.stack([z, x, y], axis=-1)


def _hierarchy_text(clip: Clip, unit_m: float) -> str:
    """The HIERARCHY block. Joints are written in tree order, which must be the skeleton's own order."""
    skeleton = clip.skeleton
    lines: list[str] = []
    open_joints: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while open_joints and open_joints[-1] != parent:
            lines.append("\t" * (len(open_joints) - 1) + "}")
            open_joints.pop()
        if parent >= 0 and not open_joints:
            raise BadMotion(
                "joints must be in depth-first order to be written to BVH", where=f"joint {skeleton.names[joint]}"
            )
        indent = "\t" * len(open_joints)
        offset = " ".join(f"{value:.9g}" for value in skeleton.offsets_m[joint] / unit_m)
        positions = "6 Xposition Yposition Zposition" if parent < 0 else "3"
        lines += [
            f"{indent}{'ROOT' if parent < 0 else 'JOINT'} {skeleton.names[joint]}",
            f"{indent}{{",
            f"{indent}\tOFFSET {offset if parent >= 0 else '0 0 0'}",
            f"{indent}\tCHANNELS {positions} Zrotation Xrotation Yrotation",
        ]
        if joint not in skeleton.parents:
            lines += [f"{indent}\tEnd Site", f"{indent}\t{{", f"{indent}\t\tOFFSET 0 0 0", f"{indent}\t}}"]
        open_joints.append(joint)
    lines += ["\t" * depth + "}" for depth in reversed(range(len(open_joints)))]
    return "\n".join(lines) + "\n"


class _Refusal(Exception):
    """Why a text is refused, and on which line; :func:`read_bvh` adds the file's name."""

    def __init__(self, line: int, problem: str, cause: str = "") -> None:
        super().__init__(problem)
        self.line, self.problem, self.cause = line, problem, cause


@dataclass(frozen=True)
class _Hierarchy:
    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets: FloatArray
    channels: tuple[tuple[str, ...], ...]


def _parse(content: bytes) -> BvhMotion:
    if not content.strip():
        raise _Refusal(1, "the file is empty", "an interrupted download or export")
    content = content.removeprefix(b"\xef\xbb\xbf")
    if b"\r" in content and b"\n" not in content:
        content = content.replace(b"\r", b"\n")
    if content.lstrip()[:9].upper() != b"HIERARCHY":
        start = content.lstrip()[:20]
        cause = "UTF-16 text: save it as UTF-8" if content[:2] in (b"\xff\xfe", b"\xfe\xff") else "not a BVH file"
        raise _Refusal(1, f"expected HIERARCHY, got {start!r}", cause)
    marker = _MOTION_LINE.search(content)
    header = content[: marker.start() if marker else len(content)]
    hierarchy = _parse_hierarchy(header)
    if marker is None:
        raise _Refusal(content.count(b"\n") + 1, "no MOTION line", "the file is cut off or holds a skeleton only")
    frames, frame_time, block_start, line = _parse_motion_header(content, marker.end())
    columns = sum(len(channels) for channels in hierarchy.channels)
    values = _parse_block(content, block_start, line, frames, columns)
    return BvhMotion(
        hierarchy.names, hierarchy.parents, hierarchy.offsets, hierarchy.channels, read_only(values), frame_time
    )


@lru_cache(maxsize=64)
def _parse_hierarchy(header: bytes) -> _Hierarchy:
    return _HierarchyReader(header).read()


class _HierarchyReader:
    """Reads the tree token by token; keywords count only where a keyword may stand, so joints may be named like one."""

    def __init__(self, header: bytes) -> None:
        text = header.decode("utf-8", errors="replace").replace("{", " { ").replace("}", " } ")
        self.tokens = [(token, n) for n, line in enumerate(text.split("\n"), 1) for token in line.split()]
        self.last_line = text.count("\n") + 1
        self.at = 1
        self.names: list[str] = []
        self.parents: list[int] = []
        self.offsets: list[tuple[float, ...] | None] = []
        self.channels: list[tuple[str, ...] | None] = []
        self.open_joints: list[tuple[int, int]] = []

    def read(self) -> _Hierarchy:
        keywords = {"root": self._joint, "joint": self._joint, "end": self._end_site, "offset": self._offset}
        keywords |= {"channels": self._channels, "}": self._close}
        while self.at < len(self.tokens):
            token, line = self._next()
            if token.lower() not in keywords:
                raise _Refusal(line, f"expected JOINT, OFFSET, CHANNELS, End Site or a brace, got {token!r}")
            keywords[token.lower()](token.lower(), line)
        if self.open_joints:
            joint, line = self.open_joints[-1]
            raise _Refusal(line, f"the brace of joint {self.names[joint]} is never closed", "the file is cut off")
        if not self.names:
            raise _Refusal(self.last_line, "HIERARCHY has no ROOT")
        if not any(self.channels):
            raise _Refusal(self.last_line, "no joint has CHANNELS")
        offsets = read_only(np.array(self.offsets, dtype=np.float64))
        return _Hierarchy(
            tuple(self.names), tuple(self.parents), offsets, tuple(channels or () for channels in self.channels)
        )

    def _next(self) -> tuple[str, int]:
        if self.at >= len(self.tokens):
            raise _Refusal(self.last_line, "the hierarchy ends too early", "the file is cut off")
        self.at += 1
        return self.tokens[self.at - 1]

    def _open_brace(self) -> None:
        token, line = self._next()
        if token != "{":
            raise _Refusal(line, f"expected an opening brace, got {token!r}")

    def _rest_of_line(self, line: int) -> str:
        words = []
        while self.at < len(self.tokens) and self.tokens[self.at][1] == line and self.tokens[self.at][0] != "{":
            words.append(self._next()[0])
        return " ".join(words)

    def _joint(self, keyword: str, line: int) -> None:
        name = self._rest_of_line(line)
        if not name:
            raise _Refusal(line, f"{keyword.upper()} without a name")
        if name in self.names:
            raise _Refusal(line, f"joint {name} appears twice")
        if keyword == "root" and self.names:
            raise _Refusal(line, f"a second ROOT {name}", "several characters in one file: export them separately")
        if keyword == "joint" and not self.open_joints:
            raise _Refusal(line, f"joint {name} stands outside the root")
        if len(self.names) >= MAX_JOINTS:
            raise _Refusal(line, f"more than {MAX_JOINTS} joints")
        self._open_brace()
        self.parents.append(self.open_joints[-1][0] if self.open_joints else -1)
        self.open_joints.append((len(self.names), line))
        self.names.append(name)
        self.offsets.append(None)
        self.channels.append(None)

    def _end_site(self, keyword: str, line: int) -> None:
        if not self.open_joints:
            raise _Refusal(line, "End Site stands outside a joint")
        self._rest_of_line(line)
        self._open_brace()
        while (token_line := self._next())[0] != "}":
            token, inner_line = token_line
            if token.lower() != "offset":
                raise _Refusal(inner_line, f"expected OFFSET or a closing brace in End Site, got {token!r}")
            self._numbers(inner_line, "OFFSET")

    def _current(self, line: int, keyword: str) -> int:
        if not self.open_joints:
            raise _Refusal(line, f"{keyword.upper()} stands outside a joint")
        return self.open_joints[-1][0]

    def _numbers(self, line: int, keyword: str) -> tuple[float, ...]:
        return tuple(_number(*self._next(), f"{keyword} needs three numbers") for _ in range(3))

    def _offset(self, keyword: str, line: int) -> None:
        joint = self._current(line, keyword)
        if self.offsets[joint] is not None:
            raise _Refusal(line, f"joint {self.names[joint]} has two OFFSETs")
        self.offsets[joint] = self._numbers(line, "OFFSET")

    def _channels(self, keyword: str, line: int) -> None:
        joint = self._current(line, keyword)
        if self.channels[joint] is not None:
            raise _Refusal(line, f"joint {self.names[joint]} has two CHANNELS")
        count, count_line = self._next()
        if not count.isdecimal() or int(count) > len(CHANNEL_NAMES):
            raise _Refusal(count_line, f"CHANNELS needs a count of 0 to 6, got {count!r}")
        names = []
        for _ in range(int(count)):
            token, token_line = self._next()
            if token.lower() not in _CHANNELS:
                raise _Refusal(token_line, f"unknown channel {token!r}", "fewer channels than CHANNELS says, or a typo")
            names.append(_CHANNELS[token.lower()])
        if len(set(names)) != len(names):
            raise _Refusal(line, f"joint {self.names[joint]} lists a channel twice")
        self.channels[joint] = tuple(names)

    def _close(self, keyword: str, line: int) -> None:
        if not self.open_joints:
            raise _Refusal(line, "a closing brace without an opening one")
        joint, _ = self.open_joints.pop()
        if self.offsets[joint] is None:
            raise _Refusal(line, f"joint {self.names[joint]} has no OFFSET")


def _number(token: str, line: int, problem: str) -> float:
    """``float(token)`` for a finite decimal; everything else Python would take (nan, 1_000) is refused."""
    if _DECIMAL.fullmatch(token):
        value = float(token)
        if np.isfinite(value):
            return value
    cause = "decimal commas" if "," in token else ""
    if token.lower().lstrip("+-") in ("nan", "inf", "infinity", "1.#qnan", "1.#ind", "1.#inf"):
        cause = "lost markers or a failed export"
    raise _Refusal(line, f"{problem}, got {token[:30]!r}", cause)


def _parse_motion_header(content: bytes, position: int) -> tuple[int, float, int, int]:
    """Frame count, frame time, where the rows start and on which line."""
    line = content.count(b"\n", 0, position) + 1
    found: list[str] = []
    for keyword in ("Frames", "Frame Time"):
        text = ""
        while not text:
            line_end = content.find(b"\n", position)
            if line_end < 0:
                raise _Refusal(line, f"no '{keyword}:' line after MOTION", "the file is cut off")
            position = line_end + 1
            line += 1
            next_end = content.find(b"\n", position)
            raw = content[position : next_end if next_end >= 0 else len(content)]
            text = raw[:200].decode("utf-8", errors="replace").strip()
        label, _, value = text.partition(":")
        if " ".join(label.split()).lower() != keyword.lower():
            raise _Refusal(line, f"expected '{keyword}: ...', got {text[:40]!r}")
        found.append(value.strip())
        if keyword == "Frames" and (not found[0].isdecimal() or len(found[0]) > 15 or int(found[0]) == 0):
            raise _Refusal(line, f"Frames must be a positive whole number, got {found[0][:30]!r}")
    frame_time = _number(found[1], line, "Frame Time must be a number")
    if frame_time <= 0.0:
        raise _Refusal(line, f"Frame Time must be positive, got {found[1]!r}", "an exporter that does not know the fps")
    line_end = content.find(b"\n", position)
    return int(found[0]), frame_time, line_end + 1 if line_end >= 0 else len(content), line + 1


def _parse_block(content: bytes, start: int, first_line: int, frames: int, columns: int) -> FloatArray:
    # A number and its separator take two bytes, so a promise the file cannot hold is refused before memory is taken.
    if frames * columns > (len(content) - start + 1) // 2:
        raise _wrong_row_count(content, start, frames, columns)
    text = np.frombuffer(content, dtype=np.uint8)
    values = np.empty(frames * columns)
    odd = np.empty((256, 3), dtype=np.int64)
    position, index, on_line, status = start, 0, 0, _bvh_kernels.ODD_TOKENS_FULL
    while status == _bvh_kernels.ODD_TOKENS_FULL:
        status, position, index, on_line, n_odd = _bvh_kernels.parse_rows(
            text, position, values, index, on_line, columns, odd
        )
        for token_start, token_end, at in odd[:n_odd].tolist():
            token = content[token_start:token_end].decode("utf-8", errors="replace")
            try:
                values[at] = _number(token, 0, "expected a finite number")
            except _Refusal as refusal:
                refusal.line = content.count(b"\n", 0, token_start) + 1
                raise
    if status in (_bvh_kernels.SHORT_ROW, _bvh_kernels.LONG_ROW):
        line = content.count(b"\n", 0, position) + 1
        how_many = str(on_line) if status == _bvh_kernels.SHORT_ROW else f"more than {columns}"
        raise _Refusal(line, f"expected {columns} values, got {how_many}", "a truncated file or a changed hierarchy")
    if status == _bvh_kernels.TOO_MANY_ROWS or index != values.size:
        raise _wrong_row_count(content, start, frames, columns)
    return values.reshape(frames, columns)


def _wrong_row_count(content: bytes, start: int, frames: int, columns: int) -> _Refusal:
    rows = sum(1 for row in content[start:].split(b"\n") if row.strip())
    last_line = content.rstrip().count(b"\n") + 1
    problem = f"the header promises {frames} frames of {columns} values, the file has {rows} rows"
    return _Refusal(last_line, problem, "a truncated or hand-edited file")


@lru_cache(maxsize=64)
def _channel_columns(channels: tuple[tuple[str, ...], ...]) -> tuple[IntArray, IntArray, IntArray]:
    """Per joint: rotation axes in order, their columns, and the columns of X, Y, Z position; -1 where absent."""
    axes, columns, positions = (np.full((len(channels), 3), -1, dtype=np.int64) for _ in range(3))
    column = 0
    for joint, names in enumerate(channels):
        rotations_seen = 0
        for name in names:
            axis = "XYZ".index(name[0])
            if name.endswith("position"):
                positions[joint, axis] = column
            else:
                axes[joint, rotations_seen], columns[joint, rotations_seen] = axis, column
                rotations_seen += 1
            column += 1
    return axes, columns, positions
