"""What an answer must be before anything is measured: frames, fps, skeleton, bones, units, no jumps of the root."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.errors import BadOutput
from bench.motion.clip import Clip

ROOT_SPEED_LIMIT_M_S = 20.0
"""Twice what the fastest humans run; a root may also be as fast as twice its source's fastest frame."""
HEIGHT_RATIO_LIMITS = (0.2, 5.0)
"""Root height of an answer over that of its source: beyond, another unit is more likely than another motion."""
UNITS = {100.0: "centimetres", 1000.0: "millimetres", 39.37: "inches", 0.01: "metres divided by 100"}


@dataclass(frozen=True)
class CheckRow:
    """One line of a conformance table; ``ok`` is None where the check does not apply."""

    name: str
    ok: bool | None
    expected: str = ""
    got: str = ""
    cause: str = ""
    remedy: str = ""


def check_answer(
    answer: object, source: Clip, *, n_frames: int | None = None, own_bones: bool = False
) -> list[CheckRow]:
    """All properties of one answer, in the order in which they should be read; stops where nothing more can be said.

    ``n_frames`` is the expected length, the source's by default. With ``own_bones`` the answer shows a body of its own:
    what only holds for one body, bones, units and the root's path, is not compared with the source.
    """
    if not isinstance(answer, Clip):
        got = f"{type(answer).__module__}.{type(answer).__qualname__}"
        remedy = "return content.clip.with_motion(rotations_wxyz, root_xyz_m)"
        return [CheckRow("type", False, "a bench.motion.clip.Clip", got, remedy=remedy)]
    wanted = source.n_frames if n_frames is None else n_frames
    rows = [
        CheckRow("type", True, "a bench.motion.clip.Clip", "a Clip"),
        CheckRow(
            "frames",
            answer.n_frames == wanted,
            f"{wanted} frames",
            f"{answer.n_frames} frames",
            "padding, or a length that is a multiple of the network's stride",
            "cut or resample the answer to the content's length",
        ),
        CheckRow(
            "fps",
            abs(answer.fps - source.fps) <= 1e-6,
            f"{source.fps:g} fps",
            f"{answer.fps:g} fps",
            "the method works at another rate",
            "resample to content.clip.fps (bench.motion.edit.resample)",
        ),
        _skeleton_row(answer, source),
    ]
    if own_bones:
        return rows
    if rows[-1].ok:
        rows.append(_bones_row(answer, source))
    return [*rows, _units_row(answer, source), _teleport_row(answer, source)]


def checked_answer(
    answer: object, source: Clip, where: str, *, n_frames: int | None = None, own_bones: bool = False
) -> Clip:
    """An answer that may be scored, by :func:`check_answer`.

    Raises
    ------
    BadOutput : the first property that does not hold; ``where`` names the sample.
    """
    for row in check_answer(answer, source, n_frames=n_frames, own_bones=own_bones):
        if row.ok is False:
            problem = f"{row.name}: expected {row.expected}, got {row.got}"
            raise BadOutput(problem, where=where, cause=row.cause, remedy=row.remedy)
    if not isinstance(answer, Clip):  # unreachable: the first row says it; here for type checkers
        raise BadOutput("expected a Clip", where=where)
    return answer


def _skeleton_row(answer: Clip, source: Clip) -> CheckRow:
    same = answer.skeleton.names == source.skeleton.names and answer.skeleton.parents == source.skeleton.parents
    return CheckRow(
        "skeleton",
        same,
        f"the content's {source.skeleton.n_joints} joints in their order",
        f"{answer.skeleton.n_joints} joints, {answer.skeleton.names[0]} first" if not same else "the same joints",
        "the method's own joint set or order was returned",
        "map back by joint name before returning",
    )


def _bones_row(answer: Clip, source: Clip) -> CheckRow:
    expected = "the content's bones to 0.1 mm"
    if answer.skeleton is source.skeleton:
        return CheckRow("bone lengths", True, expected, "the same")
    off = np.linalg.norm(answer.skeleton.offsets_m - source.skeleton.offsets_m, axis=1)
    joint = int(off.argmax())
    lengths, wanted = answer.skeleton.bone_lengths_m[joint], source.skeleton.bone_lengths_m[joint]
    return CheckRow(
        "bone lengths",
        answer.skeleton.same_bones(source.skeleton),
        expected,
        f"{answer.skeleton.names[joint]} off by {off[joint] * 1000:.1f} mm (length {lengths:.4f} m for {wanted:.4f} m)",
        "the style reference's skeleton or a mean skeleton was returned",
        "answer with content.clip.with_motion(...) or bench.motion.pose.onto_skeleton(...)",
    )


def _units_row(answer: Clip, source: Clip) -> CheckRow:
    wanted, got = (float(np.abs(clip.root_xyz_m[:, 1]).mean()) for clip in (source, answer))
    expected, shown = f"a root near the source's height of {wanted:.2f} m", f"{got:.4g}"
    ratio = got / max(wanted, 1e-9)
    low, high = HEIGHT_RATIO_LIMITS
    # A root that hardly leaves height 0 says nothing about units.
    if low <= ratio <= high or wanted < 0.05 * source.skeleton.stature_m:
        return CheckRow("units", True, expected, shown)
    nearest = min(UNITS, key=lambda unit: abs(np.log(max(ratio, 1e-9) / unit)))
    close = abs(np.log(max(ratio, 1e-9) / nearest)) < 0.7
    return CheckRow(
        "units",
        False,
        expected,
        shown,
        f"{UNITS[nearest]} instead of metres" if close else "a root path that is relative or not de-normalised",
        "convert root_xyz_m to metres, Y up, floor at 0",
    )


def _teleport_row(answer: Clip, source: Clip) -> CheckRow:
    own, limit = _root_speed(answer), max(ROOT_SPEED_LIMIT_M_S, 2.0 * _root_speed(source).max(initial=0.0))
    frame = int(own.argmax()) if len(own) else 0
    fastest = float(own.max(initial=0.0))
    return CheckRow(
        "root path",
        fastest <= limit,
        f"a root slower than {limit:.0f} m/s",
        f"{fastest:.1f} m/s at frame {frame}",
        "windows joined without carrying the root over, or velocities integrated at another fps",
        "make root_xyz_m one continuous path in metres",
    )


def _root_speed(clip: Clip) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    speed: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
    speed = np.linalg.norm(np.diff(clip.root_xyz_m, axis=0), axis=1) * clip.fps
    return speed
