"""Motions as files that others wrote: .npz read without pickles and in bounded memory, .bvh by the strict reader.

Only regular files directly named inside a folder are opened, never links; nothing that a file claims is allocated
before its size proves it.
"""

from __future__ import annotations

import io
import math
import os
import re
import stat
import zipfile
import zlib
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadFile, BadOutput, BenchError
from bench.motion.bvh import local_motion, read_bvh
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton

MAX_FRAMES = 100_000
BVH_UNIT_M = 0.01
BYTES_PER_NUMBER = {".npz": 8, ".bvh": 32}
SLACK_BYTES = 65536
"""Room for names, headers and a hierarchy, beyond the numbers themselves."""
MAX_MEMBERS = 16
_NPY_DESCR = re.compile(r"'descr'\s*:\s*'([<>][f][48])'")
_NPY_ORDER = re.compile(r"'fortran_order'\s*:\s*(True|False)")
_NPY_SHAPE = re.compile(r"'shape'\s*:\s*\(([0-9, ]*)\)")


def npz_bytes(arrays: dict[str, FloatArray]) -> bytes:
    """Arrays as an uncompressed .npz in memory; a third of the time of ``numpy.savez``."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, values in arrays.items():
            array = np.ascontiguousarray(values, dtype="<f8").reshape(np.shape(values))
            header = f"{{'descr': '<f8', 'fortran_order': False, 'shape': {array.shape}, }}"
            header += " " * (-(len(header) + 11) % 64) + "\n"
            start = b"\x93NUMPY\x01\x00" + len(header).to_bytes(2, "little") + header.encode()
            archive.writestr(zipfile.ZipInfo(f"{name}.npy"), start + array.tobytes())
    return buffer.getvalue()


def read_bounded(folder: Path, name: str, max_bytes: int) -> bytes:
    """A regular file inside ``folder``, refused where it is a link, lies elsewhere, or is too large.

    Raises
    ------
    BadFile : naming the file and what is wrong.
    """
    where = f"{folder.name}/{name[:120]!r}" if not _is_plain(name) else str(folder / name)
    if not _is_plain(name):
        raise BadFile("is no path inside the folder", where=where, remedy="give relative paths without '..'")
    try:
        handle = _open_without_links(folder, name)
    except (OSError, ValueError) as error:
        raise BadFile(f"cannot be read ({_reason(error)})", where=where, remedy="links are never followed") from None
    status = os.fstat(handle)
    if not stat.S_ISREG(status.st_mode):
        os.close(handle)
        raise BadFile("is not a regular file", where=where)
    with os.fdopen(handle, "rb") as file:
        if status.st_size > max_bytes:
            problem = f"has {status.st_size} bytes, at most {max_bytes} can belong to what is expected here"
            raise BadFile(problem, where=where, cause="more frames than were asked for, or other data")
        try:
            content = file.read(max_bytes + 1)
        except OSError as error:
            raise BadFile(f"cannot be read ({_reason(error)})", where=where) from None
    if len(content) > max_bytes:
        raise BadFile("grew while it was read", where=where)
    return content


def _is_plain(name: str) -> bool:
    parts = name.split("/")
    return bool(name) and len(name) < 512 and "\0" not in name and not any(part in ("", ".", "..") for part in parts)


def _open_without_links(folder: Path, name: str) -> int:
    """Open step by step below ``folder`` so that no part of the path can be a link."""
    *folders, last = name.split("/")
    at = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
    try:
        for part in folders:
            below = os.open(part, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW, dir_fd=at)
            os.close(at)
            at = below
        return os.open(last, os.O_RDONLY | os.O_NOFOLLOW | os.O_NONBLOCK, dir_fd=at)
    finally:
        os.close(at)


def _reason(error: Exception) -> str:
    text = error.strerror if isinstance(error, OSError) else str(error)
    return "it is a link" if text == "Too many levels of symbolic links" else str(text)


def parse_npz(
    content: bytes, names: tuple[str, ...], where: str, *, optional: tuple[str, ...] = ()
) -> dict[str, FloatArray]:
    """Float arrays of an .npz as float64; memory stays within a small multiple of ``content``.

    ``names`` must be there, ``optional`` may be.

    Raises
    ------
    BadFile : not an .npz, an array is missing, compressed beyond its claim, or not plain floats.
    """
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {member.filename: member for member in archive.infolist()[: MAX_MEMBERS + 1]}
            if len(members) > MAX_MEMBERS:
                raise BadFile(f"holds more than {MAX_MEMBERS} arrays", where=where)
            missing = [name for name in names if f"{name}.npy" not in members]
            if missing:
                there = ", ".join(sorted(members))[:200] or "nothing"
                raise BadFile(f"has no array {missing[0]!r}, it has {there!r}", where=where)
            # Writing numbers uncompressed is what numpy does; a compressed file may be 4 times its size, no more.
            limit = 4 * len(content) + SLACK_BYTES
            arrays = {}
            for name in (*names, *(name for name in optional if f"{name}.npy" in members)):
                with archive.open(members[f"{name}.npy"]) as file:
                    data = file.read(limit + 1)
                if len(data) > limit:
                    raise BadFile(f"{name} unpacks to over 4 times the file", where=where, cause="a zip bomb")
                arrays[name] = _parse_npy(data, name, where)
            return arrays
    except (zipfile.BadZipFile, zlib.error, OSError, RuntimeError, NotImplementedError, EOFError, ValueError) as error:
        raise BadFile(
            f"is not a readable .npz: {str(error)[:200]!r}", where=where, cause="cut off or pickled"
        ) from None
    except Exception as error:
        if isinstance(error, BenchError):
            raise
        raise BadFile(f"is not a readable .npz: {type(error).__name__}", where=where) from None


def _parse_npy(data: bytes, name: str, where: str) -> FloatArray:
    if data[:6] != b"\x93NUMPY" or len(data) < 12 or data[6] not in (1, 2, 3):
        raise BadFile(f"{name} is not an .npy array", where=where)
    size = 2 if data[6] == 1 else 4
    start = 8 + size + int.from_bytes(data[8 : 8 + size], "little")
    header = data[8 + size : min(start, 4096)].decode("latin-1")
    descr, order, shape = (pattern.search(header) for pattern in (_NPY_DESCR, _NPY_ORDER, _NPY_SHAPE))
    if not descr or not order or not shape:
        raise BadFile(
            f"{name} is not a plain array of float32 or float64",
            where=where,
            cause="objects, which would need pickle, or integers",
            remedy="numpy.savez(file, name=array.astype('float64'))",
        )
    lengths = tuple(int(word) for word in re.findall(r"\d{1,12}", shape[1]))
    dtype = np.dtype(descr[1])
    if len(lengths) > 8 or math.prod(lengths) * dtype.itemsize != len(data) - start:
        raise BadFile(f"{name} claims shape {list(lengths)[:8]} but has {len(data) - start} bytes", where=where)
    flat = np.frombuffer(data, dtype=dtype, offset=start)
    return np.asarray(flat.reshape(lengths, order="F" if order[1] == "True" else "C"), dtype=np.float64)


def read_motion(folder: Path, name: str, source: Clip, *, max_frames: int) -> Clip:
    """An answer file as a clip at the source's fps; the skeleton is the source's, or the file's own where it tells.

    Raises
    ------
    BadFile : not readable as what its suffix says.
    BadOutput : readable, but no motion of the source's 21 joints.
    """
    suffix = Path(name).suffix
    if suffix not in BYTES_PER_NUMBER:
        raise BadFile(f"expected .npz or .bvh, got {name[-60:]!r}", where=folder.name)
    numbers = min(max_frames, MAX_FRAMES) * (4 * source.skeleton.n_joints + 3)
    content = read_bounded(folder, name, 4 * numbers * BYTES_PER_NUMBER[suffix] + SLACK_BYTES)
    return motion_of(content, suffix, source, name)


def motion_of(content: bytes, suffix: str, source: Clip, where: str) -> Clip:
    """The content of an answer file as a clip; see :func:`read_motion`."""
    if suffix == ".npz":
        arrays = parse_npz(content, ("rotations_wxyz", "root_xyz_m"), where, optional=("offsets_m", "fps"))
        offsets_m = arrays.get("offsets_m")
        rotations, root = arrays["rotations_wxyz"], arrays["root_xyz_m"]
        fps = float(arrays["fps"].reshape(-1)[0]) if "fps" in arrays and arrays["fps"].size == 1 else source.fps
    else:
        offsets_m, rotations, root, fps = _bvh_motion(content, source, where)
    try:
        return Clip(_skeleton(offsets_m, source.skeleton), rotations, root, fps)
    except BenchError as error:
        raise BadOutput(error.problem, where=error.where or where, cause=error.cause, remedy=error.remedy) from None


def _skeleton(offsets_m: FloatArray | None, own: Skeleton) -> Skeleton:
    """The content's own skeleton, also where the file's offsets were only rounded; else one with the file's."""
    if offsets_m is None:
        return own
    skeleton = Skeleton(own.names, own.parents, offsets_m, own.virtual)
    return own if skeleton.same_bones(own) else skeleton


def _bvh_motion(content: bytes, source: Clip, where: str) -> tuple[FloatArray, FloatArray, FloatArray, float]:
    """Offsets in metres, rotations, root path in metres and fps, joints in the source's order."""
    bvh = read_bvh(content, name=where)
    joints = source.skeleton.names
    missing = [name for name in joints if name not in bvh.names]
    if missing or len(bvh.names) != len(joints):
        raise BadOutput(
            f"expected the {len(joints)} joints of the content's file, got {len(bvh.names)}",
            where=where,
            cause=f"{missing[0]} is missing" if missing else "joints were added",
            remedy="keep the HIERARCHY of the content's file",
        )
    order = [bvh.names.index(name) for name in joints]
    parents = tuple(order.index(bvh.parents[joint]) if bvh.parents[joint] >= 0 else -1 for joint in order)
    if parents != source.skeleton.parents:
        raise BadOutput("the joints hang together differently", where=where, remedy="keep the content file's HIERARCHY")
    rotations, translations = local_motion(bvh)
    offsets = bvh.offsets[order] * BVH_UNIT_M
    offsets[0] = source.skeleton.offsets_m[0]
    fps = source.fps if abs(bvh.fps - source.fps) < 1e-3 * source.fps else bvh.fps
    return offsets, rotations[:, order], translations[:, order[0]] * BVH_UNIT_M, fps
