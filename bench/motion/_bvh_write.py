"""Clips as BVH text."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray
from bench.errors import BadFile, BadInput, BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton


def write_bvh(path: Path, clip: Clip, *, unit_m: float = 0.01) -> None:
    """Write a clip as BVH: root with position, every joint with Z, X, Y rotation, ``unit_m`` metres per file unit.

    The file appears whole or not at all. World positions survive ``write -> read`` to better than 1e-5 m.

    Raises
    ------
    BadFile : the path cannot be written.
    BadMotion : a joint name that BVH cannot hold, or joints that are not in depth-first order.
    BadInput : ``unit_m`` outside (0, 1].
    """
    if not 0.0 < unit_m <= 1.0:
        raise BadInput(f"unit_m must be in (0, 1], got {unit_m}", where="unit_m")
    _write_whole(path, _text(clip, unit_m))


def _text(clip: Clip, unit_m: float) -> str:
    rotations = np.degrees(_to_zxy_angles(clip.rotations_wxyz)).reshape(clip.n_frames, -1)
    values = np.concatenate([clip.root_xyz_m / unit_m, rotations], axis=1)
    row = " ".join(["%.6f"] * values.shape[1])
    rows = "\n".join(row % tuple(frame) for frame in values.tolist())
    header = _hierarchy_text(clip.skeleton, unit_m)
    return f"HIERARCHY\n{header}MOTION\nFrames: {clip.n_frames}\nFrame Time: {1.0 / clip.fps:.10g}\n{rows}\n"


def _write_whole(path: Path, text: str) -> None:
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


def _hierarchy_text(skeleton: Skeleton, unit_m: float) -> str:
    """The HIERARCHY block. BVH nests joints, so the skeleton's own order must be depth-first."""
    lines: list[str] = []
    open_joints: list[int] = []
    for joint, parent in enumerate(skeleton.parents):
        while open_joints and open_joints[-1] != parent:
            open_joints.pop()
            lines.append("\t" * len(open_joints) + "}")
        if parent >= 0 and not open_joints:
            raise BadMotion(
                "joints must be in depth-first order to be written to BVH",
                where=f"joint {skeleton.names[joint]}",
                remedy="list each joint's children right after it",
            )
        lines += _joint_lines(skeleton, joint, unit_m, "\t" * len(open_joints))
        open_joints.append(joint)
    lines += ["\t" * depth + "}" for depth in reversed(range(len(open_joints)))]
    return "\n".join(lines) + "\n"


def _joint_lines(skeleton: Skeleton, joint: int, unit_m: float, indent: str) -> list[str]:
    """A joint up to where its children or its closing brace follow."""
    name = skeleton.names[joint]
    if not name or name != " ".join(name.split()) or any(character in name for character in "{}\0"):
        raise BadMotion(f"joint name {name!r} cannot be written to BVH", remedy="rename the joint")
    is_root = skeleton.parents[joint] < 0
    offset = "0 0 0" if is_root else " ".join(f"{value:.9g}" for value in skeleton.offsets_m[joint] / unit_m)
    channels = "6 Xposition Yposition Zposition" if is_root else "3"
    lines = [
        f"{'ROOT' if is_root else 'JOINT'} {name}",
        "{",
        f"\tOFFSET {offset}",
        f"\tCHANNELS {channels} Zrotation Xrotation Yrotation",
    ]
    if joint not in skeleton.parents:
        lines += ["\tEnd Site", "\t{", "\t\tOFFSET 0 0 0", "\t}"]
    return [indent + line for line in lines]
