"""Walk, run, and transition (walk, stop, turn on the spot, walk on)."""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.procedural.controls import ABDUCTION, CURL, ELBOW, FLEXION, LEFT, RIGHT, TWIST, Controls
from bench.datasets.procedural.curves import bump, ease, key_poses, wave
from bench.datasets.procedural.stage import Roll, Stage, Steps, follow_footprints, place_foot, standing

_SIDES = ((LEFT, 1.0, 0.0), (RIGHT, -1.0, 0.5))
"""Side, sign of its x, and the place in the cycle where that foot comes down."""


def walk(stage: Stage) -> Controls:
    """Two steps a cycle along +Z; the left foot comes down at whole cycles, each foot stands 62 % of a cycle."""
    manner, leg_m = stage.manner, stage.actor.leg_m
    stride_m = 1.42 * leg_m * manner.step
    controls = _travelling(stage, stride_m, duty=0.62, ahead_m=0.03 * leg_m, line=1.0)
    roll = Roll(0.62 * manner.lift**0.5 * min(manner.step, 1.15), 0.32 * manner.lift**0.5, 0.22, 0.09)
    for side, sign, place in _SIDES:
        steps = _straight_steps(stage, sign, place, stride_m, 0.62)
        place_foot(controls, side, steps, 0.075 * leg_m * manner.lift, 0.42, roll)
    _swing_trunk(controls, stage, mid_stance=0.31, bob_m=0.022 * leg_m, yaw=0.10, roll=0.055)
    _swing_arms(controls, stage, swing=0.38, middle=0.05, elbow=0.32, elbow_swing=0.22)
    return controls


def run(stage: Stage) -> Controls:
    """A jog with two flights a cycle; each foot stands 36 % of a cycle."""
    manner, leg_m = stage.manner, stage.actor.leg_m
    stride_m = 2.05 * leg_m * manner.step
    controls = _travelling(stage, stride_m, duty=0.36, ahead_m=0.02 * leg_m, line=0.6)
    controls.pelvis_m[:, 1] -= 0.045 * leg_m
    controls.pelvis_rad[:, 0] += 0.10
    controls.spine_rad[:, 0] += 0.08
    roll = Roll(0.75 * min(manner.lift, 1.3) ** 0.4, 0.10, 0.17, 0.05)
    for side, sign, place in _SIDES:
        steps = _straight_steps(stage, 0.6 * sign, place, stride_m, 0.36)
        place_foot(controls, side, steps, 0.34 * leg_m * manner.lift**0.6, 0.40, roll)
    _swing_trunk(controls, stage, mid_stance=0.18, bob_m=-0.040 * leg_m, yaw=0.16, roll=0.05)
    _swing_arms(controls, stage, swing=0.60, middle=-0.10, elbow=1.45, elbow_swing=0.25)
    controls.arms_rad[..., TWIST] += 0.25
    controls.arms_rad[..., CURL] = 0.9
    return controls


def transition(stage: Stage) -> Controls:
    """Two steps forward, close the feet, turn to the left on the spot in two steps; again and again."""
    manner, leg_m = stage.manner, stage.actor.leg_m
    controls = standing(stage, stage.half_width_m)
    feet, path, facing = _walk_and_turn(stage)
    roll = Roll(0.45 * manner.lift**0.5, 0.12 * manner.lift**0.5, 0.06, 0.03)
    for side, steps in zip((LEFT, RIGHT), feet, strict=True):
        place_foot(controls, side, steps, 0.07 * leg_m * manner.lift, 0.45, roll)
    controls.pelvis_m[:, [0, 2]] += path(stage.bent)
    weight = feet[RIGHT].swing - feet[LEFT].swing
    weight = np.where(weight > 0.0, bump(weight), -bump(-weight))
    across = np.stack([np.cos(facing(stage.bent)), -np.sin(facing(stage.bent))], axis=1)
    controls.pelvis_m[:, [0, 2]] += 0.5 * stage.half_width_m * manner.sway**0.5 * weight[:, None] * across
    controls.pelvis_m[:, 1] += 0.012 * leg_m * manner.bounce * (np.abs(weight) - 1.0)
    controls.pelvis_rad[:, 1] += 0.05 * manner.sway**0.5 * weight
    # Head and chest turn before the pelvis does.
    controls.pelvis_rad[:, 2] = facing(stage.bent)
    ahead = facing(stage.bent + 0.045) - facing(stage.bent)
    controls.spine_rad[:, 2] += 0.5 * ahead * min(manner.twist, 1.3)
    controls.head_rad[:, 2] += 0.9 * ahead
    late = stage.bent - 0.5 * manner.lag
    swing = key_poses(late, ((0.0, 0.0), (0.14, -0.8), (0.34, 1.0), (0.50, -0.6), (0.62, 0.15), (0.80, -0.2)))
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        gain = manner.arm * (1.0 + sign * manner.asymmetry)
        controls.arms_rad[:, side, FLEXION] += -sign * 0.35 * gain * swing
        controls.arms_rad[:, side, ELBOW] += 0.15 * gain * (1.0 - sign * swing) * 0.5
    return controls


def _travelling(stage: Stage, stride_m: float, duty: float, ahead_m: float, line: float) -> Controls:
    """A body that travels steadily along +Z and sways over the standing foot."""
    controls = standing(stage, stage.half_width_m)
    sway_m = 0.45 * line * stage.half_width_m**0.5 * stage.actor.half_hips_m**0.5 * min(stage.manner.sway, 1.6)
    controls.pelvis_m[:, 0] += sway_m * wave(stage.bent - duty / 2.0)
    controls.pelvis_m[:, 2] += stride_m * (stage.steady - duty / 2.0) - ahead_m
    return controls


def _straight_steps(stage: Stage, sign: float, place: float, stride_m: float, duty: float) -> Steps:
    first = np.floor(stage.bent.min()) - 2.0
    on = np.arange(first, stage.bent.max() + 3.0) + place
    noise = stage.jitter[np.arange(len(on)) + (0 if sign > 0.0 else 31)]
    leg_m = stage.actor.leg_m
    ahead = stride_m * on + 0.012 * leg_m * stage.manner.step * noise[:, 0]
    across = sign * stage.half_width_m + 0.008 * leg_m * noise[:, 1]
    turn = np.sign(sign) * 0.08 + 0.03 * noise[:, 2]
    return follow_footprints(stage.bent, on, on + duty, np.stack([across, ahead], axis=1), turn)


def _swing_trunk(controls: Controls, stage: Stage, mid_stance: float, bob_m: float, yaw: float, roll: float) -> None:
    """Pelvis and chest turn against each other; the hips rise at mid-stance (or sink there, ``bob_m`` < 0)."""
    manner, phase = stage.manner, stage.bent
    controls.pelvis_m[:, 1] += abs(bob_m) * (1.0 - manner.bounce) * 0.5
    controls.pelvis_m[:, 1] += bob_m * manner.bounce * (wave(2.0 * (phase - mid_stance)) - 0.3)
    size = 1.0 + 0.10 * stage.wander[:, 7]
    controls.pelvis_rad[:, 2] += -yaw * manner.twist * size * wave(phase)
    controls.spine_rad[:, 2] += 2.0 * yaw * manner.twist * size * wave(phase - manner.lag)
    controls.head_rad[:, 2] -= 1.0 * yaw * manner.twist * size * wave(phase - manner.lag)
    controls.pelvis_rad[:, 1] += roll * min(manner.sway, 1.6) * wave(phase - mid_stance + 0.05)
    controls.spine_rad[:, 1] -= 1.1 * roll * min(manner.sway, 1.6) * wave(phase - mid_stance - manner.lag)
    controls.spine_rad[:, 0] += 0.02 * manner.bounce * wave(2.0 * (phase - mid_stance) + 0.3)


def _swing_arms(
    controls: Controls, stage: Stage, swing: float, middle: float, elbow: float, elbow_swing: float
) -> None:
    """Arms swing against the legs, the elbow bending as the arm comes forward."""
    manner = stage.manner
    late = stage.bent - manner.lag - 0.02
    size = 1.0 + 0.10 * stage.wander[:, 6]
    for side, sign, _ in _SIDES:
        gain = manner.arm * (1.0 + sign * manner.asymmetry) * size
        forward = -sign * wave(late)
        controls.arms_rad[:, side, FLEXION] += middle + swing * gain * forward
        behind = -sign * wave(late - 0.06)
        controls.arms_rad[:, side, ELBOW] += elbow - 0.28 + elbow_swing * gain * behind
        controls.arms_rad[:, side, ABDUCTION] += 0.05 * gain * wave(2.0 * late)
        controls.arms_rad[:, side, TWIST] += 0.12 * gain * forward


class _Path:
    """Positions or headings that move once a cycle between two places in it, and hold otherwise."""

    def __init__(self, first: int, keys: FloatArray, start: float, end: float) -> None:
        self._first, self._keys, self._start, self._end = first, keys, start, end

    def __call__(self, cycles: FloatArray) -> FloatArray:
        k = np.clip(np.floor(cycles).astype(int) - self._first, 0, len(self._keys) - 2)
        moved = ease((np.mod(cycles, 1.0) - self._start) / (self._end - self._start))
        moved = moved.reshape(moved.shape + (1,) * (self._keys.ndim - 1))
        return np.asarray(self._keys[k] + moved * (self._keys[k + 1] - self._keys[k]))


def _walk_and_turn(stage: Stage) -> tuple[tuple[Steps, Steps], _Path, _Path]:
    """Footprints of both feet, the path between them and the heading of a transition."""
    first, last = int(np.floor(stage.bent.min())) - 2, int(np.ceil(stage.bent.max())) + 3
    n = last - first
    step_m = (0.50 + 0.15 * stage.variant[1]) * stage.actor.leg_m * stage.manner.step
    turns = np.pi * (0.42 + 0.20 * stage.variant[0]) + 0.06 * stage.jitter[:n, 0]
    # The heading is 0 in the middle of the take, so that no take spins away from +Z further than it must.
    heading = np.concatenate([[0.0], np.cumsum(turns)])
    middle = int(np.floor(stage.bent[len(stage.bent) // 2])) - first
    heading -= heading[middle]
    lengths = step_m * (1.0 + 0.05 * stage.jitter[: n + 1, 1])
    ahead = np.stack([np.sin(heading), np.cos(heading)], axis=1)
    across = np.stack([np.cos(heading), -np.sin(heading)], axis=1) * stage.half_width_m
    centre = np.concatenate([np.zeros((1, 2)), np.cumsum(2.0 * lengths[:-1, None] * ahead[:-1], axis=0)])
    base = np.arange(first, last)[:, None]
    c, c_next, a, a_next = centre[:-1], centre[1:], across[:-1], across[1:]
    halfway = c + lengths[:-1, None] * ahead[:-1]
    left_xz = np.stack([c_next + a, c_next + a_next], axis=1)
    right_xz = np.stack([halfway - a, c_next - a, c_next - a_next], axis=1)
    left_turn = np.stack([heading[:-1], heading[1:]], axis=1) + 0.10
    right_turn = np.stack([heading[:-1], heading[:-1], heading[1:]], axis=1) - 0.10
    left = follow_footprints(
        stage.bent,
        (base + np.array([0.38, 0.75])).ravel(),
        (base + np.array([0.59, 1.19])).ravel(),
        left_xz.reshape(-1, 2),
        left_turn.ravel(),
    )
    right = follow_footprints(
        stage.bent,
        (base + np.array([0.19, 0.55, 0.92])).ravel(),
        (base + np.array([0.37, 0.75, 1.02])).ravel(),
        right_xz.reshape(-1, 2),
        right_turn.ravel(),
    )
    return (left, right), _Path(first, centre, 0.0, 0.56), _Path(first, heading, 0.56, 0.95)
