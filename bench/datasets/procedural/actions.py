"""Jump, kick and punch."""

from __future__ import annotations

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.procedural.controls import ABDUCTION, CURL, ELBOW, FLEXION, LEFT, RIGHT, TWIST, WRIST, Controls
from bench.datasets.procedural.curves import bump, ease, hermite, key_poses
from bench.datasets.procedural.stage import Stage, follow_footprints, standing

GRAVITY_M_S2 = 9.81


def jump(stage: Stage) -> Controls:
    """Crouch, leap forward, land, stand up. The time in the air decides the height, by gravity."""
    manner, leg_m = stage.manner, stage.actor.leg_m
    air_s = (0.36 + 0.10 * stage.variant[0]) * np.clip(manner.bounce**0.10 * manner.step**0.5, 0.7, 1.12)
    air = float(air_s / stage.period_s)
    leave, land = 0.43, 0.43 + air
    controls = standing(stage, 1.1 * stage.half_width_m)
    rise_m = _jump_height(controls, stage, leave, land)
    n_jumps = np.arange(np.floor(stage.steady.min()) - 2, np.ceil(stage.steady.max()) + 3)
    far_m = (0.15 + 0.45 * stage.variant[1]) * leg_m * manner.step
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        place = np.stack([np.full(len(n_jumps), sign * 1.1 * stage.half_width_m), far_m * n_jumps], axis=1)
        on, off = n_jumps - 1.0 + land, n_jumps + leave
        steps = follow_footprints(stage.steady, on, off, place, np.full(len(on), sign * 0.12))
        controls.ankles_m[:, side, [0, 2]] = steps.ankle_xz_m
        tuck_m = leg_m * (0.05 + 0.12 * stage.variant[2]) * manner.lift**0.5
        controls.ankles_m[:, side, 1] += rise_m + tuck_m * bump(steps.swing)
        u = np.mod(stage.steady, 1.0)
        toes = ease((u - leave + 0.10) / 0.10) * (1.0 - ease((u - leave) / (0.8 * air)))
        controls.feet_rad[:, side, 0] = 0.65 * toes
        controls.swing[:, side] = bump(steps.swing) ** 0.25
    share = _jump_travel(stage, leave, land)
    controls.pelvis_m[:, 2] += far_m * (np.floor(stage.steady) + share)
    _jump_upper_body(controls, stage, leave, land)
    return controls


def _jump_height(controls: Controls, stage: Stage, leave: float, land: float) -> FloatArray:
    """Set the height of the hips; return how far a body in flight is above where it left the ground, ``[T]``."""
    manner, leg_m = stage.manner, stage.actor.leg_m
    depth_m = leg_m * float(np.clip((0.20 + 0.08 * stage.variant[3]) * manner.arm**0.5, 0.13, 0.36))
    sink_m = depth_m * (0.75 + 0.1 * stage.variant[4])
    low = 0.27 + 0.06 * np.clip(manner.attack, -1.0, 1.0)
    speed = GRAVITY_M_S2 * (land - leave) * stage.period_s / 2.0 * stage.period_s
    leave_m = stage.actor.hips_m + 0.035 * leg_m
    stand_m = stage.standing_m
    absorb = land + 0.11
    places = [0.0, 0.06, low, leave, land, absorb, min(absorb + 0.20, 0.97), 1.0]
    heights = [stand_m, stand_m, stand_m - depth_m, leave_m, leave_m, stand_m - sink_m, stand_m, stand_m]
    slopes = [0.0, 0.0, 0.0, speed, -speed, 0.0, 0.0, 0.0]
    controls.pelvis_m[:, 1] = hermite(stage.steady, places, heights, slopes)
    u = np.mod(stage.steady, 1.0)
    flying = (u > leave) & (u < land)
    seconds = (u - leave) * stage.period_s
    flight_s = (land - leave) * stage.period_s
    # Exact: the cubic through this segment's ends with slopes +-speed is the ballistic parabola.
    return np.where(flying, 0.5 * GRAVITY_M_S2 * seconds * (flight_s - seconds), 0.0)


def _jump_travel(stage: Stage, leave: float, land: float) -> FloatArray:
    """Share of the jump's distance covered by the hips within a cycle; constant speed in the air."""
    speed = 0.64 / (land - leave)
    places = [0.0, leave - 0.13, leave, land, land + 0.16, 1.0]
    return hermite(stage.steady, places, [0.0, 0.0, 0.18, 0.82, 1.0, 1.0], [0.0, 0.0, speed, speed, 0.0, 0.0])


def _jump_upper_body(controls: Controls, stage: Stage, leave: float, land: float) -> None:
    manner = stage.manner
    late = stage.steady - 0.4 * manner.lag
    bend = key_poses(
        stage.steady, ((0.05, 0.0), (0.27, 1.0), (leave, -0.12), (land, 0.08), (land + 0.12, 0.75), (0.95, 0.0))
    )
    arms = key_poses(
        late, ((0.04, 0.0), (0.25, -0.75), (leave + 0.03, 1.5), (land, 0.9), (land + 0.13, -0.1), (0.96, 0.0))
    )
    controls.pelvis_rad[:, 0] += 0.38 * bend
    controls.spine_rad[:, 0] += 0.35 * bend
    controls.pelvis_m[:, 2] -= 0.10 * stage.actor.leg_m * np.clip(bend, 0.0, None)
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        gain = manner.arm**0.8 * (1.0 + sign * manner.asymmetry)
        controls.arms_rad[:, side, FLEXION] += gain * arms * (0.9 + 0.3 * stage.variant[5])
        controls.arms_rad[:, side, ELBOW] += 0.25 + 0.30 * gain * np.abs(arms)
        controls.arms_rad[:, side, ABDUCTION] += 0.10 * gain * np.abs(arms)


def _guard(controls: Controls, tightness: float) -> None:
    """Fists before the chin."""
    arms = controls.arms_rad
    arms[..., FLEXION] += 0.45 * tightness
    arms[..., ELBOW] += 1.65 * tightness
    arms[..., TWIST] += 0.15
    arms[..., CURL] = 1.2


def kick(stage: Stage) -> Controls:
    """Front kick with the right leg: shift weight, chamber, extend, chamber, set down, guard."""
    manner, leg_m, phase = stage.manner, stage.actor.leg_m, stage.bent
    wide_m, behind_m = 1.0 * stage.half_width_m, (0.20 + 0.12 * stage.variant[1]) * leg_m
    controls = standing(stage, wide_m, (0.10 * leg_m, -behind_m))
    _guard(controls, 0.55 + 0.35 * stage.variant[2])
    high_m = leg_m * (0.62 + 0.28 * stage.variant[0]) * float(np.clip(manner.lift**0.4 * manner.arm**0.3, 0.55, 1.25))
    far_m = leg_m * 0.80 * float(np.clip(manner.step**0.3, 0.8, 1.05))
    ankle = controls.ankles_m[:, RIGHT]
    fold_m = min(0.52 * leg_m, 0.8 * high_m)
    up = key_poses(phase, ((0.12, 0.0), (0.30, 1.0), (0.40, 0.0), (0.43, 0.0), (0.54, 1.0), (0.76, 0.0)))
    out = key_poses(phase, ((0.28, 0.0), (0.405, 1.0), (0.425, 1.0), (0.545, 0.0)))
    bring = key_poses(phase, ((0.12, 0.0), (0.30, 1.0), (0.54, 1.0), (0.76, 0.0)))
    ankle[:, 1] += fold_m * up * (1.0 - out) + high_m * out
    ankle[:, 2] += bring * (behind_m + 0.05 * leg_m) + out * far_m
    ankle[:, 0] += bring * 0.6 * wide_m
    controls.feet_rad[:, RIGHT, 0] = 0.55 * key_poses(
        phase, ((0.12, 0.0), (0.26, 1.0), (0.41, 0.1), (0.54, 0.9), (0.70, 0.1), (0.76, 0.0))
    )
    controls.feet_rad[:, RIGHT, 2] = -0.30 * (1.0 - bring)
    controls.swing[:, RIGHT] = ease(2.0 * bring)
    _kick_body(controls, stage, out, wide_m)
    return controls


def _kick_body(controls: Controls, stage: Stage, out: FloatArray, wide_m: float) -> None:
    manner, leg_m, phase = stage.manner, stage.actor.leg_m, stage.bent
    shift = key_poses(phase, ((0.0, 0.0), (0.20, 1.0), (0.60, 1.0), (0.85, 0.0)))
    controls.pelvis_m[:, 0] += shift * 0.85 * wide_m
    controls.pelvis_m[:, 2] += shift * 0.13 * leg_m
    controls.pelvis_m[:, 1] -= leg_m * (0.015 + 0.02 * shift + 0.015 * manner.bounce * (1.0 - shift))
    controls.pelvis_rad[:, 0] -= 0.30 * out * manner.arm**0.3
    controls.spine_rad[:, 0] += 0.10 * shift + 0.08 * out
    controls.pelvis_rad[:, 2] += manner.twist**0.5 * (0.35 * out - 0.15 * (1.0 - shift))
    controls.spine_rad[:, 2] -= manner.twist * 0.35 * out
    controls.pelvis_rad[:, 1] -= 0.10 * shift
    counter = key_poses(phase - manner.lag, ((0.10, 0.0), (0.30, -0.25), (0.42, 1.0), (0.58, 0.3), (0.80, 0.0)))
    for side, sign, size in ((LEFT, 1.0, 0.30), (RIGHT, -1.0, -0.75)):
        gain = manner.arm * (1.0 + sign * manner.asymmetry)
        controls.arms_rad[:, side, FLEXION] += size * gain * counter
        controls.arms_rad[:, side, ELBOW] -= 0.45 * gain * counter
        controls.arms_rad[:, side, ABDUCTION] += 0.25 * gain * np.clip(counter, 0.0, None)


def punch(stage: Stage) -> Controls:
    """A cross of the right hand and a jab of the left each cycle, out of a guard; the hips turn with the fist."""
    manner, leg_m, phase = stage.manner, stage.actor.leg_m, stage.bent
    controls = standing(stage, 1.1 * stage.half_width_m, (0.22 * leg_m, -0.22 * leg_m))
    controls.feet_rad[..., 2] += [-0.10, -0.35]
    controls.pelvis_m[:, 1] -= 0.045 * leg_m
    _guard(controls, 1.0)
    jab = 0.25 + 0.75 * stage.variant[0]
    strikes = ((RIGHT, -1.0, 0.0, 1.0), (LEFT, 1.0, 0.5, jab))
    for side, sign, place, size in strikes:
        hit = key_poses(phase - place, ((0.04, 0.0), (0.13, -0.12), (0.24, 1.0), (0.29, 0.96), (0.48, 0.0)))
        drive = key_poses(phase - place + 0.03, ((0.04, 0.0), (0.13, -0.2), (0.25, 1.0), (0.48, 0.0)))
        gain = size * float(np.clip(manner.arm**0.5, 0.6, 1.15)) * (1.0 + 0.5 * sign * manner.asymmetry)
        arm = controls.arms_rad[:, side]
        arm[:, FLEXION] += (0.80 + 0.25 * stage.variant[1]) * gain * hit
        arm[:, ELBOW] -= 1.75 * min(gain, 1.0) * hit
        arm[:, TWIST] += 0.3 * gain * hit
        arm[:, ABDUCTION] += 0.10 * gain * hit
        arm[:, WRIST] -= 0.1 * hit
        controls.pelvis_rad[:, 2] -= sign * 0.30 * size * manner.twist**0.7 * drive
        controls.spine_rad[:, 2] -= sign * 0.45 * size * manner.twist**0.7 * drive
        controls.head_rad[:, 2] += sign * 0.65 * size * manner.twist**0.7 * drive
        controls.pelvis_m[:, 2] += 0.06 * leg_m * manner.step * size * drive
        controls.pelvis_m[:, 1] -= 0.012 * leg_m * manner.bounce * size * drive
        controls.spine_rad[:, 0] += 0.08 * size * drive
    # The rear heel comes up as the cross goes out.
    rear = key_poses(phase, ((0.02, 0.15), (0.12, 0.2), (0.25, 1.0), (0.50, 0.15)))
    controls.feet_rad[:, RIGHT, 0] = 0.45 * float(np.clip(manner.lift**0.5, 0.6, 1.2)) * rear
    return controls
