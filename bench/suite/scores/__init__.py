"""How each track computes each of its metrics. SCORES is the table of all.

Each metric is one function of a row and what the row is scored against, so that each can be computed, stored and
recomputed alone. Judged tracks get a ``Row`` and a ``Reference``, the others a ``PlainRow`` and a ``Basis``.
"""

from __future__ import annotations

from functools import partial
from typing import Any

from bench.suite.scores import (
    conditions,
    distances,
    diversity,
    gesture,
    interpolation,
    motion,
    papers,
    parts,
    physics,
    prediction,
    recognition,
)
from bench.suite.scores.base import AnyScore

SCORES: dict[str, AnyScore[Any, Any]] = {
    "joint_recognition": recognition.joint_recognition,
    "joint_recognition_ratio": recognition.joint_recognition_ratio,
    "conditional_kid": distances.conditional_kid,
    "conditional_fmd": distances.conditional_fmd,
    "copied_share": motion.copied_share,
    "cra": recognition.cra,
    "cra_balanced": recognition.cra_balanced,
    "cra_top3": papers.cra_top3,
    "sra": recognition.sra,
    "sra_balanced": recognition.sra_balanced,
    "sra_top3": papers.sra_top3,
    "source_style_residue": recognition.source_style_residue,
    "jerk_ratio": motion.jerk_ratio,
    "jerk_ratio_worst_content": motion.jerk_ratio_worst_content,
    "time_correlation": motion.time_correlation,
    "bone_drift": motion.bone_drift,
    "speed_ratio": motion.speed_ratio,
    "foot_skate": physics.foot_skate,
    "skate[gmd]": physics.skate_gmd,
    "penetration": physics.penetration,
    "float_height": physics.float_height,
    "joint_range": physics.joint_range,
    "contact_precision": physics.contact_precision,
    "contact_recall": physics.contact_recall,
    "root_path_error": physics.root_path_error,
    **{f"density[{family}]": partial(diversity.density, family) for family in diversity.FEATURES},
    **{f"coverage[{family}]": partial(diversity.coverage, family) for family in diversity.FEATURES},
    "diversity": diversity.diversity,
    "multimodality": diversity.multimodality,
    "neighbour_ratio": motion.neighbour_ratio,
    **{name: partial(distances.set_distance, name, features) for name, features in distances.SET_FEATURES.items()},
    **{name: partial(conditions.paired_truth, name) for name in conditions.PAIRED_ERRORS},
    "reconstruction_position": conditions.reconstruction_position,
    "reconstruction_rotation": conditions.reconstruction_rotation,
    "join_jerk_ratio": conditions.join_jerk_ratio,
    "path_drift": conditions.path_drift,
    "prefix_error": conditions.prefix_error,
    "fmd[stgcn]": papers.fmd_stgcn,
    **{name: partial(papers.fmd_dae_512, name) for name in papers.CUT_OF},
    "leak_ratio": parts.rotation_leak,
    "leak_ratio[position]": parts.position_leak,
    "locality_msd": parts.mean_squared_displacement,
    "locality_distance": parts.mean_displacement,
    "joints_above_0.1": partial(parts.joints_above, "joints_above_0.1", 0.1),
    "joints_above_0.05": partial(parts.joints_above, "joints_above_0.05", 0.05),
    "monotonicity": interpolation.monotonicity,
    "evenness": interpolation.evenness,
    "end_recognition": interpolation.end_recognition,
    "middle_content": interpolation.middle_content,
    "gesture_error": gesture.gesture_error,
    "gesture_error[truth]": gesture.gesture_error_to_truth,
    **{name: partial(gesture.hand_error, name) for name in gesture.FORMS},
    "next_frame_error": prediction.next_frame_error,
    "bone_length_loss": prediction.bone_length_loss,
}
"""Metric name -> how it is computed. The runtime track scores durations instead, see ``scores.runtime``."""
