"""Skeletons: joint names, tree, rest offsets. The canonical 21 joints on which everything is scored.

The canonical skeleton is the 21-joint CMU cut of Park 2021, Motion Puzzle and Style-ERD: joint names
and order are fixed, each clip keeps its own bone lengths. Its rest pose (all rotations identity) is a T-pose: Y up,
facing +Z, left arm along +X, legs straight down.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from bench.arrays import FloatArray, finite_array, read_only
from bench.errors import BadMotion

CANONICAL_NAMES = (
    "Hips",
    "LeftUpLeg", "LeftLeg", "LeftFoot", "LeftToeBase",
    "RightUpLeg", "RightLeg", "RightFoot", "RightToeBase",
    "Spine", "Spine1", "Neck1", "Head",
    "LeftArm", "LeftForeArm", "LeftHand", "LeftHandIndex1",
    "RightArm", "RightForeArm", "RightHand", "RightHandIndex1",
)  # fmt: skip
CANONICAL_PARENTS = (-1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 10, 13, 14, 15, 10, 17, 18, 19)
N_JOINTS = len(CANONICAL_NAMES)

HIPS, HEAD = 0, 12
LEFT_UP_LEG, LEFT_LEG, LEFT_FOOT, LEFT_TOE = 1, 2, 3, 4
RIGHT_UP_LEG, RIGHT_LEG, RIGHT_FOOT, RIGHT_TOE = 5, 6, 7, 8
SPINE, SPINE1, NECK = 9, 10, 11
LEFT_ARM, LEFT_FOREARM, LEFT_HAND, LEFT_FINGER = 13, 14, 15, 16
RIGHT_ARM, RIGHT_FOREARM, RIGHT_HAND, RIGHT_FINGER = 17, 18, 19, 20

PARTS: dict[str, tuple[int, ...]] = {
    "left_leg": (1, 2, 3, 4),
    "right_leg": (5, 6, 7, 8),
    "spine": (0, 9, 10, 11, 12),
    "left_arm": (13, 14, 15, 16),
    "right_arm": (17, 18, 19, 20),
    "legs": tuple(range(1, 9)),
    "arms": tuple(range(13, 21)),
    "all": tuple(range(N_JOINTS)),
}
"""Body parts of the canonical joints (Motion Puzzle, Table 1 caption); legs, arms and all are unions."""

MIRROR_JOINTS = (0, 5, 6, 7, 8, 1, 2, 3, 4, 9, 10, 11, 12, 17, 18, 19, 20, 13, 14, 15, 16)
"""For each canonical joint the joint on the other side."""


@dataclass(frozen=True, eq=False)
class Skeleton:
    """A tree of joints with rest offsets.

    Attributes
    ----------
    names : joint names, the root first, parents before children.
    parents : index of each joint's parent, -1 for the root.
    offsets_m : ``[J, 3]`` offset from the parent in the rest pose, metres; the root's row is zero.
    virtual : names of joints that the source did not have and that were placed rigidly.
    """

    names: tuple[str, ...]
    parents: tuple[int, ...]
    offsets_m: FloatArray
    virtual: frozenset[str] = field(default_factory=frozenset)

    def __post_init__(self) -> None:
        n = len(self.names)
        if n == 0 or len(self.parents) != n or len(set(self.names)) != n:
            raise BadMotion(f"a skeleton needs unique names with one parent each, got {n} names, {len(self.parents)}")
        if self.parents[0] != -1 or any(not 0 <= p < j for j, p in enumerate(self.parents) if j > 0):
            raise BadMotion("parents must come before their children and joint 0 must be the only root")
        if not self.virtual <= set(self.names):
            raise BadMotion(f"virtual joints {sorted(self.virtual - set(self.names))} are not joints of the skeleton")
        offsets = finite_array(self.offsets_m, "offsets_m", (n, 3))
        object.__setattr__(self, "offsets_m", read_only(offsets.copy()))

    @property
    def n_joints(self) -> int:
        return len(self.names)

    @property
    def is_canonical(self) -> bool:
        """True where joint names and order are the canonical 21."""
        return self.names == CANONICAL_NAMES

    @cached_property
    def bone_lengths_m(self) -> FloatArray:
        """``[J]`` length of the bone from each joint's parent; 0 for the root."""
        return np.asarray(np.linalg.norm(self.offsets_m, axis=1))

    @cached_property
    def rest_positions_m(self) -> FloatArray:
        """``[J, 3]`` joint positions with all rotations identity and the root at the origin."""
        positions = np.zeros((self.n_joints, 3))
        for joint, parent in enumerate(self.parents):
            if parent >= 0:
                positions[joint] = positions[parent] + self.offsets_m[joint]
        return positions

    @cached_property
    def stature_m(self) -> float:
        """Rest height of Head over the lower toe, metres: the length by which positions are normalised.

        Raises
        ------
        BadMotion : the skeleton is not canonical or stands on its head.
        """
        if not self.is_canonical:
            raise BadMotion("stature is defined on the canonical 21 joints", remedy="retarget the clip first")
        heights = self.rest_positions_m[:, 1]
        stature = float(heights[HEAD] - min(heights[LEFT_TOE], heights[RIGHT_TOE]))
        if stature <= 0.0:
            raise BadMotion(f"rest height of Head over Toes must be positive, got {stature:.3f} m")
        return stature

    @cached_property
    def real_joints(self) -> tuple[int, ...]:
        """Indices of joints that are not virtual."""
        return tuple(j for j, name in enumerate(self.names) if name not in self.virtual)

    @cached_property
    def identity(self) -> tuple[tuple[str, ...], tuple[int, ...], bytes, frozenset[str]]:
        """Equal for skeletons that are the same to the last bit; usable as a key."""
        return self.names, self.parents, self.offsets_m.tobytes(), self.virtual

    def same_bones(self, other: Skeleton, tolerance_m: float = 1e-4) -> bool:
        """True where both have the same joints in the same order with offsets equal to ``tolerance_m``."""
        return (
            self.names == other.names
            and self.parents == other.parents
            and bool(np.allclose(self.offsets_m, other.offsets_m, rtol=0.0, atol=tolerance_m))
        )


def canonical_skeleton(offsets_m: FloatArray, virtual: frozenset[str] = frozenset()) -> Skeleton:
    """The canonical 21-joint skeleton with the given rest offsets ``[21, 3]`` (T-pose, metres)."""
    return Skeleton(CANONICAL_NAMES, CANONICAL_PARENTS, offsets_m, virtual)
