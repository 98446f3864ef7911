"""The corpus of small BVH files, good and bad: ``python -m tests.golden.make_bvh`` writes it beside this script.

A good file comes with the joints and rows that its text was made from, so a test can compute where the joints must be
without reading the file. A bad one comes with the line and the words of its refusal.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

FOLDER = Path(__file__).with_name("bvh")
POSITIONS, ZXY = "Xposition Yposition Zposition", "Zrotation Xrotation Yrotation"


@dataclass(frozen=True)
class Joint:
    """A joint as it stands in a file; ``channels`` is None where the CHANNELS line is left out."""

    name: str
    parent: int
    offset: tuple[float, float, float]
    channels: str | None = ZXY


@dataclass(frozen=True)
class Good:
    content: bytes
    joints: tuple[Joint, ...]
    rows: tuple[tuple[float, ...], ...]


@dataclass(frozen=True)
class Bad:
    content: bytes
    line: int
    problem: str


def rows_for(joints: Sequence[Joint], n: int = 3) -> tuple[tuple[float, ...], ...]:
    """Values with two decimals that repeat nowhere: large turns, positions away from every OFFSET."""
    columns = sum(len((joint.channels or "").split()) for joint in joints)
    return tuple(
        tuple((((37 * f + 61 * c + 13) * 71 % 35999) - 18000) / 100.0 for c in range(columns)) for f in range(n)
    )


def text_of(
    joints: Sequence[Joint],
    rows: Sequence[Sequence[float]],
    *,
    indent: str = "\t",
    end_sites: bool = True,
    number: Callable[[float], str] = str,
    separator: str = " ",
    brace: str = "\n",
) -> str:
    """A BVH file with one token layout; joints are in depth-first order."""
    lines, depth = ["HIERARCHY"], 0
    open_joints: list[int] = []

    def close() -> None:
        lines.append(indent * (len(open_joints) - 1) + "}")
        open_joints.pop()

    for j, joint in enumerate(joints):
        while open_joints and open_joints[-1] != joint.parent:
            close()
        depth = len(open_joints)
        margin, inner = indent * depth, indent * (depth + 1)
        opening = f"\n{margin}{{" if brace == "\n" else " {"
        lines.append(f"{margin}{'ROOT' if joint.parent < 0 else 'JOINT'} {joint.name}{opening}")
        lines.append(f"{inner}OFFSET {' '.join(number(v) for v in joint.offset)}")
        if joint.channels is not None:
            lines.append(f"{inner}CHANNELS {len(joint.channels.split())} {joint.channels}".rstrip())
        open_joints.append(j)
        if end_sites and all(other.parent != j for other in joints):
            lines += [f"{inner}End Site", f"{inner}{{", f"{inner}{indent}OFFSET 0.0 1.0 0.0", f"{inner}}}"]
    while open_joints:
        close()
    block = [separator.join(number(value) for value in row) for row in rows]
    return "\n".join([*lines, "MOTION", f"Frames: {len(rows)}", "Frame Time: 0.0333333", *block, ""])


def leg(*channels: str | None, names: Sequence[str] = ("Hips", "Knee", "Foot", "Toe")) -> tuple[Joint, ...]:
    """A chain with the given channels, one joint each; offsets have no zero and no symmetry."""
    return tuple(
        Joint(names[k] if k < len(names) else f"Joint{k}", k - 1, (1.5 * k, -4.0 - k, 0.25 * k), spec)
        for k, spec in enumerate(channels)
    )


def plain(joints: Sequence[Joint], change: Callable[[str], str | bytes] = str, n: int = 3, **layout: object) -> Good:
    rows = rows_for(joints, n)
    changed = change(text_of(joints, rows, **layout))  # type: ignore[arg-type]
    return Good(changed if isinstance(changed, bytes) else changed.encode(), tuple(joints), rows)


def _bare_point(value: float) -> str:
    """``4.`` for 4.0 and ``.25`` for 0.25."""
    return re.sub(r"^(-?)0\.(\d)", r"\1.\2", f"{value:.2f}".rstrip("0"))


def _euler(order: str) -> str:
    return " ".join(f"{axis}rotation" for axis in order)


def _good() -> dict[str, Good]:
    root = f"{POSITIONS} {ZXY}"
    usual = leg(root, ZXY, ZXY)
    tree = (
        Joint("Hips", -1, (0.0, 0.0, 0.0), root),
        Joint("LeftLeg", 0, (1.0, -1.0, 0.5)),
        Joint("LeftFoot", 1, (0.0, -4.0, 0.0)),
        Joint("RightLeg", 0, (-1.0, -1.0, 0.5)),
        Joint("RightFoot", 3, (0.0, -4.0, 0.0)),
        Joint("Spine", 0, (0.0, 2.0, 0.0)),
    )
    keywords = ("MOTION", "Frames:", "OFFSET", "CHANNELS", "End", "ROOT", "JOINT", "HIERARCHY", "Xrotation")
    cases = {
        f"order_{order.lower()}": plain(leg(f"{POSITIONS} {_euler(order)}", _euler(order), _euler(order)))
        for order in ("XYZ", "XZY", "YXZ", "YZX", "ZXY", "ZYX")
    }
    cases |= {
        "mixed_orders": plain(leg(root, _euler("XYZ"), _euler("YZX"), _euler("ZYX"))),
        "six_channels_each": plain(leg(root, root, root, root)),
        "rotations_before_positions": plain(leg(f"{ZXY} {POSITIONS}", ZXY)),
        "channels_interleaved": plain(
            leg("Yrotation Zposition Xrotation Xposition Zrotation Yposition", "Xrotation Yposition Zrotation")
        ),
        "one_and_two_channels": plain(leg(root, "Xrotation", "Zrotation Yrotation", ZXY)),
        "positions_without_rotations": plain(leg(POSITIONS, POSITIONS, ZXY)),
        "some_positions": plain(leg(f"Yposition {ZXY}", f"Zposition Xposition {ZXY}")),
        "root_without_positions": plain(leg(ZXY, ZXY)),
        "no_channels": plain(leg(root, None, "", ZXY)),
        "moving_joint_above_hips": plain(leg(root, root, ZXY, names=("joint_Root", "Hips", "Knee"))),
        "root_offset": plain((Joint("Hips", -1, (3.0, 95.5, -7.0), root), Joint("Knee", 0, (0.0, -4.0, 0.0)))),
        "root_offset_without_positions": plain((Joint("Hips", -1, (3.0, 95.5, -7.0)), Joint("Knee", 0, (0, -4.0, 0)))),
        "tree": plain(tree),
        "one_joint": plain(leg(root)),
        "one_frame": plain(usual, n=1),
        "deep": plain(leg(root, *[ZXY] * 39)),
        "no_end_sites": plain(usual, end_sites=False),
        "crlf": plain(usual, lambda text: text.replace("\n", "\r\n")),
        "cr_only": plain(usual, lambda text: text.replace("\n", "\r")),
        "bom": plain(usual, lambda text: b"\xef\xbb\xbf" + text.encode()),
        "bom_crlf": plain(usual, lambda text: b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()),
        "no_last_newline": plain(usual, str.rstrip),
        "blank_last_lines": plain(usual, lambda text: text + "\n \n\t\n"),
        "blank_first_lines": plain(usual, lambda text: "\n \n" + text),
        "blank_lines_between": plain(usual, lambda text: text.replace("\n", "\n\n")),
        "scientific": plain(usual, number=lambda value: f"{value:.10e}"),
        "scientific_upper": plain(usual, number=lambda value: f"{value:+.10E}"),
        "many_digits": plain(usual, number=lambda value: f"{value:.30f}"),
        "bare_points": plain(usual, number=_bare_point),
        "tabs": plain(usual, separator="\t"),
        "wide_spaces": plain(usual, lambda text: text.replace(" ", "   ").replace("\n", "  \n"), indent="  "),
        "lower_case": plain(tuple(Joint(j.name.lower(), j.parent, j.offset, j.channels) for j in usual), str.lower),
        "upper_case": plain(tuple(Joint(j.name.upper(), j.parent, j.offset, j.channels) for j in usual), str.upper),
        "names_like_keywords": plain(leg(root, *[ZXY] * (len(keywords) - 1), names=keywords)),
        "names_with_spaces": plain(leg(root, ZXY, ZXY, names=("Bip01", "Bip01 L Thigh", "Bip01 L Calf"))),
        "names_in_utf8": plain(leg(root, ZXY, names=("Hüfte", "膝"))),
        "names_in_latin1": plain(leg(root, ZXY, names=("Hüfte", "Fuß")), lambda text: text.encode("latin-1")),
        "brace_on_joint_line": plain(usual, brace=" "),
        "hierarchy_on_one_line": plain(
            usual, lambda text: " ".join(text[: text.index("MOTION")].split()) + "\n" + text[text.index("MOTION") :]
        ),
    }  # fmt: skip
    return cases


BASE = text_of(leg(f"{POSITIONS} {ZXY}", ZXY), ((0.0,) * 9, (1.0,) * 9)).splitlines()
"""The file that bad ones are changes of. Lines: 1 HIERARCHY, 2 ROOT, 4 OFFSET, 5 CHANNELS, 6 JOINT, 8 OFFSET,
9 CHANNELS, 10 End Site, 12 OFFSET, 15 the last brace, 16 MOTION, 17 Frames, 18 Frame Time, 19 and 20 rows."""


def with_line(line: int, text: str) -> bytes:
    return "\n".join([*BASE[: line - 1], text, *BASE[line:], ""]).encode()


def without(first: int, last: int | None = None) -> bytes:
    return "\n".join([*BASE[: first - 1], *BASE[last or first :], ""]).encode()


def _bad() -> dict[str, Bad]:
    row = "0 1 2 3 4 5 6 7"
    base = "\n".join(BASE)
    return {
        "empty": Bad(b"", 1, "file is empty"),
        "white_space_only": Bad(b"\n\n  \n", 1, "file is empty"),
        "bom_only": Bad(b"\xef\xbb\xbf\n", 1, "file is empty"),
        "text": Bad(b"\nDear diary,\nno motion today.\n", 2, "expected HIERARCHY, got b'Dear diary"),
        "binary": Bad(bytes(range(256)) * 4, 1, "expected HIERARCHY"),
        "utf16": Bad(base.encode("utf-16"), 1, "UTF-16.*save the file as UTF-8"),
        "hierarchy_misspelt": Bad(with_line(1, "HIERARCHYS"), 1, "expected HIERARCHY, got 'HIERARCHYS'"),
        "no_root": Bad(without(2, 15), 2, "HIERARCHY has no ROOT"),
        "no_motion": Bad(without(16, 20), 15, "ends without a MOTION line"),
        "cut_in_a_joint": Bad("\n".join(BASE[:8]).encode(), 6, "brace of joint Knee is never closed.*cut off"),
        "cut_in_channels": Bad("\n".join([*BASE[:8], "CHANNELS 3 Zrotation"]).encode(), 9, "ends too early"),
        "unclosed_brace": Bad(without(15), 2, "brace of joint Hips is never closed"),
        "surplus_brace": Bad(with_line(15, "}\n}"), 16, "closing brace without an opening one"),
        "no_opening_brace": Bad(without(7), 7, "expected an opening brace, got 'OFFSET'"),
        "unknown_keyword": Bad(with_line(8, "SCALE 1 1 1"), 8, "expected JOINT, OFFSET.*got 'SCALE'"),
        "two_roots": Bad(with_line(15, "}\nROOT Other\n{"), 16, "a second ROOT Other.*export them separately"),
        "joint_outside_root": Bad(with_line(15, "}\nJOINT Other\n{"), 16, "joint Other stands outside the root"),
        "end_site_outside_root": Bad(with_line(15, "}\nEnd Site\n{\n}"), 16, "End Site stands outside a joint"),
        "offset_outside_root": Bad(with_line(1, "HIERARCHY OFFSET 0 0 0"), 1, "OFFSET stands outside a joint"),
        "joint_without_name": Bad(with_line(6, "JOINT"), 6, "JOINT without a name"),
        "name_twice": Bad(with_line(6, "JOINT Hips"), 6, "joint Hips appears twice"),
        "no_offset": Bad(without(8), 13, "joint Knee has no OFFSET"),
        "two_offsets": Bad(with_line(8, "OFFSET 0 0 0\nOFFSET 0 0 0"), 9, "joint Knee has two OFFSETs"),
        "offset_of_two_numbers": Bad(with_line(8, "OFFSET 0 0"), 8, "OFFSET needs three numbers, got 'CHANNELS'"),
        "offset_of_four_numbers": Bad(with_line(8, "OFFSET 0 0 0 7"), 8, "expected JOINT, OFFSET.*got '7'"),
        "offset_nan": Bad(with_line(8, "OFFSET 0 nan 0"), 8, "got 'nan'.*lost markers"),
        "offset_comma": Bad(with_line(8, "OFFSET 0,5 0 0"), 8, "got '0,5'.*decimal commas"),
        "offset_in_end_site": Bad(with_line(12, "OFFSET 0 x 0"), 12, "OFFSET needs three numbers, got 'x'"),
        "joint_in_end_site": Bad(with_line(12, "JOINT Toe"), 12, "expected OFFSET or a closing brace in End Site"),
        "unknown_channel": Bad(with_line(9, "CHANNELS 3 Zrotation Xrotation Wrotation"), 9, "unknown channel 'Wrot"),
        "fewer_channels_than_count": Bad(with_line(9, "CHANNELS 3 Zrotation"), 9, "unknown channel 'End'.*fewer"),
        "more_channels_than_count": Bad(with_line(9, f"CHANNELS 2 {ZXY}"), 9, "expected JOINT.*got 'Yrotation'"),
        "channel_twice": Bad(with_line(9, "CHANNELS 2 Zrotation zrotation"), 9, "joint Knee lists a channel twice"),
        "channel_count_12": Bad(with_line(9, "CHANNELS 12 Zrotation"), 9, "needs a count of 0 to 6, got '12'"),
        "channel_count_missing": Bad(with_line(9, f"CHANNELS {ZXY}"), 9, "needs a count of 0 to 6, got 'Zrotation'"),
        "two_channels_lines": Bad(with_line(9, f"CHANNELS 3 {ZXY}\n" * 2), 10, "joint Knee has two CHANNELS"),
        "no_channels_at_all": Bad(b"HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\n}\nMOTION\n", 6, "no joint has CHANNELS"),
        "nothing_after_motion": Bad(without(17, 20), 16, "no 'Frames:' line after MOTION.*cut off"),
        "no_frames": Bad(without(17), 17, "expected 'Frames: ...', got 'Frame Time"),
        "frames_zero": Bad(with_line(17, "Frames: 0"), 17, "positive whole number, got '0'"),
        "frames_negative": Bad(with_line(17, "Frames: -2"), 17, "positive whole number, got '-2'"),
        "frames_fraction": Bad(with_line(17, "Frames: 2.0"), 17, "positive whole number, got '2.0'"),
        "frames_empty": Bad(with_line(17, "Frames:"), 17, "positive whole number, got ''"),
        "frames_without_colon": Bad(with_line(17, "Frames 2"), 17, "expected 'Frames: ...', got 'Frames 2'"),
        "frames_absurd": Bad(with_line(17, "Frames: 999999999999"), 20, "promises 999999999999 frames .*has 2 rows"),
        "frames_too_long": Bad(with_line(17, f"Frames: {10**40}"), 17, "positive whole number"),
        "no_frame_time": Bad(without(18), 18, "expected 'Frame Time: ...', got '0.0 0.0"),
        "frame_time_missing_at_end": Bad(without(18, 20), 17, "no 'Frame Time:' line after MOTION"),
        "frame_time_zero": Bad(with_line(18, "Frame Time: 0"), 18, "Frame Time must be at least"),
        "frame_time_negative": Bad(with_line(18, "Frame Time: -0.03"), 18, "Frame Time must be at least"),
        "frame_time_tiny": Bad(with_line(18, "Frame Time: 1e-320"), 18, "Frame Time must be at least"),
        "frame_time_nan": Bad(with_line(18, "Frame Time: NaN"), 18, "Frame Time must be a number.*got 'NaN'"),
        "frame_time_word": Bad(with_line(18, "Frame Time: fast"), 18, "Frame Time must be a number.*got 'fast'"),
        "no_rows": Bad(without(19, 20), 18, "promises 2 frames of 9 values, the file has 0 rows"),
        "a_row_too_few": Bad(with_line(17, "Frames: 3"), 20, "promises 3 frames of 9 values, the file has 2 rows"),
        "a_row_too_many": Bad(with_line(17, "Frames: 1"), 20, "promises 1 frames of 9 values, the file has 2 rows"),
        "short_row": Bad(with_line(19, row), 19, "expected 9 values, got 8"),
        "short_last_row": Bad(with_line(20, row).rstrip(), 20, "expected 9 values, got 8"),
        "short_row_and_absurd_frames": Bad(
            with_line(17, "Frames: 99999").replace(b"0.0 0.0", b"0.0", 1), 19, "expected 9 values, got 8"
        ),
        "very_short_rows": Bad(with_line(19, "1").rstrip(), 19, "expected 9 values, got 1"),
        "long_row": Bad(with_line(19, f"{row} 8 9"), 19, "expected 9 values, got more than 9"),
        "nan": Bad(with_line(20, f"{row} nan"), 20, "expected a finite number, got 'nan'.*lost markers"),
        "inf": Bad(with_line(20, f"{row} -inf"), 20, "expected a finite number, got '-inf'"),
        "windows_nan": Bad(with_line(20, f"{row} 1.#QNAN"), 20, "got '1.#QNAN'.*lost markers"),
        "overflow": Bad(with_line(20, f"{row} 1e999"), 20, "expected a finite number, got '1e999'"),
        "comma": Bad(with_line(19, f"{row} 0,5"), 19, "got '0,5'.*decimal commas"),
        "underscore": Bad(with_line(19, f"{row} 1_000"), 19, "got '1_000'"),
        "hexadecimal": Bad(with_line(19, f"{row} 0x10"), 19, "got '0x10'"),
        "sign_only": Bad(with_line(19, f"{row} -"), 19, "got '-'"),
        "two_dots": Bad(with_line(19, f"{row} 1.2.3"), 19, "got '1.2.3'"),
        "word": Bad(with_line(19, f"{row} eight"), 19, "got 'eight'"),
        "zero_bytes": Bad(with_line(20, f"{row} " + "\0" * 8), 20, "expected a finite number"),
    }


GOOD = _good()
BAD = _bad()


def main() -> None:
    for kind, cases in (("good", GOOD), ("bad", BAD)):
        folder = FOLDER / kind
        folder.mkdir(parents=True, exist_ok=True)
        for name, case in cases.items():
            (folder / f"{name}.bvh").write_bytes(case.content)


if __name__ == "__main__":
    main()
