"""How the transfer track computes each of its metrics. SCORES is the table of all.

Each metric is one function of a row and the shared reference, so that each can be computed, stored and recomputed
alone.
"""

from __future__ import annotations

from functools import partial

from bench.suite.scores import distances, motion, recognition
from bench.suite.scores.base import Score

SCORES: dict[str, Score] = {
    "joint_recognition": recognition.joint_recognition,
    "joint_recognition_ratio": recognition.joint_recognition_ratio,
    "conditional_kid": distances.conditional_kid,
    "conditional_fmd": distances.conditional_fmd,
    "copied_share": motion.copied_share,
    "cra": recognition.cra,
    "cra_balanced": recognition.cra_balanced,
    "sra": recognition.sra,
    "sra_balanced": recognition.sra_balanced,
    "source_style_residue": recognition.source_style_residue,
    "jerk_ratio": motion.jerk_ratio,
    "jerk_ratio_worst_content": motion.jerk_ratio_worst_content,
    "time_correlation": motion.time_correlation,
    "bone_drift": motion.bone_drift,
    **{name: partial(distances.set_distance, name, features) for name, features in distances.SET_FEATURES.items()},
}
"""Metric name -> how the transfer track computes it."""
