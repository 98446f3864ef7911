"""Synthetic actors: proportions and small personal habits."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.procedural.seeds import generator
from bench.motion.skeleton import CANONICAL_NAMES, Skeleton, canonical_skeleton

N_ACTORS = 12
"""Actors of the dataset are ``actor-1`` .. ``actor-12``; any other name is an unseen actor."""
ACTORS = tuple(f"actor-{number}" for number in range(1, N_ACTORS + 1))

# Shares of the body height: one row a bone, as offset in the T-pose; left side, mirrored for the right.
_CENTRE_SHARES = {
    "Spine": (0.0, 0.060, -0.004),
    "Spine1": (0.0, 0.135, 0.0),
    "Neck1": (0.0, 0.115, 0.004),
    "Head": (0.0, 0.062, 0.012),
}
_SIDE_SHARES = {
    "UpLeg": (0.052, -0.010, 0.0),
    "Leg": (0.0, -0.243, 0.0),
    "Foot": (0.0, -0.243, 0.0),
    "ToeBase": (0.012, -0.045, 0.085),
    "Arm": (0.106, 0.078, -0.004),
    "ForeArm": (0.163, 0.0, 0.0),
    "Hand": (0.145, 0.0, 0.0),
    "HandIndex1": (0.055, 0.0, 0.0),
}


@dataclass(frozen=True, eq=False)
class Actor:
    """A synthetic actor.

    Attributes
    ----------
    name : unique; decides everything else.
    height_m : body height, 1.55 to 1.90 m (the top of the head; the Head joint lies lower).
    skeleton : canonical 21 joints, legs straight down, toes at floor height in the T-pose.
    habits : ``[12]`` standard normal numbers, scaled to personal offsets of tempo, amplitude and posture.
    """

    name: str
    height_m: float
    skeleton: Skeleton
    habits: FloatArray

    @cached_property
    def thigh_m(self) -> float:
        return float(self.skeleton.bone_lengths_m[2])

    @cached_property
    def shank_m(self) -> float:
        return float(self.skeleton.bone_lengths_m[3])

    @cached_property
    def leg_m(self) -> float:
        """Hip joint to ankle, straight."""
        return self.thigh_m + self.shank_m

    @cached_property
    def ankle_m(self) -> float:
        """Height of the ankle over the floor on a flat foot."""
        return float(-self.skeleton.offsets_m[4, 1])

    @cached_property
    def hips_m(self) -> float:
        """Height of the Hips joint over the floor in the T-pose."""
        return float(self.leg_m + self.ankle_m - self.skeleton.offsets_m[1, 1])

    @cached_property
    def half_hips_m(self) -> float:
        return float(self.skeleton.offsets_m[1, 0])


def make_actor(name: str) -> Actor:
    """The actor of that name; the same name always gives the same body and habits."""
    rng = generator("actor", name)
    # The dataset's own actors are spread evenly over the range, so that they cover it.
    share = (ACTORS.index(name) + 0.5) / N_ACTORS if name in ACTORS else float(rng.uniform())
    height_m = 1.55 + 0.35 * share
    legs, trunk, arms, hips, shoulders, foot = 1.0 + rng.uniform(-0.05, 0.05, 6)
    width = {"UpLeg": hips, "Leg": legs, "Foot": legs * (2.0 - hips), "ToeBase": foot, "Arm": shoulders}
    offsets = np.zeros((len(CANONICAL_NAMES), 3))
    for joint, bone in enumerate(CANONICAL_NAMES[1:], start=1):
        if bone in _CENTRE_SHARES:
            offsets[joint] = height_m * trunk * np.asarray(_CENTRE_SHARES[bone])
        else:
            side, part = (1.0, bone.removeprefix("Left")) if bone.startswith("Left") else (-1.0, bone[5:])
            share_xyz = np.asarray(_SIDE_SHARES[part]) * [side, 1.0, 1.0]
            offsets[joint] = height_m * width.get(part, arms) * share_xyz
    return Actor(name, height_m, canonical_skeleton(offsets), rng.standard_normal(12))
