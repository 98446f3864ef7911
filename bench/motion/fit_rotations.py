"""Joint rotations that bring a clip's bones to given joint positions, for methods that predict positions."""

from __future__ import annotations

import numpy as np

from bench.arrays import BoolArray, FloatArray, finite_array
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import forward_kinematics

SHORTEST_BONE_M = 1e-6


def fit_rotations(positions_m: FloatArray, like: Clip) -> Clip:
    """The clip with the bones of ``like`` that points them as ``positions_m`` ``[T, J, 3]`` does.

    Every joint is turned from where ``like`` has it: one child, by the least turn that points its bone at the child;
    several, by the rotation nearest to all of them (Kabsch 1976). Turns about a bone's own axis, which positions do
    not show, and joints at the ends therefore stay as in ``like``. Bones keep their lengths, so positions are met in
    direction and not, where the lengths differ, in place; the root is put where ``positions_m`` has it.
    """
    skeleton = like.skeleton
    positions = finite_array(positions_m, "positions_m", (like.n_frames, skeleton.n_joints, 3))
    _, before = forward_kinematics(like.rotations_wxyz, like.root_xyz_m, skeleton)
    world = before.copy()
    local = like.rotations_wxyz.copy()
    for joint, parent in enumerate(skeleton.parents):
        children = [c for c, p in enumerate(skeleton.parents) if p == joint and _long(skeleton.offsets_m[c])]
        if children:
            rest = quat.rotate(before[:, joint, None], skeleton.offsets_m[children])
            wanted = positions[:, children] - positions[:, joint, None]
            wanted = np.where(_long(wanted)[..., None], wanted, rest)
            world[:, joint] = quat.multiply(_turn(rest, wanted), before[:, joint])
            parents = world[:, parent] if parent >= 0 else np.broadcast_to(quat.IDENTITY, world[:, joint].shape)
            local[:, joint] = quat.multiply(quat.conjugate(parents), world[:, joint])
        elif parent >= 0:
            world[:, joint] = quat.multiply(world[:, parent], local[:, joint])
    return like.with_motion(quat.normalise(local), positions[:, 0])


def _long(bones_m: FloatArray) -> BoolArray:
    return np.asarray(np.linalg.norm(bones_m, axis=-1) > SHORTEST_BONE_M)


def _turn(rest: FloatArray, wanted: FloatArray) -> FloatArray:
    """Rotations ``[T, 4]`` that best bring bones ``[T, n, 3]`` onto others, lengths apart."""
    if rest.shape[1] == 1:
        return quat.between(rest[:, 0], wanted[:, 0])
    unit_rest = rest / np.linalg.norm(rest, axis=-1, keepdims=True)
    unit_wanted = wanted / np.linalg.norm(wanted, axis=-1, keepdims=True)
    u, _, v = np.linalg.svd(np.einsum("tni,tnj->tij", unit_wanted, unit_rest))
    sign = np.ones((len(u), 3))
    sign[:, 2] = np.linalg.det(u @ v)
    return quat.from_matrix((u * sign[:, None]) @ v)
