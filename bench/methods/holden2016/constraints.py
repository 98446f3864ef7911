"""What makes a generated motion obey the body and the ground (Holden et al. 2016).

Motions are ``[73, T]`` in units, not standardised; costs are means of squares, in squared units.
"""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from bench.motion.holden_features import HOLDEN_SLICES
from bench.motion.kinematics import FOOT_JOINTS

VELOCITY_WEIGHT = 10.0
UP_AXIS = 1


def joints(motion: Tensor) -> Tensor:
    """Positions ``[21, 3, T]`` of the canonical joints, without the reference joint."""
    return motion[HOLDEN_SLICES["position_units"]].reshape(-1, 3, motion.shape[-1])[1:]


def foot_slide(motion: Tensor, contacts: Tensor) -> Tensor:
    """Feet and toes that stand do not move over the ground, and none goes below it.

    Parameters
    ----------
    motion : ``[73, T]``.
    contacts : ``[4, T]``, 1 where left foot, left toe, right foot, right toe stand.
    """
    feet = joints(motion)[list(FOOT_JOINTS)]  # [4, 3, T]
    velocity = motion[HOLDEN_SLICES["velocity_xz"]]
    turn = motion[HOLDEN_SLICES["yaw_velocity"]]
    still = torch.zeros_like(turn)
    path = torch.cat([velocity[:1], still, velocity[1:]])  # [3, T]
    swept = turn * torch.stack([feet[:, 2], torch.zeros_like(feet[:, 1]), -feet[:, 0]], dim=1)  # turn * up x foot
    ground_speed = feet.diff(dim=-1) + (path + swept)[..., :-1]  # [4, 3, T - 1]
    slide = VELOCITY_WEIGHT * (contacts[:, None, :-1] * ground_speed.square()).mean(dim=(0, 2)).sum()
    below = VELOCITY_WEIGHT * feet[:, UP_AXIS].clamp_max(0.0).square().mean()
    return (slide + below) / 4.0


def bone_lengths(motion: Tensor, lengths: Tensor, parents: Sequence[int]) -> Tensor:
    """Bones are as long as ``lengths`` ``[20]``, in units, those of joints 1 to 20."""
    positions = joints(motion)
    bones = positions[1:] - positions[list(parents[1:])]
    return ((bones.square().sum(dim=1) + 1e-12).sqrt() - lengths[:, None]).square().mean()


def trajectory(motion: Tensor, wanted: Tensor) -> Tensor:
    """Ground and turning velocities are ``wanted`` ``[3, T]``."""
    return VELOCITY_WEIGHT * (path_velocities(motion) - wanted).square().mean()


def path_velocities(motion: Tensor) -> Tensor:
    """Velocities over the ground and turning velocity, ``[3, T]``."""
    return motion[HOLDEN_SLICES["velocity_xz"].start : HOLDEN_SLICES["yaw_velocity"].stop]


def constraints(motion: Tensor, contacts: Tensor, lengths: Tensor, parents: Sequence[int], wanted: Tensor) -> Tensor:
    """The mean of the three."""
    costs = foot_slide(motion, contacts), bone_lengths(motion, lengths, parents), trajectory(motion, wanted)
    return torch.stack(costs).mean()
