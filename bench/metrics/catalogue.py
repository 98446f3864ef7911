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
    unit : ``%``, ``1`` for ratios and correlations, ``distance`` for distances of features, else an SI unit.
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
LOCALITY = "Motion Puzzle 2022, section 7.1, Table 1"
HANDS = "Kuriyama 2022, section 4.2, eq. 13-16"
ERD_TIME = "Style-ERD 2022, section 4.3, Table 2"
MASON = "Mason 2022, section 4.3, eq. 5"
MASON_TIME = "Mason 2022, Table 2"
GMD = "GMD: Karunratanakul 2023, foot skating ratio, thresholds of the released code"
NAEEM = "Naeem 2020, density and coverage, k = 5"
GUO = "Guo 2020 (Action2Motion), all pairs instead of random ones"
STURM = "Sturm 2012, absolute trajectory error"
MEEHAN = "this benchmark, after Meehan 2020"

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

PHYSICS_METRICS: tuple[Metric, ...] = (
    Metric("foot_skate", 1, "cm/s", "lower", "horizontal speed of the foot that stands, on an estimated floor", OURS,
           "a foot dragged past a standing one is no skating; a frozen frame has none", "physics"),
    Metric("skate[gmd]", 1, "%", "lower", "frames in which a toe under 5 cm moves faster than 0.5 m/s", GMD,
           "feet that swing low count: real walking has 30 %; a raised floor hides any sliding", "physics"),
    Metric("penetration", 1, "cm", "lower", "depth of the lowest foot under the floor, mean over frames", OURS,
           "0 for a motion that hovers", "physics"),
    Metric("float_height", 1, "cm", "lower", "height of the lowest foot over the floor, mean over frames", OURS,
           "runs and jumps float: compare with real motion of the content", "physics"),
    Metric("speed_ratio", 1, "1", "one", "mean joint speed over that of real motion of the same contents", OURS,
           "styles differ in speed", "physics"),
    Metric("joint_range", 1, "%", "lower", "joint angles outside the range that the fit part has", OURS,
           "a right angle at a wrong time or beside a wrong one is within; the mean pose is perfect", "physics"),
    Metric("contact_precision", 1, "%", "higher", "planted frames of the output in which the source's foot stands too",
           OURS, "a copy of the source is perfect; styles have a timing of their own", "physics"),
    Metric("contact_recall", 1, "%", "higher", "planted frames of the source in which the output's foot stands too",
           OURS, "feet that never leave the floor are perfect", "physics"),
    Metric("root_path_error", 1, "cm", "lower", "distance of the root's way over the floor from the source's, aligned",
           STURM, "a copy of the source is perfect; a style may take longer steps", "physics"),
)  # fmt: skip

DIVERSITY_METRICS: tuple[Metric, ...] = (
    Metric("density[stgcn-content]", 1, "1", "one", "real balls that hold an output, over k, content features", NAEEM,
           "above 1 where outputs crowd where real motion is dense: mean poses can", "diversity"),
    Metric("density[stgcn-style]", 1, "1", "one", "real balls that hold an output, over k, style features", NAEEM,
           "above 1 where outputs crowd where real motion is dense", "diversity"),
    Metric("coverage[stgcn-content]", 1, "%", "higher", "real windows whose ball holds an output, content features",
           NAEEM, "grows with n: compare with its floor; copies of the source cover well", "diversity"),
    Metric("coverage[stgcn-style]", 1, "%", "higher", "real windows whose ball holds an output, style features", NAEEM,
           "grows with n: compare with its floor; copies cover well", "diversity"),
    Metric("diversity", 1, "distance", "none", "distance between two outputs in content features", GUO,
           "noise is diverse too: compare with that of real motion", "diversity"),
    Metric("multimodality", 1, "distance", "none", "distance between two outputs for one content in content features",
           GUO, "sources differ, so a copy of the source is as diverse as real motion", "diversity"),
    Metric("neighbour_ratio", 1, "1", "one", "median nearest distance to the fit part over that to the test part",
           MEEHAN, "source and style reference are left out: copying those shows in copied share only", "memorisation"),
)  # fmt: skip

PAPER_METRICS: tuple[Metric, ...] = (
    Metric("cra_top3", 1, "%", "higher", "the source's content is among the judge's three likeliest", OURS,
           "near 100 where there are few contents", "recognition"),
    Metric("sra_top3", 1, "%", "higher", "the wanted style is among the judge's three likeliest", OURS,
           "near 100 where there are few styles", "recognition"),
    Metric("fmd[stgcn]", 1, "distance", "lower", "Frechet distance in content-judge features, mean over trials", PARK,
           "copies of the input beat real motion; comparable with no paper's numbers, whose evaluators are unpublished",
           "frechet"),
    Metric("fmd[dae-512]", 1, "distance", "lower",
           "Frechet distance in all 512 auto-encoder features of the centre 24 frames, mean over trials", ERD,
           "blind to noise; mostly bias below some thousand samples", "frechet"),
    Metric("fmd[dae-512-first]", 1, "distance", "lower", "the same on the first 24 frames of each sample", ERD,
           "sees nothing of what a method does after its first frames", "frechet"),
    Metric("fmd[dae-512-every]", 1, "distance", "lower", "the same on every 24 frames of each sample", ERD,
           "more windows than samples: they are not independent", "frechet"),
)  # fmt: skip

CONDITION_METRICS: tuple[Metric, ...] = (
    Metric("reconstruction_position", 1, "cm", "lower", "joint distance between output and source, content = style",
           OURS, "a copy of the source is perfect", "paired"),
    Metric("reconstruction_rotation", 1, "deg", "lower", "angle between joint rotations of output and source", OURS,
           "a copy of the source is perfect", "paired"),
    Metric("join_jerk_ratio", 1, "1", "one", "output over source of jerk at joins divided by jerk elsewhere", OURS,
           "trembling everywhere hides jumps at joins", "physics"),
    Metric("path_drift", 1, "cm", "lower", "ground distance of output and source at the end of a stretch", OURS,
           "a body that only slides along its source's path does not drift", "physics"),
    Metric("prefix_error", 1, "cm", "lower", "joint distance of the answer to a prefix from the full answer", OURS,
           "a method that ignores its input is perfect", "paired"),
    Metric("paired_position", 1, "cm", "lower", "joint distance to the true answer, frame by frame", OURS,
           "punishes right poses at other times", "paired"),
    Metric("paired_rotation", 1, "deg", "lower", "angle to the true answer's joint rotations, frame by frame", OURS,
           "punishes right poses at other times", "paired"),
    Metric("paired_position_aligned", 1, "cm", "lower", "joint distance to the true answer along the DTW path", OURS,
           "forgives any timing, a wrong rhythm too", "paired"),
    Metric("paired_rotation_aligned", 1, "deg", "lower", "angle to the true answer along the DTW path", OURS,
           "forgives any timing, a wrong rhythm too", "paired"),
)  # fmt: skip

PARTS_METRICS: tuple[Metric, ...] = (
    Metric("locality_msd", 1, "stature^2", "none", "mean squared displacement of the joints, in statures", LOCALITY,
           "arms move when the spine turns below them: positions are not independent of the part", "locality"),
    Metric("locality_distance", 1, "stature", "none", "mean distance of the joints, in statures", LOCALITY,
           "arms move when the spine turns below them", "locality"),
    Metric("joints_above_0.1", 1, "joints", "none", "joints whose mean squared displacement is over 0.1", LOCALITY,
           "a transfer that hardly moves anything has short lists", "locality"),
    Metric("joints_above_0.05", 1, "joints", "none", "joints whose mean squared displacement is over 0.05", LOCALITY,
           "a transfer that hardly moves anything has short lists", "locality"),
    Metric("leak_ratio", 1, "1", "lower", "rotation change of untouched over touched joints", OURS,
           "0 for a method that changes nothing outside the part, whatever it does inside", "locality"),
    Metric("leak_ratio[position]", 1, "1", "lower", "displacement of untouched over touched joints", OURS,
           "not 0 where a perfectly local spine carries the arms along", "locality"),
)  # fmt: skip

GESTURE_METRICS: tuple[Metric, ...] = (
    Metric("gesture_error", 1, "m", "lower", "content error + style error, means", OURS,
           "in the intra condition the style reference is itself a right answer", "gesture"),
    Metric("gesture_error[truth]", 1, "m", "lower", "content error + style error against the true answer", OURS,
           "the true answer is 0 in style only; its content error is what the style itself changes", "gesture"),
    Metric("content_error", 1, "m", "lower", "hand distance to the content along the DTW path, mean", HANDS,
           "0 for a copy of the content; another take of the same gestures is far from 0", "gesture"),
    Metric("content_error_worst", 1, "m", "lower", "the same, largest pair", HANDS,
           "one bad frame decides", "gesture"),
    Metric("content_error_worst_quarter", 1, "m", "lower", "the same, mean of the largest quarter", HANDS,
           "0 for a copy of the content", "gesture"),
    Metric("content_error[world]", 1, "m", "lower", "content error of hands in the world frame", HANDS,
           "drift of the root counts as wrong hands", "gesture"),
    Metric("content_error[fastdtw]", 1, "m", "lower", "content error along FastDTW's path (radius 1)", HANDS,
           "the path may be dearer than the best one", "gesture"),
    Metric("style_error", 1, "m", "lower", "distance to the nearest style segment of 2.13 s, mean", HANDS,
           "0 for a copy of the style; a human imitation scores worse than every published method", "gesture"),
    Metric("style_error_worst", 1, "m", "lower", "the same, largest segment", HANDS, "one segment decides", "gesture"),
    Metric("style_error_worst_quarter", 1, "m", "lower", "the same, mean of the largest quarter", HANDS,
           "0 for a copy of the style", "gesture"),
    Metric("style_error[1.07s]", 1, "m", "lower", "style error with segments of 1.07 s", HANDS,
           "short segments find a near one anywhere", "gesture"),
    Metric("style_error[4.27s]", 1, "m", "lower", "style error with segments of 4.27 s", HANDS,
           "few segments in a sequence", "gesture"),
    Metric("style_error[world]", 1, "m", "lower", "style error of hands in the world frame", HANDS,
           "mostly where people stand", "gesture"),
)  # fmt: skip

INTERPOLATION_METRICS: tuple[Metric, ...] = (
    Metric("monotonicity", 1, "1", "higher", "Spearman of weight and the judge's log odds of target against start",
           OURS, "a change in one step is monotone too; read it beside evenness", "interpolation"),
    Metric("evenness", 1, "1", "one", "largest step between neighbouring weights over the mean step", OURS,
           "1 for a blend of poses that shows neither content", "interpolation"),
    Metric("end_recognition", 1, "%", "higher", "content and style both judged right at weights 0 and 1", OURS,
           "copies of both ends are perfect", "interpolation"),
    Metric("middle_content", 1, "%", "higher", "content judged right strictly between the ends", OURS,
           "a copy of the source is perfect", "interpolation"),
)  # fmt: skip

PREDICTION_METRICS: tuple[Metric, ...] = (
    Metric("next_frame_error", 1, "1", "lower", "mean squared error of z-scored features of the next frame", MASON,
           "repeating the last frame is hard to beat; does not track how motion looks", "prediction"),
    Metric("bone_length_loss", 1, "cm", "lower", "mean absolute difference of bone lengths", MASON,
           "0 by construction for methods that predict rotations", "prediction"),
)  # fmt: skip

RUNTIME_METRICS: tuple[Metric, ...] = (
    Metric("latency_p50", 1, "ms", "lower", "duration of a call, median", ERD_TIME,
           "host and threads decide; compare rows of one record set only", "runtime"),
    Metric("latency_p90", 1, "ms", "lower", "duration of a call, 90 % quantile", OURS,
           "a busy host shows here first", "runtime"),
    Metric("latency_p99", 1, "ms", "lower", "duration of a call, 99 % quantile", OURS,
           "needs some hundred calls", "runtime"),
    Metric("latency_max", 1, "ms", "lower", "duration of the longest call", OURS, "grows with the number of calls",
           "runtime"),
    Metric("frames_per_second", 1, "1/s", "higher", "frames produced per second of computing, median call",
           "Kuriyama 2022, section 3", "batches hide the latency of one frame", "runtime"),
    Metric("real_time_factor", 1, "1", "higher", "seconds of motion per second of computing, median call", OURS,
           "over 1 offline does not mean usable online", "runtime"),
    Metric("deadline_miss", 1, "%", "lower", "online calls longer than one frame", OURS,
           "a busy host misses for the method", "runtime"),
    Metric("load_time", 1, "s", "lower", "from nothing to a loaded adapter", OURS, "includes imports and disk caches",
           "runtime"),
    Metric("first_call", 1, "ms", "lower", "duration of the first call", OURS, "compilation counts", "runtime"),
    Metric("startup_designed", 1, "s", "lower", "input length the method was made for", ERD_TIME,
           "declared by the method, not measured", "runtime"),
    Metric("startup_measured", 1, "s", "lower", "input that must have come before the first frame can be final", OURS,
           "found by changing later input frames of one window", "runtime"),
    Metric("parameters", 1, "count", "lower", "trainable numbers used in a call", MASON_TIME,
           "declared by the method", "runtime"),
    Metric("bytes_per_style", 1, "B", "lower", "what must be kept for each style", MASON_TIME,
           "declared by the method", "runtime"),
    Metric("peak_memory", 1, "MB", "lower", "largest resident memory of the process", OURS,
           "the interpreter and its libraries count", "runtime"),
)  # fmt: skip

ALL_METRICS = (
    *TRANSFER_METRICS,
    *PHYSICS_METRICS,
    *DIVERSITY_METRICS,
    *PAPER_METRICS,
    *CONDITION_METRICS,
    *PARTS_METRICS,
    *GESTURE_METRICS,
    *INTERPOLATION_METRICS,
    *PREDICTION_METRICS,
    *RUNTIME_METRICS,
)
"""Every row of METRICS, by what first needed it."""
