"""Scores of the gesture track: content and style errors of the hands' trajectories, without judges.

Outputs may differ in length from their sources. Slices: ``intra`` where both sides perform one scenario, ``inter``
where they do not, ``all``. Details of the intra slice hold the same error against the other sample: content error
against the style sample, style error against the content sample (Kuriyama et al. 2022, Table 1).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bench.arrays import BoolArray, FloatArray
from bench.errors import BadInput
from bench.metrics.dtw import FASTDTW_RADIUS, Backend, fastdtw_build
from bench.metrics.gesture import (
    THETA_S,
    Frame,
    content_error_components,
    hand_trajectories,
    segment_frames,
    style_error_components,
    summarise,
)
from bench.motion.clip import Clip
from bench.motion.kinematics import world_positions
from bench.protocols.base import Task
from bench.suite.motions import Motions
from bench.suite.scores.base import Basis, PlainRow, Scored, measure
from reports.bootstrap import mean_replicates

INTRA = "intra"
SLICES = ("all", INTRA, "inter")
SUMMARIES = ("mean", "worst", "worst_quarter")

Hands = Mapping[Frame, FloatArray]
"""Hand frame -> trajectories ``[T, 6]`` of one sequence."""
Errors = dict[str, FloatArray]
"""Name in ``SUMMARIES`` -> one value a sample, metres."""


@dataclass(frozen=True)
class ContentError:
    """Content error in one of its forms."""

    frame: Frame = "root"
    backend: Backend = "exact"
    other_sample = "against_style_sample"

    def samples(self, task: Task) -> tuple[str, str]:
        """Ids of the sequence that an output is compared with, and of the other one."""
        return task.content_take_id, task.style_take_id

    def components(self, sample: Hands, output: Hands, fps: float) -> FloatArray:
        """Error components of one output against one sequence."""
        return content_error_components(sample[self.frame], output[self.frame], self.backend)

    def facts(self, fps: float) -> dict[str, float]:
        """Which time warping ran, in numbers."""
        if self.backend == "exact":
            return {"dtw_exact": 1.0}
        compiled = float(fastdtw_build() == "compiled")
        return {"dtw_exact": 0.0, "fastdtw_radius": float(FASTDTW_RADIUS), "fastdtw_compiled": compiled}


@dataclass(frozen=True)
class StyleError:
    """Style error in one of its forms; the style's mirrored copy is added and the tail is covered in all of them."""

    frame: Frame = "root"
    theta_s: float = THETA_S
    other_sample = "against_content_sample"

    def samples(self, task: Task) -> tuple[str, str]:
        """Ids of the sequence that an output is compared with, and of the other one."""
        return task.style_take_id, task.content_take_id

    def components(self, sample: Hands, output: Hands, fps: float) -> FloatArray:
        """Error components of one output against one sequence."""
        return style_error_components(sample[self.frame], output[self.frame], fps, theta_s=self.theta_s)

    def facts(self, fps: float) -> dict[str, float]:
        """Segments and switches, in numbers."""
        frames = float(segment_frames(self.theta_s, fps))
        return {"theta_s": self.theta_s, "theta_frames": frames, "mirror_style": 1.0, "tail_covered": 1.0}


Form = ContentError | StyleError

FORMS: dict[str, tuple[Form, str]] = {
    "content_error": (ContentError(), "mean"),
    "content_error_worst": (ContentError(), "worst"),
    "content_error_worst_quarter": (ContentError(), "worst_quarter"),
    "content_error[world]": (ContentError(frame="world"), "mean"),
    "content_error[fastdtw]": (ContentError(backend="fastdtw"), "mean"),
    "style_error": (StyleError(), "mean"),
    "style_error_worst": (StyleError(), "worst"),
    "style_error_worst_quarter": (StyleError(), "worst_quarter"),
    "style_error[1.07s]": (StyleError(theta_s=1.07), "mean"),
    "style_error[4.27s]": (StyleError(theta_s=4.27), "mean"),
    "style_error[world]": (StyleError(frame="world"), "mean"),
}
"""Metric -> its form, and which summary of a sample's components it is."""


def hand_error(name: str, row: PlainRow, basis: Basis) -> Scored:
    """A content or style error, one of ``FORMS``."""
    form, summary = FORMS[name]
    errors = _errors_of(row, basis)
    own, other = errors.of(form), errors.of(form, intra_against_other=True)

    def details(slice_name: str, mask: BoolArray) -> dict[str, float]:
        found = form.facts(errors.fps)
        if summary == "mean":
            found |= {more: float(own[more][mask].mean()) for more in SUMMARIES[1:]}
        if slice_name == INTRA:
            found[form.other_sample] = float(other[summary].mean())
        return found

    return _scored(name, own[summary], basis, details)


def gesture_error(row: PlainRow, basis: Basis) -> Scored:
    """Content error plus style error of each sample, means; both parts are in the details."""
    errors = _errors_of(row, basis)
    parts = {name: errors.of(FORMS[name][0])["mean"] for name in ("content_error", "style_error")}
    return _sum("gesture_error", parts, basis)


def gesture_error_to_truth(row: PlainRow, basis: Basis) -> Scored:
    """Content error plus style error against the true answer instead of the style sequence.

    The true answer performs the source's own gestures in the wanted style, so nothing but style separates it from the
    source; the style sequence also differs from it by how its takes happened to be performed.

    Raises
    ------
    BadInput : the basis has no true answers.
    """
    if basis.truth is None:
        raise BadInput("errors to the true answer need true answers", where="basis")
    errors = _errors_of(row, basis)
    form = StyleError()
    truths = [_hands(basis.truth.clip(index)) for index in range(basis.truth.n)]
    style = [form.components(t, output, errors.fps).mean() for t, output in zip(truths, errors.outputs, strict=True)]
    parts = {"content_error": errors.of(ContentError())["mean"], "style_error": np.array(style)}
    return _sum("gesture_error[truth]", parts, basis)


def _sum(name: str, parts: Mapping[str, FloatArray], basis: Basis) -> Scored:
    def details(slice_name: str, mask: BoolArray) -> dict[str, float]:
        return {part: float(values[mask].mean()) for part, values in parts.items()}

    return _scored(name, np.sum(list(parts.values()), axis=0), basis, details)


def _scored(
    name: str, values: FloatArray, basis: Basis, details: Callable[[str, BoolArray], dict[str, float]]
) -> Scored:
    measurements, replicates = [], {}
    for slice_name in (name for name in SLICES if name in basis.slices):
        mask = basis.slices[slice_name]
        draws = mean_replicates(values[mask], basis.counts[:, mask])
        replicates[f"{name}|{slice_name}"] = draws
        mean, n = float(values[mask].mean()), int(mask.sum())
        measurements.append(measure(name, slice_name, mean, n, replicates=draws, details=details(slice_name, mask)))
    return Scored(tuple(measurements), {name: values}, replicates)


class _HandErrors:
    """The errors of one row in every form that was asked for, each computed once."""

    def __init__(self, row: PlainRow, basis: Basis) -> None:
        self.tasks = basis.tasks
        self.samples = _hands_of_samples(basis)
        self.fps = row.motions.fps
        self.outputs = [_hands(row.motions.clip(index)) for index in range(row.motions.n)]
        self.found: dict[tuple[Form, bool], Errors] = {}

    def of(self, form: Form, *, intra_against_other: bool = False) -> Errors:
        """One value a task; with ``intra_against_other`` one an intra task, against its other sequence."""
        if (form, intra_against_other) not in self.found:
            pairs = [
                (form.samples(task)[intra_against_other], output)
                for task, output in zip(self.tasks, self.outputs, strict=True)
                if task.same_content or not intra_against_other
            ]
            rows = [summarise(form.components(self.samples[take_id], output, self.fps)) for take_id, output in pairs]
            self.found[form, intra_against_other] = {
                summary: np.array([getattr(row, summary) for row in rows]) for summary in SUMMARIES
            }
        return self.found[form, intra_against_other]


@lru_cache(maxsize=1)
def _errors_of(row: PlainRow, basis: Basis) -> _HandErrors:
    return _HandErrors(row, basis)


@lru_cache(maxsize=1)
def _hands_of_samples(basis: Basis) -> dict[str, Hands]:
    """Hands of every content and style sequence, in the precision in which outputs are stored: copies are exact."""
    take_ids = sorted({take_id for task in basis.tasks for take_id in (task.content_take_id, task.style_take_id)})
    stored = Motions.of([basis.pack.take(take_id) for take_id in take_ids])
    return {take_id: _hands(stored.clip(index)) for index, take_id in enumerate(take_ids)}


def _hands(clip: Clip) -> Hands:
    positions = world_positions(clip)
    return {"root": hand_trajectories(positions, "root"), "world": hand_trajectories(positions, "world")}
