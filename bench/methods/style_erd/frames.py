"""What Style-ERD reads of one frame, from that frame and the one before it: nothing of the future.

Tao et al. 2022, section 3.1: local rotations, joint positions about the root, their velocities; contacts as in the
released code. Heading is taken out frame by frame. A stream has no skeleton, so positions are those of the fit part's
mean bones, whoever moves.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor, nn

from bench.methods import rotations
from bench.motion.kinematics import FOOT_JOINTS
from bench.motion.skeleton import LEFT_ARM, LEFT_UP_LEG, N_JOINTS, RIGHT_ARM, RIGHT_UP_LEG

UNIT_M = 0.056444
"""The paper's unit of length (CMU skeletons), metres."""
CONTACT_SQUARED_UNITS = 0.05
"""A foot joint that moves less than this between two frames, squared, stands (released code)."""
N_ROTATIONS = 4 * N_JOINTS
N_POSITIONS = 3 * (N_JOINTS - 1)
N_CONTACTS = len(FOOT_JOINTS)


class Frames(NamedTuple):
    """Frames as numbers.

    Attributes
    ----------
    motion : ``[B, T, 84 + 60 + 60]`` rotations, positions and velocities.
    contacts : ``[B, T, 4]``, 1 where a foot joint stands.
    heading : ``[B, T, 4]`` the facing that was taken out, as a rotation about the up axis.
    last : ``[B, 1, 72]`` what the frame after the last one has to know of it.
    """

    motion: Tensor
    contacts: Tensor
    heading: Tensor
    last: Tensor


class FrameReader(nn.Module):
    """World motion to the numbers of each frame.

    Attributes
    ----------
    reference_wxyz : ``[21, 4]`` mean rotations of the fit part; quaternions get the sign nearer to them.
    offsets : ``[21, 3]`` mean bones of the fit part, in the paper's unit.
    """

    reference_wxyz: Tensor
    offsets: Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("reference_wxyz", torch.tensor([1.0, 0.0, 0.0, 0.0]).repeat(N_JOINTS, 1))
        self.register_buffer("offsets", torch.zeros(N_JOINTS, 3))

    def forward(self, rotations_wxyz: Tensor, root_xyz_m: Tensor, before: Tensor | None = None) -> Frames:
        """Read frames in their order.

        Parameters
        ----------
        rotations_wxyz : ``[B, T, 21, 4]``. root_xyz_m : ``[B, T, 3]``.
        before : ``last`` of the frames before these; None where there were none, then the first one stands still.
        """
        world = self.positions(rotations_wxyz)
        heading = rotations.about_y(facing_yaw(world))
        back = rotations.conjugate(heading)
        root = rotations.multiply(back, rotations_wxyz[..., 0, :])
        local = torch.cat([root[..., None, :], rotations_wxyz[..., 1:, :]], dim=-2)
        local = torch.where((local * self.reference_wxyz).sum(dim=-1, keepdim=True) < 0.0, -local, local)
        feet = world[..., FOOT_JOINTS, :] + root_xyz_m[..., None, :] / UNIT_M
        places = rotations.rotate(back[..., None, :], world[..., 1:, :]).flatten(2)
        now = torch.cat([places, feet.flatten(2)], dim=2)
        moved = now - torch.cat([now[:, :1] if before is None else before, now[:, :-1]], dim=1)
        feet_moved = moved[..., N_POSITIONS:].reshape(*moved.shape[:2], N_CONTACTS, 3)
        contacts = (feet_moved.square().sum(dim=-1) < CONTACT_SQUARED_UNITS).to(moved)
        motion = torch.cat([local.flatten(2), places, moved[..., :N_POSITIONS]], dim=2)
        return Frames(motion, contacts, heading, now[:, -1:])

    def positions(self, rotations_wxyz: Tensor) -> Tensor:
        """Joints of the mean body about its root, ``[..., 21, 4] -> [..., 21, 3]``, in the paper's unit."""
        still = torch.zeros_like(rotations_wxyz[..., 0, :3])
        return rotations.forward_kinematics(rotations_wxyz, still, self.offsets)


def facing_yaw(positions: Tensor) -> Tensor:
    """Facing direction of poses ``[..., 21, 3]``, radians, as :func:`bench.motion.kinematics.facing_yaw`."""
    across = (
        positions[..., LEFT_UP_LEG, :]
        - positions[..., RIGHT_UP_LEG, :]
        + positions[..., LEFT_ARM, :]
        - positions[..., RIGHT_ARM, :]
    )
    return torch.atan2(-across[..., 2], across[..., 0])
