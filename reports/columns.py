"""Which numbers a table shows: a list of columns for each track, condition or paper table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Part = Literal["main", "details"]


@dataclass(frozen=True)
class ColumnChoice:
    """A column wanted; the first of ``slices`` that the records have is shown."""

    metric: str
    title: str
    part: Part = "main"
    slices: tuple[str, ...] = ("different_content", "all")
    interval: bool = False


def columns_of(track: str, protocol: str, condition: str) -> tuple[ColumnChoice, ...]:
    """The columns of a table: its paper's or condition's own, else its track's; empty where none were chosen."""
    return COLUMNS.get(f"{protocol}/{condition}") or COLUMNS.get(f"{track}/{condition}") or COLUMNS.get(track, ())


_SAME = ("same_content",)
_ALL = ("all", "different_content")
_TRANSFER = (
    ColumnChoice("joint_recognition", "joint recognition", interval=True),
    ColumnChoice("joint_recognition_ratio", "of real"),
    ColumnChoice("conditional_kid", "conditional KID", interval=True),
    ColumnChoice("copied_share", "copied share", slices=_ALL),
    ColumnChoice("cra", "CRA"),
    ColumnChoice("sra", "SRA"),
    ColumnChoice("jerk_ratio", "jerk ratio", slices=_ALL),
    ColumnChoice("foot_skate", "foot skate", slices=_ALL),
    ColumnChoice("joint_recognition", "joint recognition, same content", "details", _SAME, interval=True),
    ColumnChoice("cra_balanced", "CRA balanced", "details"),
    ColumnChoice("sra_balanced", "SRA balanced", "details"),
    ColumnChoice("cra_top3", "CRA top 3", "details"),
    ColumnChoice("sra_top3", "SRA top 3", "details"),
    ColumnChoice("source_style_residue", "source style left", "details"),
    ColumnChoice("conditional_fmd", "conditional FMD", "details"),
    ColumnChoice("fmd[stgcn-content]", "FMD content", "details", _ALL),
    ColumnChoice("fmd[stgcn-style]", "FMD style", "details", _ALL),
    ColumnChoice("fmd[dae]", "FMD dae", "details", _ALL),
    ColumnChoice("kid[stgcn-content]", "KID content", "details", _ALL),
    ColumnChoice("kid[stgcn-style]", "KID style", "details", _ALL),
    ColumnChoice("jerk_ratio_worst_content", "jerk ratio, worst content", "details", _ALL),
    ColumnChoice("time_correlation", "time correlation", "details", _ALL),
    ColumnChoice("bone_drift", "bone drift", "details", _ALL),
    ColumnChoice("speed_ratio", "speed ratio", "details", _ALL),
    ColumnChoice("skate[gmd]", "skate gmd", "details", _ALL),
    ColumnChoice("penetration", "penetration", "details", _ALL),
    ColumnChoice("float_height", "float", "details", _ALL),
    ColumnChoice("joint_range", "out of joint range", "details", _ALL),
    ColumnChoice("contact_precision", "contact precision", "details", _ALL),
    ColumnChoice("contact_recall", "contact recall", "details", _ALL),
    ColumnChoice("root_path_error", "root path error", "details", _ALL),
    ColumnChoice("density[stgcn-content]", "density content", "details", _ALL),
    ColumnChoice("density[stgcn-style]", "density style", "details", _ALL),
    ColumnChoice("coverage[stgcn-content]", "coverage content", "details", _ALL),
    ColumnChoice("coverage[stgcn-style]", "coverage style", "details", _ALL),
    ColumnChoice("diversity", "diversity", "details", _ALL),
    ColumnChoice("multimodality", "multimodality", "details", _ALL),
    ColumnChoice("neighbour_ratio", "neighbours, fit to test", "details", _ALL),
    ColumnChoice("paired_position", "to the true answer", "details"),
    ColumnChoice("paired_position_aligned", "to the true answer, aligned", "details"),
    ColumnChoice("paired_rotation", "angle to the true answer", "details"),
    ColumnChoice("paired_rotation_aligned", "angle to the true answer, aligned", "details"),
)
_RECOGNITION = (
    ColumnChoice("joint_recognition", "joint recognition", interval=True),
    ColumnChoice("cra", "CRA"),
    ColumnChoice("sra", "SRA"),
)


def _hands(slices: tuple[str, ...], kind: str, first: bool = False) -> tuple[ColumnChoice, ...]:
    """Mean, worst and worst quarter of an error of the hands, ``content`` or ``style``."""
    return (
        ColumnChoice(f"{kind}_error", f"{kind} error", slices=slices, interval=first),
        ColumnChoice(f"{kind}_error_worst", f"{kind}, worst", slices=slices),
        ColumnChoice(f"{kind}_error_worst_quarter", f"{kind}, worst 25 %", slices=slices),
    )


def _more_hands(slices: tuple[str, ...]) -> tuple[ColumnChoice, ...]:
    titles = {
        "style_error[1.07s]": "style error, 1.07 s",
        "style_error[4.27s]": "style error, 4.27 s",
        "content_error[world]": "content error, world frame",
        "style_error[world]": "style error, world frame",
        "content_error[fastdtw]": "content error, FastDTW",
    }
    return tuple(ColumnChoice(metric, title, "details", slices) for metric, title in titles.items())


_GESTURE = (
    ColumnChoice("gesture_error", "content + style", slices=("intra",), interval=True),
    ColumnChoice("gesture_error[truth]", "to the true answer", slices=("intra",)),
    *_hands(("intra",), "content"),
    *_hands(("intra",), "style"),
    ColumnChoice("gesture_error", "content + style, other scenario", "details", ("inter",)),
    ColumnChoice("foot_skate", "foot skate", "details", ("all",)),
    ColumnChoice("penetration", "penetration", "details", ("all",)),
    ColumnChoice("joint_range", "out of joint range", "details", ("all",)),
    *_more_hands(("intra",)),
)


def _kuriyama(slices: tuple[str, ...]) -> tuple[ColumnChoice, ...]:
    return (*_hands(slices, "style", first=True), *_hands(slices, "content"), *_more_hands(slices))


_PARK = (
    ColumnChoice("fmd[stgcn]", "FMD", slices=("all",)),
    ColumnChoice("cra", "CRA", slices=("all",)),
    ColumnChoice("cra_balanced", "CRA balanced", slices=("all",)),
)
_ERD = (
    ColumnChoice("fmd[dae-512]", "FMD dae-512, centre", slices=("all",)),
    ColumnChoice("fmd[dae-512-first]", "first 24 frames", slices=("all",)),
    ColumnChoice("fmd[dae-512-every]", "every 24 frames", slices=("all",)),
)
_LEAKS = tuple(
    ColumnChoice(
        "leak_ratio", f"leak, {part}" if part != "all" else "leak ratio", slices=(name,), interval=part == "all"
    )
    for part, name in (("all", "all"), ("legs", "part=legs"), ("arms", "part=arms"), ("spine", "part=spine"))
)
_MOVES = tuple(
    ColumnChoice(metric, f"{title}, {part}", "details", (f"part={part}",))
    for metric, title in (
        ("locality_msd", "MSD of the part"),
        ("joints_above_0.1", "joints over 0.1"),
        ("joints_above_0.05", "joints over 0.05"),
    )
    for part in ("legs", "arms", "spine", "all")
)
COLUMNS: dict[str, tuple[ColumnChoice, ...]] = {
    "transfer": _TRANSFER,
    "latent": _TRANSFER,
    "transfer/self": (
        ColumnChoice("reconstruction_position", "distance from the source", interval=True, slices=("all",)),
        ColumnChoice("reconstruction_rotation", "angle from the source", slices=("all",)),
        ColumnChoice("joint_recognition", "joint recognition", slices=("all",)),
        ColumnChoice("cra", "CRA", slices=("all",)),
        ColumnChoice("sra", "SRA", slices=("all",)),
        ColumnChoice("jerk_ratio", "jerk ratio", slices=("all",)),
        ColumnChoice("time_correlation", "time correlation", slices=("all",)),
    ),
    "transfer/long": (
        *_RECOGNITION,
        ColumnChoice("joint_recognition", "in 1000 frames", slices=("frames=1000",)),
        ColumnChoice("joint_recognition", "in 3600 frames", slices=("frames=3600",)),
        ColumnChoice("join_jerk_ratio", "jerk at joins", slices=("all",)),
    ),
    "transfer/short": tuple(
        ColumnChoice("prefix_error", f"{n} frames", slices=(f"frames={n}",), interval=n == 32) for n in (32, 16, 10)
    ),
    "transfer/foreign": (
        *_RECOGNITION,
        ColumnChoice("jerk_ratio", "jerk ratio", slices=_ALL),
        ColumnChoice("bone_drift", "bone drift", slices=_ALL),
    ),
    "parts": (*_LEAKS, ColumnChoice("leak_ratio[position]", "leak of positions", slices=("all",)), *_MOVES),
    "gesture": _GESTURE,
    "kuriyama2022/table1": _kuriyama(("intra",)),
    "kuriyama2022/table2": _kuriyama(("intra",)),
    "kuriyama2022/table3": _kuriyama(("inter",)),
    "kuriyama2022/table4": _kuriyama(("all",)),
    "interpolation": (
        ColumnChoice("monotonicity", "monotonicity", slices=("all",), interval=True),
        ColumnChoice("evenness", "evenness", slices=("all",)),
        ColumnChoice("end_recognition", "ends right", slices=("all",)),
        ColumnChoice("middle_content", "content in the middle", slices=("all",)),
    ),
    "prediction": (
        ColumnChoice("next_frame_error", "next-frame error", slices=("all",), interval=True),
        ColumnChoice("bone_length_loss", "bone length loss", slices=("all",)),
    ),
    "runtime": (
        ColumnChoice("latency_p50", "online, p50", slices=("online",)),
        ColumnChoice("latency_p99", "online, p99", slices=("online",)),
        ColumnChoice("deadline_miss", "misses 60 fps", slices=("online 60 fps",)),
        *(ColumnChoice("latency_p50", f"L = {n}, p50", slices=(f"offline L={n}",)) for n in (60, 90, 120)),
        ColumnChoice("startup_designed", "designed input", slices=("all",)),
        ColumnChoice("startup_measured", "measured start", slices=("all",)),
        ColumnChoice("parameters", "parameters", "details", ("all",)),
        ColumnChoice("bytes_per_style", "per style", "details", ("all",)),
        ColumnChoice("latency_p90", "online, p90", "details", ("online",)),
        ColumnChoice("latency_max", "online, max", "details", ("online",)),
        ColumnChoice("real_time_factor", "real-time factor, online", "details", ("online",)),
        *(ColumnChoice("deadline_miss", f"misses {n} fps", "details", (f"online {n} fps",)) for n in (30, 120)),
        *(
            ColumnChoice("frames_per_second", f"frames per second, L = {n}", "details", (f"offline L={n}",))
            for n in (60, 90, 120)
        ),
        ColumnChoice("first_call", "first call", "details", ("all",)),
        ColumnChoice("load_time", "load", "details", ("all",)),
        ColumnChoice("peak_memory", "peak memory", "details", ("all",)),
    ),
    **{f"park2021/{name}": _PARK for name in ("table1", "table1-cls", "table2", "table2-cls", "table2-neutral")},
    "motion_puzzle/table2": (
        ColumnChoice("fmd[stgcn]", "FMD", slices=("all",)),
        ColumnChoice("cra", "CRA", slices=("all",)),
        ColumnChoice("sra", "SRA", slices=("all",)),
        ColumnChoice("cra_balanced", "CRA balanced", slices=("all",)),
        ColumnChoice("sra_balanced", "SRA balanced", slices=("all",)),
    ),
    "mason2022/rollout": (
        ColumnChoice("sra", "SRA", slices=("all",), interval=True),
        ColumnChoice("cra", "CRA", slices=("all",)),
        ColumnChoice("path_drift", "drift", slices=("all",)),
        ColumnChoice("foot_skate", "foot skate", slices=("all",)),
        ColumnChoice("jerk_ratio", "jerk ratio", slices=("all",)),
    ),
    "style_erd/table1": _ERD,
    "style_erd/table1-neutral": _ERD,
}
"""``protocol/condition``, ``track/condition`` or ``track`` -> columns, the primary first."""
