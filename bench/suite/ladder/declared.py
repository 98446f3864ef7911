"""What every metric of the transfer track must make of every ladder, and the blind spots that this names."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum

from bench.suite.ladder.rungs import LADDERS


class Claim(StrEnum):
    """What is declared of one metric on one ladder."""

    UP = "up"
    DOWN = "down"
    IGNORE = "ignore"
    """must not see it, because the definition leaves it out on purpose"""
    BLIND = "blind"
    """should see that the motion got worse, and does not: a known blind spot"""
    OPEN = "open"
    """nothing is promised"""


@dataclass(frozen=True)
class BlindSpot:
    """Known blind cells that have one reason: all that are declared blind among ``metrics`` x ``ladders``."""

    title: str
    words: str
    metrics: tuple[str, ...]
    ladders: tuple[str, ...]


_LETTERS = {"u": Claim.UP, "d": Claim.DOWN, "=": Claim.IGNORE, "b": Claim.BLIND, ".": Claim.OPEN}

# Columns: noise jitter warp slide | mirror swap blend shuffle | frozen dropped look-up | yaw move resample
_ROWS: dict[str, str] = {
    "joint_recognition":        "d d . b  . d d d  d b b  = = =",
    "joint_recognition_ratio":  "d d . b  . d d d  d b b  = = =",
    "conditional_kid":          "u u . b  . u u u  u b b  = = =",
    "conditional_fmd":          "u u . b  . u u u  u b b  = = =",
    "copied_share":             ". . . =  . . . =  . . u  = = =",
    "cra":                      "d d . b  . d b d  b b b  = = =",
    "cra_balanced":             "d d . b  . d b d  b b b  = = =",
    "cra_top3":                 "d d . b  . d b d  b b b  = = =",
    "sra":                      "d d . b  . d d d  d b b  = = =",
    "sra_balanced":             "d d . b  . d d d  d b b  = = =",
    "sra_top3":                 "d d . b  . d d d  d b b  = = =",
    "source_style_residue":     ". . . =  . . u .  . . .  = = =",
    "fmd[stgcn-content]":       "u u . b  . u b b  u b b  = = =",
    "fmd[stgcn-style]":         "u u . b  . u b b  . b b  = = =",
    "fmd[dae]":                 "b b . b  . u b b  . b b  = = =",
    "kid[stgcn-content]":       "u u . b  . u b b  u b b  = = =",
    "kid[stgcn-style]":         "u u . b  . u b b  u b b  = = =",
    "density[stgcn-content]":   "d d . b  . d . b  d . .  = = =",
    "coverage[stgcn-content]":  "d d . b  . d b b  d . b  = = =",
    "density[stgcn-style]":     "d d . b  . d . b  d . .  = = =",
    "coverage[stgcn-style]":    "d d . b  . d b b  d . b  = = =",
    "diversity":                ". . . =  . . . =  . . .  = = =",
    "multimodality":            ". . . =  . . . u  . . .  = = =",
    "neighbour_ratio":          ". . . =  . . . =  . . d  = = =",
    "jerk_ratio":               "u u . =  = . . =  d u .  = = =",
    "jerk_ratio_worst_content": "u u . =  = . . .  d u .  = = =",
    "time_correlation":         "d = d =  d d d =  d d d  = = =",
    "bone_drift":               "= = = =  = = = =  = = =  = = =",
    "foot_skate":               "u u . u  = . . =  b . .  = = =",
    "skate[gmd]":               ". u . u  = . . =  b . .  = = =",
    "penetration":              ". u . =  = . . =  . . .  = = =",
    "float_height":             ". . . =  = . . =  . . .  = = =",
    "speed_ratio":              "u u . u  = . . =  d . .  = = =",
    "joint_range":              "u = b =  . u . =  b b .  = = =",
    "contact_precision":        "b b d d  d d d =  d . d  = = =",
    "contact_recall":           "d d d d  d d d =  . . d  = = =",
    "root_path_error":          "= u u u  u = u =  u u u  = = =",
    "paired_position":          "u u u u  u u u =  u u u  . = =",
    "paired_rotation":          "u = u =  u u u =  u u u  . = =",
    "paired_position_aligned":  "u u b u  u u u =  u u u  . = =",
    "paired_rotation_aligned":  "u . b .  u u u =  u u u  . = =",
}  # fmt: skip
"""Noise leaves ``penetration`` open: it lifts bent legs off the floor too. Drift and jitter leave
``paired_rotation_aligned`` open: it follows a path that positions chose."""

DECLARED: dict[str, Mapping[str, Claim]] = {
    metric: dict(zip(LADDERS, (_LETTERS[letter] for letter in row.split()), strict=True))
    for metric, row in _ROWS.items()
}
"""Metric -> ladder -> claim."""

_ROOT_BLIND = tuple(metric for metric, claims in DECLARED.items() if claims["foot slide"] == Claim.BLIND)
_RECOGNITION = ("joint_recognition", "joint_recognition_ratio", "cra", "cra_balanced", "cra_top3", "sra",
                "sra_balanced", "sra_top3")  # fmt: skip
_CONDITIONAL = ("conditional_kid", "conditional_fmd")
_SETS = ("fmd[stgcn-content]", "fmd[stgcn-style]", "fmd[dae]", "kid[stgcn-content]", "kid[stgcn-style]",
         "density[stgcn-content]", "density[stgcn-style]", "coverage[stgcn-content]",
         "coverage[stgcn-style]")  # fmt: skip

BLIND_SPOTS: tuple[BlindSpot, ...] = (
    BlindSpot(
        "FMD, KID, coverage and copies",
        "They ask whether the set of outputs looks like the set of real motions, not whether an output is what was "
        "asked for: other real motion under the wanted label, labels handed round at random and training motion looked "
        "up change nothing. Read joint recognition and conditional KID for the labels, copied share for the look-up.",
        _SETS,
        ("blend", "label shuffle", "look-up"),
    ),
    BlindSpot(
        "`fmd[dae]` and noise",
        "The auto-encoder was trained to remove noise and reads 24 frames of joint rotations: it sees neither a "
        "trembling root nor frames that were lost. A pose held still moves it on one dataset, not on the other. Read "
        "the jerk ratio.",
        ("fmd[dae]",),
        ("noise", "jitter", "dropped frames"),
    ),
    BlindSpot(
        "CRA and frozen frames, CRA and half-way transfers",
        "One pose is often enough to tell the content, and a blend of two motions of one content keeps it: CRA loses a "
        "third of its range where nothing moves any more. Joint recognition falls with it but keeps about half. Read "
        "the speed and jerk ratio for frozen motion, SRA and the source style residue for half a transfer.",
        ("cra", "cra_balanced", "cra_top3"),
        ("blend", "frozen frames"),
    ),
    BlindSpot(
        "All recognition and conditional distances, and look-up",
        "Training motion with the right labels is right in both. Read copied share.",
        (*_RECOGNITION, *_CONDITIONAL),
        ("look-up",),
    ),
    BlindSpot(
        "All judges and where the motion goes",
        "Judges read windows relative to the root, so a body that slides over the floor is as good as one that walks. "
        "Read foot skate, root path error and the speed ratio.",
        _ROOT_BLIND,
        ("foot slide",),
    ),
    BlindSpot(
        "All judges and dropped frames",
        "Motion that stutters is recognised as well as motion that does not. Read the jerk ratio.",
        tuple(metric for metric in (*_RECOGNITION, *_CONDITIONAL, *_SETS[:5]) if metric != "fmd[dae]"),
        ("dropped frames",),
    ),
    BlindSpot(
        "Foot skate and frozen frames",
        "What does not move does not slide: both are at their best. Read the speed ratio.",
        ("foot_skate", "skate[gmd]"),
        ("frozen frames",),
    ),
    BlindSpot(
        "`joint_range` and timing",
        "A pose is within range or not, whenever it is shown. Read the jerk and speed ratio.",
        ("joint_range",),
        ("time warp", "frozen frames", "dropped frames"),
    ),
    BlindSpot(
        "`contact_precision` and trembling",
        "A foot that trembles is hardly ever planted, so little of what is left is wrong, and where nothing is left it "
        "is undefined. Read `contact_recall`, which falls to 0.",
        ("contact_precision",),
        ("noise", "jitter"),
    ),
    BlindSpot(
        "Aligned errors and timing",
        "They forgive any timing by construction. Read `paired_position`.",
        ("paired_position_aligned", "paired_rotation_aligned"),
        ("time warp",),
    ),
)
"""Most important first."""
