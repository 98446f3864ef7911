"""What every number is: the METRICS table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Better = Literal["higher", "lower", "one", "none"]


@dataclass(frozen=True)
class Metric:
    """A row of the METRICS table.

    Attributes
    ----------
    name : as in records and tables.
    version : raised whenever the definition changes; numbers of two versions never share a column.
    unit : ``%``, ``1`` for ratios and correlations, ``distance`` for Frechet and kernel distances, else an SI unit.
    better : the good direction; ``one`` is best at 1, ``none`` has no direction.
    summary : one line.
    source : paper and place, or this benchmark.
    misleads : when the number says something else than it seems to.
    docs : page under docs/metrics that gives the formula.
    """

    name: str
    version: int
    unit: str
    better: Better
    summary: str
    source: str
    misleads: str
    docs: str


OURS = "this benchmark"
PARK = "Park 2021, section 7"
PUZZLE = "Motion Puzzle 2022, section 7.2.2"
ERD = "Style-ERD 2022, section 4.2"
HEUSEL = "Heusel 2017, eq. 6"
KERNEL = "Binkowski 2018, section 4"

TRANSFER_METRICS: tuple[Metric, ...] = (
    Metric("joint_recognition", 1, "%", "higher", "content and style both judged right on the same sample", OURS,
           "retrieval wins it too; read it beside copied share", "recognition"),
    Metric("joint_recognition_ratio", 1, "1", "higher", "joint recognition over that of real disjoint motion", OURS,
           "can exceed 1 where outputs are more typical than real motion", "recognition"),
    Metric("conditional_kid", 1, "distance", "lower",
           "larger of (mean over styles, style features) and (mean over contents, content features) of KID", OURS,
           "cells with fewer than 20 real windows are left out", "kernel"),
    Metric("conditional_fmd", 1, "distance", "lower", "the same with Frechet distance in 16 principal components", OURS,
           "biased upwards for small n; compare with its floor", "frechet"),
    Metric("copied_share", 1, "%", "lower", "outputs nearer to given motion than 5 % of real takes are", OURS,
           "a copy with noise or a blend of two takes can stay above the threshold", "memorisation"),
    Metric("cra", 1, "%", "higher", "content recognition accuracy", PARK,
           "copies of the source and frozen frames score high", "recognition"),
    Metric("cra_balanced", 1, "%", "higher", "mean over contents of recall", OURS,
           "copies of the source score high", "recognition"),
    Metric("sra", 1, "%", "higher", "style recognition accuracy", PUZZLE,
           "copies of the style reference score high; style is partly the recording session", "recognition"),
    Metric("sra_balanced", 1, "%", "higher", "mean over target styles of recall", OURS,
           "copies of the style reference score high", "recognition"),
    Metric("source_style_residue", 1, "%", "lower", "outputs still judged to have the source's style", OURS,
           "low does not mean that the wanted style is there", "recognition"),
    Metric("fmd[stgcn-content]", 1, "distance", "lower", "Frechet distance in content-judge features", HEUSEL,
           "copies of the input beat real motion; never rank by it", "frechet"),
    Metric("fmd[stgcn-style]", 1, "distance", "lower", "Frechet distance in style-judge features", HEUSEL,
           "copies of the input beat real motion; never rank by it", "frechet"),
    Metric("fmd[dae]", 1, "distance", "lower", "Frechet distance in 32 components of auto-encoder features", ERD,
           "blind to noise, which the auto-encoder was trained to ignore", "frechet"),
    Metric("kid[stgcn-content]", 1, "distance", "lower", "kernel distance in content-judge features", KERNEL,
           "copies of the input score like real motion", "kernel"),
    Metric("kid[stgcn-style]", 1, "distance", "lower", "kernel distance in style-judge features", KERNEL,
           "copies of the input score like real motion", "kernel"),
    Metric("jerk_ratio", 1, "1", "one", "mean jerk over that of real motion of the same contents", OURS,
           "an overall 1 can hide trembling gestures and damped walks", "physics"),
    Metric("jerk_ratio_worst_content", 1, "1", "one", "the content whose jerk ratio is farthest from 1", OURS,
           "one content with little motion can dominate", "physics"),
    Metric("time_correlation", 1, "1", "none", "correlation over time of source and output joint positions", OURS,
           "real motion of the right labels is near 0: a source-fidelity number, not a quality", "physics"),
    Metric("bone_drift", 1, "%", "lower", "departure of bone lengths from the source's", OURS,
           "0 by construction for outputs given as rotations", "physics"),
)  # fmt: skip
