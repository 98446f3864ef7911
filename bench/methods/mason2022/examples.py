"""Takes as examples of the next frame, and what gates the experts: phases or velocities (Mason 2022, section 4.1)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadData
from bench.methods.mason2022 import phases
from bench.methods.mason2022.features import (
    END_EFFECTORS,
    FPS,
    Body,
    Layout,
    body_of,
    clip_features,
    gate_velocities,
    input_frames,
    local_joints,
    output_frames,
)
from bench.methods.mason2022.network import Backbone
from bench.motion.edit import resample
from bench.motion.locomotion import travels

N_HANDS = 2
"""Hands come first among the end effectors; they have no contacts."""
LEFT_TOE_PLACE = 2
LEAST_FRAMES = 60

Axes = tuple[phases.Axis, phases.Axis, phases.Axis, phases.Axis]
"""Of the four end effectors."""


@dataclass(frozen=True, eq=False)
class StyleExamples:
    """All frames of one style.

    Attributes
    ----------
    inputs : ``[N, n_input]``. gates : ``[N, n_gate]``. outputs : ``[N, n_output]``.
    clips : ``[M, 12 J]`` joints of its takes one after the other, of which style clips are cut.
    """

    inputs: FloatArray
    gates: FloatArray
    outputs: FloatArray
    clips: FloatArray


def layout_of(backbone: Backbone) -> Layout:
    """What a backbone's output frames hold."""
    return Layout(n_phases={"lpn": 4 * len(END_EFFECTORS), "pfnn": 1, "mann": 0}[backbone])


def locomotion(takes: Sequence[Take]) -> list[Take]:
    """Labelled takes that travel, at 60 fps, of a second at least.

    Raises
    ------
    BadData : none does, or labels are missing.
    """
    found = [take.with_clip(resample(take.clip, FPS)) for take in takes if travels(take.clip)]
    found = [take for take in found if take.clip.n_frames > LEAST_FRAMES]
    if not found or any(take.style is None or take.content is None for take in found):
        raise BadData("style modelling needs labelled takes of locomotion of a second or more", where="takes")
    return found


def effector_positions(body: Body) -> FloatArray:
    """Hands and toes in the body's own frames, ``[T, 4, 3]`` metres."""
    everything = slice(0, body.n_frames)
    return local_joints(body, everything, everything)[0][:, list(END_EFFECTORS)]


def axes_of(bodies: Sequence[Body]) -> Axes:
    """Principal axes of hands and toes over all takes of one style and gait."""
    positions = np.concatenate([effector_positions(body) for body in bodies])
    left_hand, right_hand, left_toe, right_toe = (phases.principal_axis(positions[:, i]) for i in range(4))
    return left_hand, right_hand, left_toe, right_toe


def sources(body: Body, axes: Axes) -> list[FloatArray]:
    """Source functions ``[T]`` of hands (contact-free) and toes (contacts; contact-free where they never change)."""
    positions = effector_positions(body)
    found = []
    for place, axis in enumerate(axes):
        raw = phases.contact_free_source(positions[:, place], axis)
        if place >= N_HANDS:
            standing = body.contacts[:, place - N_HANDS].astype(np.float64)
            raw = standing if 0.0 < standing.mean() < 1.0 else raw
        found.append(phases.source_function(raw, FPS))
    return found


def local_phases(body: Body, axes: Axes, *, as_released: bool = False) -> FloatArray:
    """Phase features ``[T, 8]`` of left hand, right hand, left toe, right toe (equation 1)."""
    speeds = np.linalg.norm(body.velocities_m_s[:, list(END_EFFECTORS)], axis=-1)
    return np.concatenate(
        [
            phases.phase_features(phases.fit_sinusoids(source, FPS), speeds[:, place], FPS, as_released=as_released)
            for place, source in enumerate(sources(body, axes))
        ],
        axis=1,
    )


def toe_phase(body: Body, axis: phases.Axis) -> phases.Sinusoids:
    """The sine of the left toe's movement along its axis."""
    raw = phases.contact_free_source(effector_positions(body)[:, LEFT_TOE_PLACE], axis)
    return phases.fit_sinusoids(phases.source_function(raw, FPS), FPS)


def examples_of(
    takes: Sequence[Take], backbone: Backbone, *, as_released: bool = False
) -> tuple[Mapping[str, StyleExamples], float]:
    """Examples by style, and where in the left toe's cycle PFNN's phase is 0 (0 for the others).

    Parameters
    ----------
    takes : of :func:`locomotion`.
    as_released : phase features as the released exporter has them.
    """
    gaits: dict[tuple[str, str], list[Body]] = defaultdict(list)
    for take in takes:
        gaits[str(take.style), str(take.content)].append(body_of(take.clip))
    found: dict[str, list[StyleExamples]] = defaultdict(list)
    shifts: list[FloatArray] = []
    for (style, _), bodies in sorted(gaits.items()):
        axes = axes_of(bodies)
        for body in bodies:
            inputs = input_frames(body)
            path, pose, contacts = output_frames(body)
            if backbone == "lpn":
                local = local_phases(body, axes, as_released=as_released)
                gates, extra = local[:-1], np.concatenate([local[1:], np.diff(local, axis=0)], axis=1)
            elif backbone == "pfnn":
                steps = phases.global_phase(body.contacts)
                shifts.append((steps - toe_phase(body, axes[LEFT_TOE_PLACE]).phase) % 1.0)
                gates, extra = steps[:-1, None], phases.phase_advance(steps)[:, None]
            else:
                gates, extra = gate_velocities(inputs[:, 48:]), np.zeros((len(pose), 0))
            outputs = np.concatenate([path, pose, extra, contacts], axis=1)
            found[style].append(StyleExamples(inputs, gates, outputs, clip_features(body)))
    shift = phases.circular_mean(np.concatenate(shifts)) if shifts else 0.0
    return {style: _joined(parts) for style, parts in found.items()}, shift


def style_clip(clips: FloatArray, n_frames: int) -> FloatArray:
    """The first ``n_frames`` of ``[M, C]``; a shorter clip is said again."""
    return clips[np.arange(n_frames) % len(clips)]


def _joined(parts: Sequence[StyleExamples]) -> StyleExamples:
    return StyleExamples(
        *(np.concatenate([getattr(part, name) for part in parts]) for name in ("inputs", "gates", "outputs", "clips"))
    )
