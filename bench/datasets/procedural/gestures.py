"""Standing gestures: wave, point, clap, and the beats that go with talking."""

from __future__ import annotations

import numpy as np

from bench.datasets.procedural.controls import ABDUCTION, CURL, ELBOW, FLEXION, LEFT, RIGHT, TWIST, WRIST, Controls
from bench.datasets.procedural.curves import TAU, ease, key_poses, wave
from bench.datasets.procedural.stage import Stage, standing


def _stand(stage: Stage) -> Controls:
    split_m = 0.10 * (stage.variant[7] - 0.5) * stage.actor.leg_m
    return standing(stage, 1.25 * stage.half_width_m, (split_m, -split_m))


def wave_hand(stage: Stage) -> Controls:
    """The right hand is up and waves from the elbow, once a cycle; hand follows forearm."""
    manner, phase = stage.manner, stage.bent
    controls = _stand(stage)
    swing = np.sin(TAU * phase) * (1.0 + 0.15 * stage.wander[:, 3])
    late = np.sin(TAU * (phase - 0.08 - manner.lag))
    gain = float(np.clip(manner.arm, 0.35, 1.6)) * (1.0 - 0.3 * manner.asymmetry)
    arm = controls.arms_rad[:, RIGHT]
    raised = 0.85 + 0.55 * stage.variant[0] + 0.25 * (manner.arm - 1.0)
    arm[:, FLEXION] = 0.35 + 0.35 * stage.variant[1] + 0.10 * stage.wander[:, 4]
    arm[:, ABDUCTION] = raised + 0.10 * gain * late + 0.08 * stage.wander[:, 5]
    arm[:, TWIST] = -1.25 + 0.20 * gain * swing
    arm[:, ELBOW] = 1.35 + 0.42 * gain * swing
    arm[:, WRIST] = 0.30 * gain * late
    arm[:, CURL] = 0.1
    controls.spine_rad[:, 1] += 0.05 + 0.035 * manner.sway**0.5 * late
    controls.spine_rad[:, 2] += -0.06 + 0.04 * manner.twist * swing
    controls.head_rad[:, 1] += 0.05 + 0.03 * late
    controls.arms_rad[:, LEFT, FLEXION] += 0.05 * gain * late
    return controls


def point(stage: Stage) -> Controls:
    """The right arm rises to point somewhere ahead, stresses it once and sinks again; trunk and head turn along."""
    manner, phase = stage.manner, stage.bent
    controls = _stand(stage)
    up = key_poses(phase, ((0.02, 0.0), (0.24, 1.0), (0.34, 0.93), (0.42, 1.05), (0.56, 1.0), (0.84, 0.0)))
    hand = key_poses(phase - 0.03 - 0.5 * manner.lag, ((0.04, 0.0), (0.26, 1.0), (0.56, 1.0), (0.86, 0.0)))
    gain = float(np.clip(manner.arm**0.4, 0.65, 1.2)) * (1.0 - 0.3 * manner.asymmetry)
    aside = -0.25 + 0.95 * stage.variant[0]
    arm = controls.arms_rad[:, RIGHT]
    arm[:, FLEXION] += (1.20 + 0.35 * stage.variant[1]) * gain * up
    arm[:, ABDUCTION] += aside * up
    arm[:, ELBOW] += 0.55 * up * (1.0 - up) * 4.0 * 0.5 - 0.12 * hand
    arm[:, WRIST] += 0.35 * (up - hand)
    arm[:, CURL] -= 0.25 * hand
    controls.spine_rad[:, 2] -= 0.5 * (aside - 0.1) * up * manner.twist**0.5
    controls.head_rad[:, 2] -= 0.55 * aside * key_poses(phase + 0.05, ((0.0, 0.0), (0.2, 1.0), (0.6, 1.0), (0.85, 0.0)))
    controls.spine_rad[:, 0] += 0.07 * up * manner.bounce**0.5
    controls.pelvis_m[:, 2] += 0.03 * stage.actor.leg_m * up * manner.step
    controls.pelvis_m[:, 0] += -0.02 * stage.actor.leg_m * up * manner.sway**0.5
    controls.arms_rad[:, LEFT, FLEXION] -= 0.08 * manner.arm * up
    return controls


def clap(stage: Stage) -> Controls:
    """Hands meet before the chest at each whole cycle."""
    manner, phase, actor = stage.manner, stage.bent, stage.actor
    controls = _stand(stage)
    apart = (0.5 - 0.5 * wave(phase)) ** 0.8
    height = 0.30 + 0.45 * stage.variant[0]
    forearm_m = float(actor.skeleton.bone_lengths_m[14:16].sum()) * 0.92
    shoulder_m = float(actor.skeleton.offsets_m[13, 0])
    gain = float(np.clip(manner.arm, 0.4, 1.5))
    for side, sign in ((LEFT, 1.0), (RIGHT, -1.0)):
        arm = controls.arms_rad[:, side]
        arm[:, FLEXION] = height + 0.06 * stage.wander[:, 3] + 0.06 * gain * wave(phase + 0.1)
        arm[:, ABDUCTION] = 0.10 + 0.18 * gain * apart * (1.0 + 0.5 * sign * manner.asymmetry)
        arm[:, ELBOW] = 1.35 + 0.15 * stage.variant[1] - 0.12 * gain * apart
        # Inward twist at which the hands just meet, from the shoulder's distance and the forearm's reach.
        elbow_out_m = shoulder_m + float(actor.skeleton.bone_lengths_m[14]) * np.sin(0.10 + manner.arms_out)
        meet = np.arcsin(np.clip((elbow_out_m - 0.02) / (forearm_m * np.sin(1.4)), 0.0, 0.95))
        arm[:, TWIST] = meet - 0.60 * gain * apart
        arm[:, WRIST] = -0.15 + 0.20 * gain * wave(phase - 0.06 - manner.lag)
        arm[:, CURL] = 0.1
    controls.spine_rad[:, 0] += 0.03 * manner.bounce * wave(phase - 0.05)
    controls.head_rad[:, 0] += 0.03 * manner.bounce * wave(phase - 0.12)
    controls.pelvis_m[:, 1] -= 0.004 * actor.leg_m * manner.bounce * (1.0 + wave(phase - 0.05))
    return controls


def beat(stage: Stage) -> Controls:
    """Both forearms before the body, stressing words: strokes of changing size, one hand or both."""
    manner, phase = stage.manner, stage.bent
    controls = _stand(stage)
    late = phase - 0.5 * manner.lag
    for side, sign, place in ((LEFT, 1.0, 0.05 + 0.4 * stage.variant[0]), (RIGHT, -1.0, 0.0)):
        arm = controls.arms_rad[:, side]
        stroke = key_poses(late - place, ((0.0, 1.0), (0.18, -0.9), (0.30, -0.6), (0.62, 0.2)))
        size = ease(0.55 + 0.30 * stage.wander[:, 3 if side == LEFT else 4] - 0.12 * sign)
        gain = float(np.clip(manner.arm, 0.35, 1.6)) * (1.0 + sign * manner.asymmetry)
        open_out = 0.18 * stage.wander[:, 5 if side == LEFT else 6]
        arm[:, FLEXION] += 0.18 + 0.10 * stage.variant[1] + 0.22 * gain * size * stroke
        arm[:, ELBOW] += 0.95 + 0.25 * stage.variant[2] + 0.40 * gain * size * stroke
        arm[:, TWIST] += 0.15 - gain * open_out - 0.25 * gain * size * stroke
        arm[:, ABDUCTION] += 0.06 + 0.06 * gain * size * stroke
        arm[:, WRIST] += -0.25 * gain * size * key_poses(late - place - 0.06, ((0.0, 1.0), (0.2, -1.0), (0.6, 0.1)))
        controls.spine_rad[:, 2] += sign * 0.05 * manner.twist * size * stroke
    controls.head_rad[:, 0] += 0.05 * manner.bounce**0.5 * wave(phase - 0.15) * ease(0.5 + 0.4 * stage.wander[:, 5])
    controls.head_rad[:, 2] += 0.10 * stage.wander[:, 7]
    controls.head_rad[:, 1] += 0.04 * stage.wander[:, 6]
    return controls
