"""The three graphs of a body, 21, 10 and 5 nodes, their parts, and how one is pooled into the next.

Jang et al. 2022, section 4.1, figures 3 and 4. Where paper and released code disagree, ``faithful_to_code`` chooses:

- the paper pools "only within the same body part"; the code lets neighbouring groups share the root, the upper spine,
  and at the second level the lower spine, so that what happens in one part reaches another;
- the paper divides by the size of each subset of neighbours, the code by that of the whole neighbourhood.
"""

from __future__ import annotations

from dataclasses import dataclass

from bench.arrays import FloatArray
from bench.motion.skeleton import CANONICAL_PARENTS
from classifiers.graph import distance_partition

PART_NAMES = ("left_leg", "right_leg", "spine", "left_arm", "right_arm")
JOINT_PARTS = ((1, 2, 3, 4), (5, 6, 7, 8), (0, 9, 10, 11, 12), (13, 14, 15, 16), (17, 18, 19, 20))
MID_PARTS = ((0, 1), (2, 3), (4, 5), (6, 7), (8, 9))
PART_PARTS = ((0,), (1,), (2,), (3,), (4,))

MID_PARENTS = (4, 0, 4, 2, -1, 4, 4, 6, 4, 8)
"""Of the 10 nodes: legs and arms hang from the lower spine."""
PART_PARENTS = (2, 2, -1, 2, 2)

JOINT_TO_MID = ((1, 2), (3, 4), (5, 6), (7, 8), (0, 9), (10, 11, 12), (13, 14), (15, 16), (17, 18), (19, 20))
MID_TO_PART = ((0, 1), (2, 3), (4, 5), (6, 7), (8, 9))
JOINT_TO_MID_OF_CODE = (
    (0, 1, 2), (2, 3, 4), (0, 5, 6), (6, 7, 8), (0, 9, 10), (10, 11, 12), (10, 13, 14), (14, 15, 16), (10, 17, 18),
    (18, 19, 20),
)  # fmt: skip
MID_TO_PART_OF_CODE = ((0, 1, 4), (2, 3, 4), (4, 5), (6, 7, 4), (8, 9, 4))


@dataclass(frozen=True, eq=False)
class Level:
    """One graph.

    Attributes
    ----------
    partition : ``[K, V, V]`` subsets of neighbours by distance, K = 3, 2, 2.
    parts : nodes of the left leg, right leg, spine, left arm, right arm.
    kernel : frames of the temporal convolutions.
    """

    partition: FloatArray
    parts: tuple[tuple[int, ...], ...]
    kernel: int


def levels(*, faithful_to_code: bool) -> tuple[Level, Level, Level]:
    """Graphs of 21 joints, 10 and 5 nodes; hops 2, 1, 1; kernels 7, 5, 5 (Table 3)."""
    return (
        Level(distance_partition(CANONICAL_PARENTS, 2, faithful=faithful_to_code), JOINT_PARTS, 7),
        Level(distance_partition(MID_PARENTS, 1, faithful=faithful_to_code), MID_PARTS, 5),
        Level(distance_partition(PART_PARENTS, 1, faithful=faithful_to_code), PART_PARTS, 5),
    )


def pooling_groups(*, faithful_to_code: bool) -> tuple[tuple[tuple[int, ...], ...], tuple[tuple[int, ...], ...]]:
    """Members of the 10 nodes among 21 joints, and of the 5 nodes among 10."""
    return (JOINT_TO_MID_OF_CODE, MID_TO_PART_OF_CODE) if faithful_to_code else (JOINT_TO_MID, MID_TO_PART)
