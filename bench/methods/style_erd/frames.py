"""What Style-ERD reads of one frame, from that frame and the one before it: nothing of the future.

Tao et al. 2022, section 3.1: local rotations, joint positions about the root, their velocities; contacts as in the
released code. Heading is taken out frame by frame. A stream has no skeleton, so positions are those of the fit part's
mean bones, whoever moves.
"""

from __future__ import annotations

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


class Frames(nn.Module):
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

    def forward(
        self, rotations_wxyz: Tensor, root_xyz_m: Tensor, before: Tensor | None = None
    ) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Rotations ``[B, T, 84]``, positions and velocities ``[B, T, 60]``, contacts ``[B, T, 4]``.

        Parameters
        ----------
        rotations_wxyz : ``[B, T, 21, 4]``. root_xyz_m : ``[B, T, 3]``.
        before : what :meth:`kept` gave for the frame before the first; None where there was none, then it stands still.
        """
        local, heading, positions = self.facing(rotations_wxyz, root_xyz_m)
        feet = (
            rotations.rotate(heading[..., None, :], positions[..., FOOT_JOINTS, :]) + root_xyz_m[..., None, :] / UNIT_M
        )
        places = positions[..., 1:, :].flatten(2)
        last = self.kept(rotations_wxyz[:, :1], root_xyz_m[:, :1]) if before is None else before
        earlier = torch.cat([last, torch.cat([places, feet.flatten(2)], dim=2)[:, :-1]], dim=1)
        moved = (feet.flatten(2) - earlier[..., N_POSITIONS:]).unflatten(2, (N_CONTACTS, 3))  # type: ignore[no-untyped-call]
        contacts = (moved.square().sum(dim=-1) < CONTACT_SQUARED_UNITS).float()
        return local.flatten(2), places, places - earlier[..., :N_POSITIONS], contacts

    def kept(self, rotations_wxyz: Tensor, root_xyz_m: Tensor) -> Tensor:
        """What the next frame needs of a frame ``[B, 1, ...]``: positions and feet, ``[B, 1, 72]``."""
        _, heading, positions = self.facing(rotations_wxyz, root_xyz_m)
        feet = (
            rotations.rotate(heading[..., None, :], positions[..., FOOT_JOINTS, :]) + root_xyz_m[..., None, :] / UNIT_M
        )
        return torch.cat([positions[..., 1:, :].flatten(2), feet.flatten(2)], dim=2)

    def facing(self, rotations_wxyz: Tensor, root_xyz_m: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Local rotations without heading ``[B, T, 21, 4]``, headings ``[B, T, 4]``, positions ``[B, T, 21, 3]``."""
        still = torch.zeros_like(root_xyz_m)
        yaw = facing_yaw(rotations.forward_kinematics(rotations_wxyz, still, self.offsets))
        heading = rotations.about_y(yaw)
        root = rotations.multiply(rotations.conjugate(heading), rotations_wxyz[..., 0, :])
        local = torch.cat([root[..., None, :], rotations_wxyz[..., 1:, :]], dim=-2)
        sign = torch.where((local * self.reference_wxyz).sum(dim=-1, keepdim=True) < 0.0, -1.0, 1.0)
        local = local * sign
        return local, heading, rotations.forward_kinematics(local, still, self.offsets)


def facing_yaw(positions: Tensor) -> Tensor:
    """Facing direction of poses ``[..., 21, 3]``, radians, as :func:`bench.motion.kinematics.facing_yaw`."""
    across = (
        positions[..., LEFT_UP_LEG, :]
        - positions[..., RIGHT_UP_LEG, :]
        + positions[..., LEFT_ARM, :]
        - positions[..., RIGHT_ARM, :]
    )
    return torch.atan2(-across[..., 2], across[..., 0])
