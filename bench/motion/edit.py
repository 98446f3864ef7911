"""Edits of clips: resample, crop, pad, window, join, mirror, floor. Each returns a new Clip."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from bench.errors import BadInput, BadMotion
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import floor_height, world_positions
from bench.motion.skeleton import MIRROR_JOINTS, Skeleton


def resample(clip: Clip, fps: float) -> Clip:
    """The same motion at another frame rate: slerp for rotations, linear for the root.

    The last frame of the result lies at or just before the last frame of the clip.
    """
    if fps <= 0.0:
        raise BadInput(f"fps must be positive, got {fps}", where="fps")
    if fps == clip.fps:
        return clip
    n_frames = int(np.floor((clip.n_frames - 1) / clip.fps * fps + 1e-6)) + 1
    source = np.minimum(np.arange(n_frames) * (clip.fps / fps), clip.n_frames - 1)
    before = np.floor(source).astype(np.int64)
    after = np.minimum(before + 1, clip.n_frames - 1)
    weight = source - before
    rotations = quat.slerp(clip.rotations_wxyz[before], clip.rotations_wxyz[after], weight[:, None])
    root = clip.root_xyz_m[before] + weight[:, None] * (clip.root_xyz_m[after] - clip.root_xyz_m[before])
    return Clip(clip.skeleton, rotations, root, fps)


def crop(clip: Clip, start: int, n_frames: int) -> Clip:
    """Frames ``start`` to ``start + n_frames``; refused where they do not lie inside the clip."""
    if start < 0 or n_frames < 1 or start + n_frames > clip.n_frames:
        raise BadInput(
            f"frames {start} to {start + n_frames} must lie inside the clip of {clip.n_frames} frames", where="start"
        )
    frames = slice(start, start + n_frames)
    return clip.with_motion(clip.rotations_wxyz[frames], clip.root_xyz_m[frames])


def pad_to(clip: Clip, n_frames: int) -> Clip:
    """Repeat the first and the last pose, half each, up to ``n_frames``; a longer clip is returned as it is."""
    missing = n_frames - clip.n_frames
    if missing <= 0:
        return clip
    frames = np.clip(np.arange(n_frames) - missing // 2, 0, clip.n_frames - 1)
    return clip.with_motion(clip.rotations_wxyz[frames], clip.root_xyz_m[frames])


def window(clip: Clip, start: int, n_frames: int) -> Clip:
    """The window of ``n_frames`` from ``start``; a clip shorter than that is padded (then ``start`` must be 0)."""
    if clip.n_frames < n_frames:
        if start != 0:
            raise BadInput(f"a clip of {clip.n_frames} frames has one window, at 0, got start {start}", where="start")
        return pad_to(clip, n_frames)
    return crop(clip, start, n_frames)


def window_starts(n_frames: int, length: int, stride: int) -> tuple[int, ...]:
    """Starts of the windows of a clip: every ``stride`` frames, the tail dropped; a short clip has one, at 0."""
    return tuple(range(0, max(n_frames - length, 0) + 1, stride))


def windows(clip: Clip, length: int = 64, stride: int = 32) -> list[tuple[int, Clip]]:
    """All windows as ``(start, window)``; see :func:`window_starts`."""
    return [(start, window(clip, start, length)) for start in window_starts(clip.n_frames, length, stride)]


def mirror_skeleton(skeleton: Skeleton) -> Skeleton:
    """The canonical skeleton with left and right bones exchanged."""
    if not skeleton.is_canonical:
        raise BadMotion("mirroring is defined on the canonical 21 joints", remedy="retarget the clip first")
    offsets = skeleton.offsets_m[list(MIRROR_JOINTS)] * np.array([-1.0, 1.0, 1.0])
    other_side = {name: skeleton.names[MIRROR_JOINTS[joint]] for joint, name in enumerate(skeleton.names)}
    return Skeleton(skeleton.names, skeleton.parents, offsets, frozenset(other_side[n] for n in skeleton.virtual))


def mirror(clip: Clip) -> Clip:
    """Exchange left and right: joints swapped, quaternion y and z and the root's x negated."""
    skeleton = mirror_skeleton(clip.skeleton)
    rotations = clip.rotations_wxyz[:, list(MIRROR_JOINTS)] * np.array([1.0, 1.0, -1.0, -1.0])
    return Clip(skeleton, rotations, clip.root_xyz_m * np.array([-1.0, 1.0, 1.0]), clip.fps)


def on_floor(clip: Clip) -> Clip:
    """The clip moved vertically so that its lowest foot or toe point lies at height 0."""
    drop = np.array([0.0, floor_height(world_positions(clip)), 0.0])
    return clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m - drop)


def join(clips: Sequence[Clip], blend_s: float = 0.0) -> Clip:
    """Clips of one skeleton and fps one after the other, each turned and moved to start where the last one ended.

    The first ``blend_s`` seconds of each clip are blended, by slerp with a smooth weight, with the pose in which the
    clip before it ended; the length of the result is the sum of the lengths.
    """
    from bench.motion.kinematics import facing_yaw, yaw_aligned

    if not clips:
        raise BadInput("needs at least one clip to join, got none", where="clips")
    first = clips[0]
    if any(c.fps != first.fps or not c.skeleton.same_bones(first.skeleton) for c in clips):
        raise BadInput("clips to be joined must share skeleton and fps", where="clips")
    rotations, roots = [first.rotations_wxyz], [first.root_xyz_m]
    yaw_end = float(facing_yaw(world_positions(crop(first, first.n_frames - 1, 1)))[0])
    for clip in clips[1:]:
        yaw_start = float(facing_yaw(world_positions(crop(clip, 0, 1)))[0])
        turned, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, yaw_start - yaw_end)
        root = root + (roots[-1][-1] - root[0]) * np.array([1.0, 0.0, 1.0])
        n_blend = min(round(blend_s * clip.fps), clip.n_frames)
        ramp = (np.arange(n_blend) + 1.0) / (n_blend + 1.0)
        weight = ramp * ramp * (3.0 - 2.0 * ramp)
        turned[:n_blend] = quat.slerp(rotations[-1][-1][None], turned[:n_blend], weight[:, None])
        drop = (1.0 - weight) * (roots[-1][-1, 1] - root[:n_blend, 1])
        root[:n_blend, 1] += drop
        rotations.append(turned)
        roots.append(root)
        last = first.with_motion(turned[-1:], root[-1:])
        yaw_end = float(facing_yaw(world_positions(last))[0])
    return first.with_motion(np.concatenate(rotations), np.concatenate(roots))
