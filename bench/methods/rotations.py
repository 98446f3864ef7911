"""Rotations in torch: quaternions w, x, y, z, rotation vectors, six numbers, and forward kinematics.

The same conventions as :mod:`bench.motion.quat`, which stays the reference; here gradients flow.
"""

from __future__ import annotations

from functools import cache

import torch
from torch import Tensor
from torch.nn import functional

from bench.motion.skeleton import CANONICAL_PARENTS


def multiply(left: Tensor, right: Tensor) -> Tensor:
    """Hamilton product ``[..., 4]``; ``right`` is applied first; shapes broadcast."""
    w1, x1, y1, z1 = left.unbind(-1)
    w2, x2, y2, z2 = right.unbind(-1)
    return torch.stack(
        [
            w1 * w2 - x1 * x2 - y1 * y2 - z1 * z2,
            w1 * x2 + x1 * w2 + y1 * z2 - z1 * y2,
            w1 * y2 - x1 * z2 + y1 * w2 + z1 * x2,
            w1 * z2 + x1 * y2 - y1 * x2 + z1 * w2,
        ],
        dim=-1,
    )


def conjugate(rotation: Tensor) -> Tensor:
    """Inverse of unit quaternions ``[..., 4]``."""
    return torch.cat([rotation[..., :1], -rotation[..., 1:]], dim=-1)


def rotate(rotation: Tensor, vector: Tensor) -> Tensor:
    """Vectors ``[..., 3]`` turned by unit quaternions ``[..., 4]``; shapes broadcast."""
    w, xyz = rotation[..., :1], rotation[..., 1:]
    twice = 2.0 * _cross(xyz, vector)
    return vector + w * twice + _cross(xyz, twice)


def _cross(left: Tensor, right: Tensor) -> Tensor:
    x1, y1, z1 = left.unbind(-1)
    x2, y2, z2 = right.unbind(-1)
    return torch.stack([y1 * z2 - z1 * y2, z1 * x2 - x1 * z2, x1 * y2 - y1 * x2], dim=-1)


def normalise(rotation: Tensor) -> Tensor:
    """``[..., 4]`` scaled to unit length; the zero quaternion stays zero."""
    length: Tensor = torch.linalg.vector_norm(rotation, dim=-1, keepdim=True)
    return rotation / length.clamp_min(1e-8)


def from_rotation_vector(vector: Tensor) -> Tensor:
    """Exponential map ``[..., 3] -> [..., 4]``; smooth at zero."""
    half = 0.5 * torch.sqrt((vector * vector).sum(dim=-1, keepdim=True) + 1e-12)
    return torch.cat([torch.cos(half), 0.5 * torch.sinc(half / torch.pi) * vector], dim=-1)


def to_rotation_vector(rotation: Tensor) -> Tensor:
    """Logarithm map ``[..., 4] -> [..., 3]``, the shortest way round."""
    rotation = torch.where(rotation[..., :1] < 0.0, -rotation, rotation)
    w, xyz = rotation[..., :1], rotation[..., 1:]
    length = torch.sqrt((xyz * xyz).sum(dim=-1, keepdim=True) + 1e-12)
    return 2.0 * torch.atan2(length, w) / length * xyz


def about_y(angle: Tensor) -> Tensor:
    """Rotations about the up axis: ``[...]`` radians to ``[..., 4]``."""
    half, zero = 0.5 * angle, torch.zeros_like(angle)
    return torch.stack([torch.cos(half), zero, torch.sin(half), zero], dim=-1)


def to_matrix(rotation: Tensor) -> Tensor:
    """Unit quaternions ``[..., 4]`` to matrices ``[..., 3, 3]``."""
    w, x, y, z = rotation.unbind(-1)
    entries = [
        1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y),
        2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x),
        2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y),
    ]  # fmt: skip
    return torch.stack(entries, dim=-1).reshape(*rotation.shape[:-1], 3, 3)


def matrix_from_axes(forward: Tensor, up: Tensor) -> Tensor:
    """Matrices ``[..., 3, 3]`` whose z axis is ``forward`` and whose y axis is nearest to ``up``, ``[..., 3]`` each.

    Six numbers without the discontinuity of four (Zhou et al. 2019, section 4.2); see
    :func:`bench.motion.representation.matrix_from_axes`.
    """
    z_axis = functional.normalize(forward, dim=-1)
    y_axis = functional.normalize(up - (up * z_axis).sum(dim=-1, keepdim=True) * z_axis, dim=-1)
    return torch.stack([_cross(y_axis, z_axis), y_axis, z_axis], dim=-1)


def forward_kinematics(
    rotations: Tensor, root: Tensor, offsets: Tensor, parents: tuple[int, ...] = CANONICAL_PARENTS
) -> Tensor:
    """Joint positions ``[..., J, 3]`` from local rotations.

    Joints of one depth of the tree are turned together, so the cost is that of the longest chain.

    Parameters
    ----------
    rotations : ``[..., J, 4]`` unit quaternions.
    root : ``[..., 3]`` position of joint 0.
    offsets : ``[..., J, 3]`` rest offsets, broadcast.
    parents : of each joint, -1 for the root.
    """
    placed = [root[..., None, :].expand(*rotations.shape[:-2], 1, 3)]
    turned = [rotations[..., :1, :]]
    order = [0]
    for joints in levels(parents):
        rows = [order.index(parents[joint]) for joint in joints]
        above = torch.cat(turned, dim=-2)[..., rows, :]
        start = torch.cat(placed, dim=-2)[..., rows, :]
        placed.append(start + rotate(above, offsets[..., list(joints), :]))
        turned.append(multiply(above, rotations[..., list(joints), :]))
        order.extend(joints)
    places = [order.index(joint) for joint in range(len(parents))]
    return torch.cat(placed, dim=-2)[..., places, :]


@cache
def levels(parents: tuple[int, ...]) -> tuple[tuple[int, ...], ...]:
    """The joints below the root by depth."""
    depth = [0] * len(parents)
    for joint, parent in enumerate(parents):
        depth[joint] = 0 if parent < 0 else depth[parent] + 1
    return tuple(
        tuple(joint for joint, found in enumerate(depth) if found == level) for level in range(1, max(depth) + 1)
    )
