"""Manners and the eight styles: how a performance is done, apart from what is done and when.

A style never changes which action is performed or the phase of a performance that is rendered again; its tempo only
acts when a take is drawn. So a style must be recognisable from posture, amplitude, rhythm within the cycle, asymmetry,
oscillation of the trunk and noise. Names follow Xia et al. 2015.
"""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True)
class Manner:
    """Gains (neutral 1) multiply, offsets (neutral 0) add; angles in radians.

    Posture: spine (bend forward), head (nod forward), lean (pelvis forward), arms_out, elbow, crouch (share of leg
    length), width (gain on the distance between the feet), toe_out.
    Amplitude: step, lift (of the feet), arm, twist (trunk against pelvis), bounce, sway.
    Rhythm within a cycle: limp (one half of the cycle shorter), attack (each beat starts fast and lingers; negative
    drags), tempo (acts only when a take's phase is drawn).
    Asymmetry: left arm gain 1 + asymmetry, right arm 1 - asymmetry; drop (one-sided dip of the pelvis, share of leg).
    Oscillation in every action: bob (share of leg), nod, hips (roll), shoulders (twist), rock (spine fore and aft),
    tilt (head sideways), flap (arms out and in).
    Noise: tremor (hands, head, 4 to 6 Hz), wobble (trunk and arms, about 1 Hz).
    lag : how late hands and head follow, cycles.
    """

    spine: float = 0.0
    head: float = 0.0
    lean: float = 0.0
    arms_out: float = 0.0
    elbow: float = 0.0
    crouch: float = 0.0
    width: float = 1.0
    toe_out: float = 0.0
    step: float = 1.0
    lift: float = 1.0
    arm: float = 1.0
    twist: float = 1.0
    bounce: float = 1.0
    sway: float = 1.0
    limp: float = 0.0
    attack: float = 0.0
    tempo: float = 1.0
    asymmetry: float = 0.0
    drop: float = 0.0
    bob: float = 0.0
    nod: float = 0.0
    hips: float = 0.0
    shoulders: float = 0.0
    rock: float = 0.0
    tilt: float = 0.0
    flap: float = 0.0
    tremor: float = 0.0
    wobble: float = 0.0
    lag: float = 0.03


_GAINS = frozenset({"width", "step", "lift", "arm", "twist", "bounce", "sway", "tempo"})


def combined(manner: Manner, changes: dict[str, float]) -> Manner:
    """``manner`` with changes on top: gains multiply, offsets add."""
    values = {f.name: getattr(manner, f.name) for f in fields(Manner)}
    for name, change in changes.items():
        values[name] = values[name] * change if name in _GAINS else values[name] + change
    return Manner(**values)


STYLES: dict[str, Manner] = {
    "neutral": Manner(),
    "angry": Manner(
        spine=0.075, head=0.045, lean=0.038, arms_out=0.075, elbow=0.225, crouch=0.02,
        step=1.15, lift=1.30, arm=1.30, twist=1.6, bounce=1.3, sway=0.8,
        attack=0.45, tempo=1.10, shoulders=0.14, rock=0.07, tremor=0.010, lag=0.0,
    ),
    "childlike": Manner(
        spine=-0.022, head=-0.045, arms_out=0.15, elbow=0.075, width=1.1, toe_out=-0.08,
        step=0.92, lift=1.6, arm=1.40, twist=1.3, bounce=2.0, sway=1.4,
        tempo=1.08, bob=0.030, nod=0.07, tilt=0.15, flap=0.16, wobble=0.07, lag=0.07,
    ),
    "depressed": Manner(
        spine=0.128, head=0.165, lean=0.015, arms_out=-0.03, elbow=-0.06, crouch=0.015,
        step=0.72, lift=0.60, arm=0.45, twist=0.45, bounce=0.45, sway=1.1,
        attack=-0.35, tempo=0.88, nod=0.015, lag=0.10,
    ),
    "old": Manner(
        spine=0.15, head=-0.03, lean=0.03, arms_out=0.038, elbow=0.21, crouch=0.045, width=1.35, toe_out=0.12,
        step=0.66, lift=0.60, arm=0.60, twist=0.6, bounce=0.7, sway=1.5,
        limp=0.32, tempo=0.88, asymmetry=0.30, drop=0.022, tremor=0.032, lag=0.05,
    ),
    "proud": Manner(
        spine=-0.09, head=-0.06, lean=-0.015, arms_out=0.105, elbow=0.038, width=1.1, toe_out=0.10,
        step=1.10, lift=1.15, arm=0.85, twist=0.75, bounce=0.8, sway=0.5,
        attack=0.12, tempo=0.95, rock=-0.075, shoulders=0.02, lag=0.02,
    ),
    "sexy": Manner(
        spine=-0.03, head=0.0, arms_out=0.075, elbow=0.038, width=0.35, toe_out=0.04,
        step=1.02, lift=1.05, arm=1.05, twist=1.5, bounce=0.8, sway=2.2,
        attack=-0.12, tempo=0.95, hips=0.16, shoulders=-0.10, tilt=-0.06, lag=0.09,
    ),
    "strutting": Manner(
        spine=-0.038, head=-0.022, lean=-0.038, arms_out=0.06, elbow=0.09, width=1.15, toe_out=0.10,
        step=1.05, lift=1.10, arm=1.25, twist=1.2, bounce=1.5, sway=1.3,
        limp=-0.18, tempo=1.0, asymmetry=-0.40, drop=0.030, nod=0.12, shoulders=0.10, rock=0.03, lag=0.06,
    ),
}  # fmt: skip
