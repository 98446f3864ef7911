"""What a content sees of a performance, and the standing body it starts from."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bench.arrays import BoolArray, FloatArray
from bench.datasets.procedural.actors import Actor
from bench.datasets.procedural.controls import ABDUCTION, CURL, ELBOW, FLEXION, TWIST, WRIST, Controls
from bench.datasets.procedural.curves import bump, ease
from bench.datasets.procedural.styles import Manner


@dataclass(frozen=True, eq=False)
class Stage:
    """One performance in one manner, at T frames.

    Attributes
    ----------
    actor, manner : who and how; the manner already holds the person's habits.
    time_s : ``[T]``.
    steady, bent : ``[T]`` phase in cycles, as performed and with the style's rhythm within the cycle.
    period_s : nominal length of a cycle.
    variant : ``[8]`` uniform numbers of this performance.
    wander : ``[T, 8]`` slow noise, unit variance.
    jitter : ``[64, 4]`` standard normal numbers, one row a footprint.
    """

    actor: Actor
    manner: Manner
    time_s: FloatArray
    steady: FloatArray
    bent: FloatArray
    period_s: float
    variant: FloatArray
    wander: FloatArray
    jitter: FloatArray

    @property
    def half_width_m(self) -> float:
        """Half the distance between the feet when walking."""
        return 0.8 * self.actor.half_hips_m * self.manner.width

    @property
    def standing_m(self) -> float:
        """Height of the hips when standing in this manner."""
        return self.actor.hips_m - self.actor.leg_m * (0.02 + self.manner.crouch)


def standing(stage: Stage, half_width_m: float, ahead_m: tuple[float, float] = (0.0, 0.0)) -> Controls:
    """A standing body with hanging arms that breathes and shifts its weight; ``ahead_m`` places left and right foot."""
    n = len(stage.time_s)
    actor, manner = stage.actor, stage.manner
    pelvis = np.zeros((n, 3))
    pelvis[:, 0] = 0.012 * actor.leg_m * manner.sway * stage.wander[:, 1]
    pelvis[:, 1] = stage.standing_m
    pelvis[:, 2] = 0.5 * sum(ahead_m) + 0.008 * actor.leg_m * stage.wander[:, 2]
    ankles = np.zeros((n, 2, 3))
    ankles[:] = [[half_width_m, actor.ankle_m, ahead_m[0]], [-half_width_m, actor.ankle_m, ahead_m[1]]]
    arms = np.zeros((n, 2, 6))
    arms[..., FLEXION] = 0.03 + 0.03 * stage.wander[:, 3:5]
    arms[..., ABDUCTION] = 0.14
    arms[..., TWIST] = 0.25
    arms[..., ELBOW] = 0.28 + 0.04 * stage.wander[:, 5:7]
    arms[..., WRIST] = 0.1
    arms[..., CURL] = 0.3
    still = np.zeros((n, 3))
    feet = np.zeros((n, 2, 3))
    feet[..., 2] = [0.12, -0.12]
    spine = still.copy()
    spine[:, 1] = 0.015 * manner.sway * stage.wander[:, 1]
    return Controls(pelvis, still.copy(), spine, still.copy(), arms, ankles, feet, np.ones((n, 2)), np.zeros((n, 2)))


@dataclass(frozen=True, eq=False)
class Steps:
    """A foot on its footprints over time.

    Attributes
    ----------
    ankle_xz_m, turn_rad : ``[T, 2]`` and ``[T]``: exactly constant while planted.
    swing : ``[T]`` 0 to 1 through the air, 0 while planted.
    since_on, until_off : ``[T]`` cycles since the foot came down, until it lifts; 0 while in the air.
    planted : ``[T]``.
    """

    ankle_xz_m: FloatArray
    turn_rad: FloatArray
    swing: FloatArray
    since_on: FloatArray
    until_off: FloatArray
    planted: BoolArray


def follow_footprints(
    cycles: FloatArray, on: FloatArray, off: FloatArray, xz_m: FloatArray, turn_rad: FloatArray
) -> Steps:
    """Stand on footprint k from ``on[k]`` to ``off[k]`` (ascending, in cycles), swing to the next one after that."""
    k = np.clip(np.searchsorted(on, cycles, side="right") - 1, 0, len(on) - 2)
    planted = cycles <= off[k]
    swing = np.where(planted, 0.0, (cycles - off[k]) / (on[k + 1] - off[k]))
    moved = ease(swing)
    return Steps(
        xz_m[k] + moved[:, None] * (xz_m[k + 1] - xz_m[k]),
        turn_rad[k] + moved * (turn_rad[k + 1] - turn_rad[k]),
        swing,
        np.where(planted, cycles - on[k], 0.0),
        np.where(planted, off[k] - cycles, 0.0),
        planted,
    )


@dataclass(frozen=True)
class Roll:
    """How a foot rolls: heel up before it lifts, toe up before it comes down. Radians; durations in cycles."""

    heel_up_rad: float
    toe_up_rad: float
    rise: float
    land: float


def place_foot(controls: Controls, side: int, steps: Steps, lift_m: float, peak: float, roll: Roll) -> None:
    """Put a foot on its steps: lift, roll over heel and toe, pivot."""
    heel = np.where(steps.planted, ease(1.0 - steps.until_off / roll.rise), 1.0 - ease(steps.swing / 0.62))
    heel += np.where(steps.planted, 0.0, 0.35 * bump(steps.swing / 0.5))
    toe = np.where(steps.planted, 1.0 - ease(steps.since_on / roll.land), ease((steps.swing - 0.5) / 0.4))
    controls.feet_rad[:, side, 0] = roll.heel_up_rad * heel - roll.toe_up_rad * toe
    controls.feet_rad[:, side, 2] = steps.turn_rad
    about_ankle = np.where(steps.planted, steps.until_off > roll.rise, ease((steps.swing - 0.3) / 0.5))
    controls.pivot[:, side] = 1.0 - about_ankle
    controls.ankles_m[:, side, 0] = steps.ankle_xz_m[:, 0]
    controls.ankles_m[:, side, 2] = steps.ankle_xz_m[:, 1]
    # The second term lifts the toe clear while the heel still comes down.
    controls.ankles_m[:, side, 1] += lift_m * bump(steps.swing, peak)
    controls.swing[:, side] = bump(steps.swing)
