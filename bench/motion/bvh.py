"""BVH files: read, forward kinematics of what was read, write.

Rotations apply in the order in which a joint lists its channels (intrinsic, degrees). A position channel replaces the
joint's OFFSET on that axis, on any joint; that is how Bandai-Namco's absolute hips and six-channel joints are meant,
and for the usual zero root OFFSET it is the same as adding. Numbers are bit-exact to ``float()``.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from decimal import Decimal
from functools import lru_cache
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray, IntArray, read_only
from bench.errors import BadFile
from bench.motion import _bvh_kernels
from bench.motion._bvh_hierarchy import CUT_OFF, Refusal, number, parse_hierarchy
from bench.motion._bvh_write import write_bvh

__all__ = ["BvhMotion", "local_motion", "read_bvh", "world_motion", "write_bvh"]

MIN_FRAME_TIME_S = 1e-6
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
        """Frames per second: the whole number whose inverse, rounded or cut off, is written; else the exact inverse.

        0.0333333 and 0.0333 give 30, 0.0166 and 0.0167 give 60, 0.008333 gives 120, 0.0333667 gives 29.97.
        """
        whole = round(1.0 / self.frame_time_s)
        exponent = Decimal(repr(self.frame_time_s)).as_tuple().exponent
        last_digit = 10.0**exponent if isinstance(exponent, int) else 0.0
        if whole > 0 and -0.5 * last_digit <= 1.0 / whole - self.frame_time_s < last_digit:
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
    except Refusal as refusal:
        where = f"{name or '<bytes>'}:{refusal.line}"
        raise BadFile(refusal.problem, where=where, cause=refusal.cause, remedy=refusal.remedy) from None


def local_motion(bvh: BvhMotion) -> tuple[FloatArray, FloatArray]:
    """Local rotations ``[F, J, 4]`` (w, x, y, z) and translations ``[F, J, 3]`` (file units) of every joint."""
    axes, columns, positions = _channel_columns(bvh.channels)
    return _bvh_kernels.local_motion(bvh.channel_values, bvh.offsets, axes, columns, positions)


def world_motion(bvh: BvhMotion) -> tuple[FloatArray, FloatArray]:
    """World positions ``[F, J, 3]`` (file units) and world rotations ``[F, J, 4]`` of every joint of the file."""
    rotations, translations = local_motion(bvh)
    return _bvh_kernels.world_motion(rotations, translations, np.asarray(bvh.parents, dtype=np.int64))


def _parse(content: bytes) -> BvhMotion:
    content = content.removeprefix(b"\xef\xbb\xbf")
    if b"\n" not in content and b"\r" in content:
        content = content.replace(b"\r", b"\n")
    _check_start(content)
    marker = _MOTION_LINE.search(content)
    hierarchy = parse_hierarchy(content[: marker.start() if marker else len(content)])
    if marker is None:
        cause = f"{CUT_OFF}, or holds a skeleton only"
        raise Refusal(content.rstrip().count(b"\n") + 1, "the file ends without a MOTION line", cause)
    frames, frame_time_s, block_start = _parse_motion_header(content, marker.end())
    columns = sum(len(channels) for channels in hierarchy.channels)
    values = _parse_block(content, block_start, frames, columns)
    return BvhMotion(
        hierarchy.names, hierarchy.parents, hierarchy.offsets, hierarchy.channels, read_only(values), frame_time_s
    )


def _check_start(content: bytes) -> None:
    """Refuse what is plainly no BVH before any of it is decoded."""
    first = re.search(rb"\S", content)
    if first is None:
        raise Refusal(1, "the file is empty", "an interrupted download or export", "get or export the file again")
    start = content[first.start() : first.start() + 20]
    if start[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise Refusal(1, "expected HIERARCHY, got UTF-16 text", remedy="save the file as UTF-8")
    if start[:9].upper() != b"HIERARCHY":
        line = _line(content, first.start())
        raise Refusal(line, f"expected HIERARCHY, got {start!r}", "not a BVH file", "give a BVH file")


def _line(content: bytes, position: int) -> int:
    return content.count(b"\n", 0, position) + 1


def _parse_motion_header(content: bytes, position: int) -> tuple[int, float, int]:
    """Frame count, frame time in seconds, and where the rows start."""
    count, line, position = _header_value(content, position, "Frames")
    if not re.fullmatch("0*[1-9][0-9]{0,14}", count):
        raise Refusal(line, f"Frames must be a positive whole number, got {count[:30]!r}")
    time, line, position = _header_value(content, position, "Frame Time")
    frame_time_s = number(time, line, "Frame Time must be a number of seconds")
    if frame_time_s < MIN_FRAME_TIME_S:
        cause = "an exporter that does not know the frame rate"
        raise Refusal(line, f"Frame Time must be at least {MIN_FRAME_TIME_S:g} s, got {time[:30]!r}", cause)
    return int(count), frame_time_s, position


def _header_value(content: bytes, position: int, keyword: str) -> tuple[str, int, int]:
    """What stands behind ``keyword:`` on the next line that is not blank, which line that is, and where it ends."""
    found = re.compile(rb"\s*([^\n]*)").match(content, position)
    text = found[1][:200].decode("utf-8", errors="replace").strip() if found else ""
    if not found or not text:
        raise Refusal(_line(content.rstrip(), len(content)), f"no '{keyword}:' line after MOTION", CUT_OFF)
    line = _line(content, found.start(1))
    label, _, value = text.partition(":")
    if " ".join(label.split()).lower() != keyword.lower():
        raise Refusal(line, f"expected '{keyword}: ...', got {text[:40]!r}")
    return value.strip(), line, found.end(1)


def _parse_block(content: bytes, start: int, frames: int, columns: int) -> FloatArray:
    # A number and its separator take two bytes: whatever the header promises, no more memory is taken than that.
    values = np.empty(min(frames * columns, (len(content) - start + 1) // 2))
    text = np.frombuffer(content, dtype=np.uint8)
    words = np.ndarray(max(len(content) - 7, 0), dtype="<u8", buffer=content, strides=(1,))
    odd = np.empty((256, 3), dtype=np.int64)
    position, index, on_line, status = start, 0, 0, _bvh_kernels.ODD_TOKENS_FULL
    while status == _bvh_kernels.ODD_TOKENS_FULL:
        status, position, index, on_line, n_odd = _bvh_kernels.parse_rows(
            text, words, position, values, index, on_line, columns, odd
        )
        for token_start, token_end, at in odd[:n_odd].tolist():
            values[at] = _odd_number(content, token_start, token_end)
    if status in (_bvh_kernels.SHORT_ROW, _bvh_kernels.LONG_ROW):
        got = str(on_line) if status == _bvh_kernels.SHORT_ROW else f"more than {columns}"
        cause = "a truncated file or a changed hierarchy"
        raise Refusal(_line(content, position), f"expected {columns} values, got {got}", cause)
    if status == _bvh_kernels.TOO_MANY_ROWS or index != frames * columns:
        rows = sum(1 for row in content[start:].split(b"\n") if row.strip())
        line = _line(content, position) if rows > frames else _line(content.rstrip(), len(content))
        problem = f"the header promises {frames} frames of {columns} values, the file has {rows} rows"
        raise Refusal(line, problem, "a truncated or hand-edited file", "correct Frames, or get the file again")
    return values.reshape(frames, columns)


def _odd_number(content: bytes, start: int, end: int) -> float:
    """A token that the kernel leaves alone: an exponent, more digits than a double holds, or no number."""
    token = content[start:end].decode("utf-8", errors="replace")
    try:
        return number(token, 0, "expected a finite number")
    except Refusal as refusal:
        refusal.line = _line(content, start)
        raise


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
