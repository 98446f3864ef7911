"""Layers, statistics and penalties that several papers share. Tensors are ``[B, C, ...]``, channels second."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

import torch
from torch import Tensor, nn
from torch.nn import functional

from bench.errors import BadInput

EPSILON = 1e-5

Network = TypeVar("Network", bound=nn.Module)


def statistics(x: Tensor, epsilon: float = EPSILON) -> tuple[Tensor, Tensor]:
    """Mean and deviation of each channel of each sample, ``[B, C, ...] -> 2 x [B, C, 1, ...]``."""
    over = tuple(range(2, x.dim()))
    variance, mean = torch.var_mean(x, dim=over, correction=0, keepdim=True)
    return mean, torch.sqrt(variance + epsilon)


def instance_norm(x: Tensor, epsilon: float = EPSILON) -> Tensor:
    """Each channel of each sample with zero mean and unit deviation (Ulyanov et al. 2016)."""
    mean, deviation = statistics(x, epsilon)
    return (x - mean) / deviation


def adain(x: Tensor, scale: Tensor, shift: Tensor) -> Tensor:
    """Adaptive instance normalisation (Huang and Belongie 2017, equation 8): ``scale * instance_norm(x) + shift``.

    Parameters
    ----------
    x : ``[B, C, ...]``.
    scale, shift : ``[B, C]``.
    """
    shape = (*scale.shape, *([1] * (x.dim() - 2)))
    return scale.reshape(shape) * instance_norm(x) + shift.reshape(shape)


def gram(x: Tensor) -> Tensor:
    """Gram matrix over time, ``[B, C, T] -> [B, C, C]``: sums of products, not divided by anything."""
    return x @ x.transpose(1, 2)


def halve_time(x: Tensor) -> Tensor:
    """Average of neighbouring frames, ``[B, C, T, ...] -> [B, C, T // 2, ...]``; a last odd frame is dropped."""
    even = x[:, :, : x.shape[2] // 2 * 2]
    return 0.5 * (even[:, :, 0::2] + even[:, :, 1::2])


def double_time(x: Tensor, n_frames: int | None = None) -> Tensor:
    """Each frame twice (nearest neighbour), ``[B, C, T, ...] -> [B, C, 2 T or n_frames, ...]``; the last is held."""
    doubled = x.repeat_interleave(2, dim=2)
    return doubled if n_frames is None else held_to(doubled, n_frames)


def stretch_time(x: Tensor, n_frames: int) -> Tensor:
    """Linear interpolation over time with the ends kept, ``[B, C, T, ...] -> [B, C, n_frames, ...]``."""
    flat = x.movedim(2, -1)
    stretched = functional.interpolate(
        flat.reshape(len(x), -1, x.shape[2]), size=n_frames, mode="linear", align_corners=True
    )
    return stretched.reshape(*flat.shape[:-1], n_frames).movedim(-1, 2)


def held_to(x: Tensor, n_frames: int) -> Tensor:
    """``[B, C, T, ...]`` cut to ``n_frames``, or its last frame held up to them."""
    missing = n_frames - x.shape[2]
    if missing <= 0:
        return x[:, :, :n_frames]
    return torch.cat([x, x[:, :, -1:].expand(-1, -1, missing, *x.shape[3:])], dim=2)


class JointPool(nn.Module):
    """Joints to groups of joints and back; groups may share joints.

    ``pool`` is the mean over a group's members, ``unpool`` gives each joint the mean of the groups that hold it.
    """

    pooling: Tensor
    unpooling: Tensor

    def __init__(self, groups: Sequence[Sequence[int]]) -> None:
        super().__init__()
        n_joints = 1 + max(joint for group in groups for joint in group)
        member = torch.zeros(len(groups), n_joints)
        for row, group in enumerate(groups):
            member[row, list(group)] = 1.0
        if not bool(member.any(dim=0).all()):
            raise BadInput(f"every joint below {n_joints} must be in a group, got {list(map(list, groups))}")
        self.register_buffer("pooling", member / member.sum(dim=1, keepdim=True), persistent=False)
        self.register_buffer("unpooling", (member / member.sum(dim=0, keepdim=True)).T.contiguous(), persistent=False)

    def pool(self, x: Tensor) -> Tensor:
        """``[..., joints] -> [..., groups]``."""
        return x @ self.pooling.T

    def unpool(self, x: Tensor) -> Tensor:
        """``[..., groups] -> [..., joints]``."""
        return x @ self.unpooling.T


def hinge_discriminator(real: Tensor, fake: Tensor) -> Tensor:
    """Hinge loss of a discriminator (Lim and Ye 2017): ``mean max(0, 1 - real) + mean max(0, 1 + fake)``."""
    return functional.relu(1.0 - real).mean() + functional.relu(1.0 + fake).mean()


def gradient_penalty(scores: Tensor, inputs: Tensor) -> Tensor:
    """R1 (Mescheder et al. 2018): mean over samples of the squared gradient of the scores by the real inputs.

    Parameters
    ----------
    scores : ``[B, ...]`` of a discriminator.
    inputs : ``[B, ...]``, on which gradients are required.
    """
    [gradient] = torch.autograd.grad(scores.sum(), inputs, create_graph=True)
    return gradient.square().flatten(1).sum(dim=1).mean()


class Average(Generic[Network]):
    """Exponential moving average of a network's weights; its buffers are copied.

    Attributes
    ----------
    network : the averaged copy, in evaluation mode, without gradients.
    """

    def __init__(self, network: Network, decay: float) -> None:
        self.network = copy.deepcopy(network).eval().requires_grad_(False)
        self.decay = decay

    @torch.no_grad()
    def update(self, network: Network) -> None:
        """Move by ``1 - decay`` towards the weights of ``network``."""
        for mine, theirs in zip(self.network.parameters(), network.parameters(), strict=True):
            mine.lerp_(theirs, 1.0 - self.decay)
        for held, current in zip(self.network.buffers(), network.buffers(), strict=True):
            held.copy_(current)

    def state_dict(self) -> dict[str, Any]:
        return self.network.state_dict()

    def load_state_dict(self, state_dict: Any, /) -> Any:
        return self.network.load_state_dict(state_dict)


def n_parameters(*networks: nn.Module) -> int:
    """Learned numbers, each counted once."""
    distinct = {id(parameter): parameter.numel() for network in networks for parameter in network.parameters()}
    return sum(distinct.values())
