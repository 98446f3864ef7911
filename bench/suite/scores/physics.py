"""Physics scores: feet and floor, joint angles, the root's way. One value a sample; sequences may differ in length."""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache

import numpy as np

from bench.arrays import FloatArray
from bench.metrics import contacts
from bench.metrics.joint_range import JointRange
from bench.metrics.physics import root_path_error as path_error
from bench.motion.kinematics import FOOT_JOINTS, world_positions
from bench.motion.skeleton import LEFT_TOE, RIGHT_TOE
from bench.suite.motions import Motions
from bench.suite.scores.base import PRIMARY_SLICE, Basis, PlainRow, Scored, mean_score, measure

RANGE_STEP_FRAMES = 4
"""Every fourth frame of the fit part is enough to know the range of its joints."""
NO_FEET = "the skeleton has no foot joints of its own"
IN_THE_AIR = "no foot is on the floor"


def foot_skate(row: PlainRow, basis: Basis) -> Scored:
    """Speed of the foot that stands."""
    feet = _real(FOOT_JOINTS, row)
    if not feet:
        return _without_feet("foot_skate")
    values = _of_positions(row, lambda positions: contacts.foot_skate(positions, row.motions.fps, feet))
    return mean_score("foot_skate", values, basis, slices=_slices(basis), undefined=IN_THE_AIR)


def skate_gmd(row: PlainRow, basis: Basis) -> Scored:
    """The published foot skating ratio, of the toes."""
    toes = _real((LEFT_TOE, RIGHT_TOE), row)
    if not toes:
        return _without_feet("skate[gmd]")
    values = _of_positions(row, lambda positions: contacts.skate_gmd(positions, row.motions.fps, toes))
    return mean_score("skate[gmd]", values, basis, slices=_slices(basis))


def penetration(row: PlainRow, basis: Basis) -> Scored:
    """Depth of the lowest foot under the floor at height 0."""
    feet = _real(FOOT_JOINTS, row)
    if not feet:
        return _without_feet("penetration")
    values = _of_positions(row, lambda positions: contacts.penetration(positions, feet))
    return mean_score("penetration", values, basis, slices=_slices(basis))


def float_height(row: PlainRow, basis: Basis) -> Scored:
    """Height of the lowest foot over the floor at height 0."""
    feet = _real(FOOT_JOINTS, row)
    if not feet:
        return _without_feet("float_height")
    values = _of_positions(row, lambda positions: contacts.float_height(positions, feet))
    return mean_score("float_height", values, basis, slices=_slices(basis))


def joint_range(row: PlainRow, basis: Basis) -> Scored:
    """Share of joint angles outside the range of the fit part."""
    seen = _range_of_fit(basis)
    joints = [joint for joint in row.joints if joint != 0]
    motions = row.motions
    if _equally_long(motions):
        values = seen.outside(motions.window_rotations_wxyz, joints=joints)
    else:
        clips = (motions.clip(index).rotations_wxyz for index in range(motions.n))
        values = np.concatenate([seen.outside(rotations[None], joints=joints) for rotations in clips])
    return mean_score("joint_range", values, basis, slices=_slices(basis))


def root_path_error(row: PlainRow, basis: Basis) -> Scored:
    """Distance of the root's way over the floor from the source's."""
    values = path_error(row.source_positions_m[:, :, 0], row.positions_m[:, :, 0])
    return mean_score("root_path_error", values, basis, slices=_slices(basis))


def contact_precision(row: PlainRow, basis: Basis) -> Scored:
    """Share of the output's planted frames in which the source's foot stands too."""
    timing = _contact_timing(row)
    if timing is None:
        return _without_feet("contact_precision")
    undefined = "no foot of the output stands"
    return mean_score("contact_precision", timing.precision, basis, slices=_slices(basis), undefined=undefined)


def contact_recall(row: PlainRow, basis: Basis) -> Scored:
    """Share of the source's planted frames in which the output's foot stands too."""
    timing = _contact_timing(row)
    if timing is None:
        return _without_feet("contact_recall")
    undefined = "no foot of the source stands"
    return mean_score("contact_recall", timing.recall, basis, slices=_slices(basis), undefined=undefined)


def _slices(basis: Basis) -> tuple[str, ...]:
    """All, the primary slice, each content, and the tagged slices of a track."""
    tagged = [name for name in basis.slices if name.startswith("content=") or name in ("intra", "inter")]
    return ("all", PRIMARY_SLICE, *tagged)


def _real(joints: tuple[int, ...], row: PlainRow) -> list[int]:
    return [joint for joint in joints if joint in row.joints]


def _without_feet(name: str) -> Scored:
    return Scored((measure(name, "all", float("nan"), 0, reason=NO_FEET),))


def _equally_long(motions: Motions) -> bool:
    return bool((motions.lengths == motions.lengths[0]).all())


def _of_positions(row: PlainRow, score: Callable[[FloatArray], FloatArray]) -> FloatArray:
    """``score`` of world positions ``[n, T, 21, 3]``, sample by sample where they differ in length."""
    if _equally_long(row.motions):
        return score(row.positions_m)
    clips = (row.motions.clip(index) for index in range(row.motions.n))
    return np.concatenate([score(world_positions(clip)[None]) for clip in clips])


@lru_cache(maxsize=1)
def _contact_timing(row: PlainRow) -> contacts.ContactTiming | None:
    feet = _real(FOOT_JOINTS, row)
    if not feet:
        return None
    source, output = (
        contacts.planted(positions, motions.fps, feet)
        for positions, motions in ((row.source_positions_m, row.source), (row.positions_m, row.motions))
    )
    return contacts.contact_timing(source, output)


@lru_cache(maxsize=1)
def _range_of_fit(basis: Basis) -> JointRange:
    takes = (basis.pack.take(take_id) for take_id in basis.fit_take_ids)
    return JointRange.seen_in(np.concatenate([take.clip.rotations_wxyz[::RANGE_STEP_FRAMES] for take in takes]))
