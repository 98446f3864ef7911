"""Scores in the papers' own forms: Frechet distances as means over trials, recognition among the likeliest three."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from bench.arrays import FloatArray, IntArray
from bench.errors import BadInput
from bench.metrics import recognition
from bench.motion.representation import JUDGE_SLICES
from bench.suite.judges import JudgeSet
from bench.suite.motions import Motions
from bench.suite.scores.base import PRIMARY_SLICE, Reference, Row, Scored, measure, share_score
from bench.suite.scores.distances import frechet_value
from classifiers.embed import encode

CLIP_FRAMES = 24
CUTS = {"centre": (20,), "first": (0,), "every": (0, 24)}
"""Clip cut -> first frames of the 24-frame clips taken from a 64-frame sample."""
CUT_OF = {"fmd[dae-512]": "centre", "fmd[dae-512-first]": "first", "fmd[dae-512-every]": "every"}
"""Metric -> its clip cut."""


def fmd_stgcn(row: Row, reference: Reference) -> Scored:
    """Frechet distance in content-judge features, mean over trials and judge seeds."""
    real, generated = reference.real.embedding.content_features, row.embedding.content_features
    return _over_trials("fmd[stgcn]", real, generated, 1, reference)


def fmd_dae_512(name: str, row: Row, reference: Reference) -> Scored:
    """Frechet distance in all auto-encoder activations under a clip cut, mean over trials and judge seeds.

    Raises
    ------
    BadInput : the reference was built without judges.
    """
    if reference.judges is None:
        raise BadInput("activations need the judges themselves", where="reference")
    cut = CUT_OF[name]
    generated = activations(reference.judges, row.motions, cut)
    return _over_trials(name, reference.activations[cut], generated, len(CUTS[cut]), reference)


def activations(judges: JudgeSet, motions: Motions, cut: str) -> NDArray[np.float32]:
    """Auto-encoder activations ``[S, n * clips, 512]`` of windows under a clip cut."""
    rotations = cut_rotations(motions, cut)
    return np.stack([encode(judge, rotations).activations for judge in judges.encoders]).astype(np.float32)


def activation_floors(
    real: Mapping[str, NDArray[np.float32]], floor: Mapping[str, NDArray[np.float32]]
) -> dict[str, float]:
    """Metric -> distance of other real motion from the reference, mean over judge seeds."""
    return {
        name: float(np.mean([frechet_value(r, f) for r, f in zip(real[cut], floor[cut], strict=True)]))
        for name, cut in CUT_OF.items()
    }


def cut_rotations(motions: Motions, cut: str) -> FloatArray:
    """``[n * clips, 24, 21, 4]`` rotations of the clips that a cut takes, the clips of one sample side by side."""
    rotations = motions.window_features()[..., JUDGE_SLICES["rotation_wxyz"]]
    clips = np.stack([rotations[:, start : start + CLIP_FRAMES] for start in CUTS[cut]], axis=1)
    return clips.reshape(-1, *clips.shape[2:])


def _over_trials(
    name: str, real: NDArray[np.float32], generated: NDArray[np.float32], per_sample: int, reference: Reference
) -> Scored:
    """Mean over trials of the mean over judge seeds; ``generated`` has ``per_sample`` rows a sample."""
    n_real, d = real.shape[1:]
    sizes = {len(trial) for trial in reference.trials}
    samples = max(sizes)
    details = {
        "n_real": float(n_real),
        "d": float(d),
        "pool": float(len(reference.tasks)),
        "trials": float(len(reference.trials)),
    }
    if min(n_real, samples * per_sample) < 2 * d:
        reason = f"n = {min(n_real, samples * per_sample)} is below 2 d = {2 * d}: the number would be mostly bias"
        return Scored((measure(name, "all", float("nan"), samples, details=details, reason=reason),))
    pairs = list(zip(real, generated, strict=True))
    rows = [(trial[:, None] * per_sample + np.arange(per_sample)).reshape(-1) for trial in reference.trials]
    table = np.array([[frechet_value(r, g[drawn]) for r, g in pairs] for drawn in rows])
    by_trial, by_judge = table.mean(axis=1), table.mean(axis=0)
    details["trial_sd"] = float(by_trial.std(ddof=1)) if len(by_trial) > 1 else 0.0
    found = measure(
        name, "all", float(by_trial.mean()), samples, judge_values=by_judge.tolist(),
        floor=reference.floors.get(name), details=details,
    )  # fmt: skip
    return Scored((found,), {}, {})


def cra_top3(row: Row, reference: Reference) -> Scored:
    """The right content among the three likeliest."""
    return _top3("cra_top3", row.contents, row.embedding.content_log_probabilities, reference)


def sra_top3(row: Row, reference: Reference) -> Scored:
    """The wanted style among the three likeliest."""
    return _top3("sra_top3", row.styles, row.embedding.style_log_probabilities, reference)


def _top3(name: str, true: IntArray, log_probabilities: NDArray[np.float32], reference: Reference) -> Scored:
    k = min(3, log_probabilities.shape[-1])
    hits = np.stack([recognition.top_k_correct(true, seen.astype(np.float64), k) for seen in log_probabilities])
    return share_score(name, hits.astype(np.float64), reference, slices=("all", PRIMARY_SLICE))
