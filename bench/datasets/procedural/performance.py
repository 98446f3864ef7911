"""Performances (what is done, by whom, when) and their rendering in a style."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.ndimage import gaussian_filter1d

from bench.arrays import FloatArray
from bench.datasets.procedural import actions, gestures, locomotion
from bench.datasets.procedural.actors import Actor
from bench.datasets.procedural.controls import (
    ABDUCTION,
    ELBOW,
    FLEXION,
    LEFT,
    RIGHT,
    WRIST,
    Controls,
    mirrored,
    pose,
    turned,
)
from bench.datasets.procedural.curves import TAU, band_noise, ease, wave
from bench.datasets.procedural.seeds import generator
from bench.datasets.procedural.stage import Stage
from bench.datasets.procedural.styles import STYLES, Manner, combined
from bench.motion.clip import Clip

FPS = 30.0
_MARGIN = 12
"""Frames rendered before and after a performance, so that smoothing sees no edges."""


@dataclass(frozen=True)
class Content:
    """A row of CONTENTS.

    Attributes
    ----------
    act : makes the controls of the action, facing +Z, right side leading.
    cycles_per_s : of a neutral adult.
    beats : oscillations of the trunk per cycle.
    rhythm : share of a style's rhythm that may bend the phase; 0 where flight must obey gravity.
    """

    act: Callable[[Stage], Controls]
    cycles_per_s: float
    beats: float
    rhythm: float = 1.0


CONTENTS: dict[str, Content] = {
    "gesture-beat": Content(gestures.beat, 0.75, 1.0),
    "gesture-clap": Content(gestures.clap, 1.60, 0.5),
    "gesture-point": Content(gestures.point, 0.48, 2.0),
    "gesture-wave": Content(gestures.wave_hand, 1.40, 0.5),
    "jump": Content(actions.jump, 0.52, 2.0, rhythm=0.0),
    "kick": Content(actions.kick, 0.58, 2.0),
    "punch": Content(actions.punch, 0.55, 2.0),
    "run": Content(locomotion.run, 1.38, 1.0),
    "transition": Content(locomotion.transition, 0.36, 3.0, rhythm=0.5),
    "walk": Content(locomotion.walk, 0.92, 1.0),
}


@dataclass(frozen=True, eq=False)
class Performance:
    """One act of a content by an actor; everything but the style.

    Attributes
    ----------
    key : names the performance; seeds its noise.
    content, actor, n_frames : what, who, how long.
    cycles_per_s, start_cycle, drift : the phase function; drift ``[3, 3]`` rows of share, Hz, place.
    heading_rad, left_handed : where it faces, and which side leads.
    variant : ``[8]`` uniform numbers that a content reads as it likes (direction, size, pattern).
    person : changes of manner that come from the actor and the day, whatever the style.
    """

    key: str
    content: str
    actor: Actor
    n_frames: int
    cycles_per_s: float
    start_cycle: float
    drift: FloatArray
    heading_rad: float
    left_handed: bool
    variant: FloatArray
    person: dict[str, float]

    def phase_cycles(self, time_s: FloatArray) -> FloatArray:
        """Where in its cycle the performance is at each time; ascending."""
        share, hz, place = self.drift[:, :, None]
        angle = TAU * (hz * time_s + place)
        late = (share / (TAU * hz) * (np.sin(angle) - np.sin(TAU * place))).sum(axis=0)
        return np.asarray(self.start_cycle + self.cycles_per_s * (time_s + late))


def draw_performance(key: str, content: str, style: str, actor: Actor, n_frames: int) -> Performance:
    """Draw the performance named ``key``; the style acts on its tempo only."""
    rng = generator("performance", key)
    person = _person(actor, rng)
    tempo = STYLES[style].tempo * person.pop("tempo")
    return Performance(
        key,
        content,
        actor,
        n_frames,
        CONTENTS[content].cycles_per_s * tempo,
        float(rng.uniform(0.0, 1.0)),
        np.stack([rng.uniform(-0.06, 0.06, 3), rng.uniform(0.1, 0.6, 3), rng.uniform(0.0, 1.0, 3)], axis=1).T,
        float(np.clip(rng.normal(0.0, 0.15), -0.35, 0.35)),
        bool(rng.uniform() < 0.4),
        rng.uniform(0.0, 1.0, 8),
        person,
    )


def imitation(performance: Performance, actor: Actor, key: str) -> Performance:
    """The same task done by someone else: their body, habits and noise, slightly other timing."""
    rng = generator("imitation", performance.key, actor.name, key)
    person = _person(actor, rng)
    person.pop("tempo")
    return replace(
        performance,
        key=f"{performance.key}/{actor.name}/{key}",
        actor=actor,
        cycles_per_s=performance.cycles_per_s * float(np.exp(rng.normal(0.0, 0.03))),
        start_cycle=performance.start_cycle + float(rng.normal(0.0, 0.02)),
        drift=performance.drift * [[1.0], [1.0], [1.0]] + [rng.uniform(-0.02, 0.02, 3), [0.0] * 3, [0.0] * 3],
        variant=np.clip(performance.variant + rng.normal(0.0, 0.05, 8), 0.0, 1.0),
        person=person,
    )


def _person(actor: Actor, rng: np.random.Generator) -> dict[str, float]:
    """Habits of the actor and of the day as changes of manner: postures vary between people as much as with style."""
    habit, day = actor.habits, rng.standard_normal(14)
    return {
        "spine": 0.028 * habit[0] + 0.034 * day[0],
        "head": 0.034 * habit[1] + 0.039 * day[1],
        "lean": 0.007 * habit[2] + 0.007 * day[2],
        "arms_out": 0.022 * habit[3] + 0.028 * day[3],
        "elbow": 0.045 * habit[4] + 0.056 * day[4],
        "toe_out": 0.028 * habit[5] + 0.017 * day[5],
        "crouch": 0.004 * abs(day[12]),
        "width": float(np.exp(0.045 * habit[6] + 0.045 * day[6])),
        "step": float(np.exp(0.017 * habit[7] + 0.028 * day[7])),
        "lift": float(np.exp(0.034 * day[8])),
        "arm": float(np.exp(0.034 * habit[8] + 0.045 * day[9])),
        "twist": float(np.exp(0.034 * habit[9] + 0.045 * day[10])),
        "bounce": float(np.exp(0.034 * habit[10] + 0.045 * day[11])),
        "tempo": float(np.exp(0.02 * habit[11] + 0.034 * day[13])),
    }


def render(performance: Performance, style: str) -> Clip:
    """The performance in a style, ``[n_frames]`` at 30 fps: same actor, same phase function, the style's manner."""
    content = CONTENTS[performance.content]
    manner = combined(STYLES[style], performance.person)
    time_s = np.arange(-_MARGIN, performance.n_frames + _MARGIN) / FPS
    steady = performance.phase_cycles(time_s)
    limp, attack = content.rhythm * manner.limp, content.rhythm * manner.attack
    bent = steady + limp / TAU * np.sin(TAU * steady) + attack / (2.0 * TAU) * np.sin(2.0 * TAU * steady)
    rng = generator("noise", performance.key)
    stage = Stage(
        performance.actor,
        manner,
        time_s,
        steady,
        bent,
        1.0 / performance.cycles_per_s,
        performance.variant,
        band_noise(time_s, rng, 8, 0.08, 0.45),
        rng.standard_normal((64, 4)),
    )
    controls = _in_manner(content.act(stage), stage, content.beats, rng)
    if performance.left_handed:
        controls = mirrored(controls)
    rotations, root = pose(turned(controls, performance.heading_rad), performance.actor)
    keep = slice(_MARGIN, _MARGIN + performance.n_frames)
    root = root[keep] - root[_MARGIN] * [1.0, 0.0, 1.0]
    return Clip(performance.actor.skeleton, rotations[keep], root, FPS)


def _in_manner(controls: Controls, stage: Stage, beats: float, rng: np.random.Generator) -> Controls:
    """Add posture, oscillation, smoothing and noise, the same way for every action."""
    _add_posture(controls, stage.manner)
    _add_oscillation(controls, stage, beats)
    for channel in (controls.pelvis_rad, controls.spine_rad, controls.head_rad, controls.arms_rad):
        channel[:] = gaussian_filter1d(channel, 1.2, axis=0, mode="nearest")
    _add_noise(controls, stage, rng)
    # The gaze stays ahead: the head takes back most of what pelvis and spine do.
    controls.head_rad -= 0.6 * controls.spine_rad + [0.6, 0.6, 0.0] * controls.pelvis_rad
    return controls


def _add_posture(controls: Controls, manner: Manner) -> None:
    controls.spine_rad[:, 0] += manner.spine
    controls.head_rad[:, 0] += manner.head
    controls.pelvis_rad[:, 0] += manner.lean
    controls.arms_rad[..., ABDUCTION] += manner.arms_out
    controls.arms_rad[..., ELBOW] += manner.elbow * np.clip(controls.arms_rad[..., ELBOW] / 0.5, 0.2, 1.0)
    outward = np.array([1.0, -1.0])
    controls.feet_rad[..., 2] += manner.toe_out * outward


def _add_oscillation(controls: Controls, stage: Stage, beats: float) -> None:
    """The trunk's own movement in a style; it grows and shrinks a little over time."""
    manner, groove = stage.manner, beats * stage.bent
    size = 1.0 + 0.15 * stage.wander[:, 0]
    late = groove - manner.lag
    grounded = 1.0 - ease(controls.swing.min(axis=1) / 0.3)
    leg_m = stage.actor.leg_m
    controls.pelvis_m[:, 1] += (
        grounded
        * size
        * leg_m
        * (manner.bob * wave(2.0 * groove + 0.5) - manner.drop * (0.5 + 0.5 * wave(groove - 0.3)))
    )
    controls.pelvis_m[:, 0] += 0.25 * manner.hips * leg_m * size * wave(groove - 0.25) * grounded
    controls.pelvis_rad[:, 1] += size * (manner.hips * wave(groove - 0.25) + 2.0 * manner.drop * wave(groove - 0.3))
    controls.spine_rad[:, 1] -= size * 1.2 * manner.hips * wave(groove - 0.25 - manner.lag)
    controls.spine_rad[:, 2] += size * manner.shoulders * wave(groove - 0.05)
    controls.spine_rad[:, 0] += size * manner.rock * wave(2.0 * groove - 0.1)
    controls.head_rad[:, 0] += size * manner.nod * wave(2.0 * late - 0.2)
    controls.head_rad[:, 1] += size * manner.tilt * wave(late)
    controls.arms_rad[..., ABDUCTION] += (size * manner.flap * (0.5 + 0.5 * wave(2.0 * late)))[:, None]
    controls.arms_rad[:, LEFT, FLEXION] += size * manner.asymmetry * 0.3 * wave(late)
    controls.arms_rad[:, RIGHT, ELBOW] += size * abs(manner.asymmetry) * 0.4


def _add_noise(controls: Controls, stage: Stage, rng: np.random.Generator) -> None:
    manner = stage.manner
    slow = band_noise(stage.time_s, rng, 10, 0.6, 1.4) * (0.012 + manner.wobble)
    fast = band_noise(stage.time_s, rng, 10, 4.0, 6.0) * (0.002 + manner.tremor)
    controls.spine_rad += 0.5 * slow[:, :3]
    controls.head_rad += slow[:, 3:6] + fast[:, :3]
    controls.arms_rad[..., FLEXION] += slow[:, 6:8] + fast[:, 3:5]
    controls.arms_rad[..., ABDUCTION] += slow[:, 8:10]
    controls.arms_rad[..., ELBOW] += fast[:, 5:7]
    controls.arms_rad[..., WRIST] += 2.0 * fast[:, 7:9]
