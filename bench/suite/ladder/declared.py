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
    "joint_recognition":        "d b . b  . d d d  d . b  = = =",
    "joint_recognition_ratio":  "d b . b  . d d d  d . b  = = =",
    "conditional_kid":          "u . . b  . u u u  u . b  = = =",
    "conditional_fmd":          "u . . b  . u u u  u . b  = = =",
    "copied_share":             ". . . =  . . . =  . . u  = = =",
    "cra":                      "d b . b  . d b d  b b b  = = =",
    "cra_balanced":             "d b . b  . d b d  b b b  = = =",
    "cra_top3":                 "d b . b  . d b d  b b b  = = =",
    "sra":                      "d b . b  . d d d  d . b  = = =",
    "sra_balanced":             "d b . b  . d d d  d . b  = = =",
    "sra_top3":                 "d b . b  . d d d  d . b  = = =",
    "source_style_residue":     ". . . =  . . u .  . . .  = = =",
    "fmd[stgcn-content]":       "u . . b  . u b b  u . b  = = =",
    "fmd[stgcn-style]":         "u . . b  . u b b  u . b  = = =",
    "fmd[dae]":                 "b b . b  . u b b  u b b  = = =",
    "kid[stgcn-content]":       "u . . b  . u b b  u . b  = = =",
    "kid[stgcn-style]":         "u . . b  . u b b  u . b  = = =",
    "density[stgcn-content]":   "d . . b  . d . b  . . .  = = =",
    "coverage[stgcn-content]":  "d . . b  . d b b  d . b  = = =",
    "density[stgcn-style]":     "d . . b  . d . b  . . .  = = =",
    "coverage[stgcn-style]":    "d . . b  . d b b  d . b  = = =",
    "diversity":                ". . . =  . . . =  . . .  = = =",
    "multimodality":            ". . . =  . . . u  . . .  = = =",
    "neighbour_ratio":          ". . . =  . . . =  . . d  = = =",
    "jerk_ratio":               "u u . =  = . . =  d u .  = = =",
    "jerk_ratio_worst_content": "u u . =  = . . .  d u .  = = =",
    "time_correlation":         "d = d =  d d d =  d d d  = = =",
    "bone_drift":               "= = = =  = = = =  = = =  = = =",
    "foot_skate":               "u u . u  = . . =  b . .  = = =",
    "skate[gmd]":               ". . . u  = . . =  b . .  = = =",
    "penetration":              "u u . =  = . . =  . . .  = = =",
    "float_height":             ". . . =  = . . =  . . .  = = =",
    "speed_ratio":              "u u . .  = . . =  d . .  = = =",
    "joint_range":              "u = b =  . u . =  b b .  = = =",
    "contact_precision":        "d d d d  d d d =  . . d  = = =",
    "contact_recall":           "d d d d  d d d =  . . d  = = =",
    "root_path_error":          "= u u u  u = u =  u u u  = = =",
    "paired_position":          "u u u u  u u u =  u u u  . = =",
    "paired_rotation":          "u = u =  u u u =  u u u  . = =",
    "paired_position_aligned":  "u u b u  u u u =  u u u  . = =",
    "paired_rotation_aligned":  "u = b =  u u u =  u u u  . = =",
}  # fmt: skip

DECLARED: dict[str, Mapping[str, Claim]] = {
    metric: dict(zip(LADDERS, (_LETTERS[letter] for letter in row.split()), strict=True))
    for metric, row in _ROWS.items()
}
"""Metric -> ladder -> claim."""

BLIND_SPOTS: tuple[BlindSpot, ...] = ()
