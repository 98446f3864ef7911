from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.errors import BadConfig, BadMotion
from bench.motion import quat
from bench.motion.bvh import read_bvh
from bench.motion.edit import mirror
from bench.motion.kinematics import world_positions
from bench.motion.known_skeletons import FINGERS_M, KNOWN_SKELETONS, LAFAN1, MIXAMO, ZEROEGGS
from bench.motion.recognise import (
    UNITS_M,
    guess_unit,
    guess_up,
    head_over_feet,
    known_map,
    match_joints,
    recognise,
    unit_metres,
    with_bare_names,
)
from bench.motion.retarget import folding_error_m, rest_stature, to_canonical
from bench.motion.skeleton import CANONICAL_NAMES, MIRROR_JOINTS
from bench.motion.skeleton_maps import CMU_31, CMU_UNIT_M
from bench.motion.user_map import read_skeleton_map
from tests.motion.factory import random_clip
from tests.motion.source_skeletons import SOURCES, Source, on_source, write_motion
from tests.motion.test_retarget import assert_t_pose

EACH = pytest.mark.parametrize("name", list(SOURCES))


@EACH
def test_is_recognised_through_a_file(name: str, tmp_path: Path) -> None:
    motion = on_source(random_clip(4), SOURCES[name])
    read = with_bare_names(read_bvh(write_motion(tmp_path / "take.bvh", motion)))
    skeleton_map = recognise(read)
    assert skeleton_map.name == name
    assert guess_unit(rest_stature(read, skeleton_map)) == "cm"
    assert guess_up([head_over_feet(read, skeleton_map)]) == "y"


@EACH
def test_t_pose_is_the_canonical_one(name: str) -> None:
    motion = with_bare_names(on_source(random_clip(2), SOURCES[name]))
    skeleton = to_canonical(motion, SOURCES[name].skeleton_map, unit_m=0.009).skeleton
    assert_t_pose(skeleton, tolerance_m=1e-9)


@EACH
def test_performed_clip_comes_back(name: str) -> None:
    clip = random_clip(6)
    skeleton_map = SOURCES[name].skeleton_map
    motion = with_bare_names(on_source(clip, SOURCES[name]))
    back = to_canonical(motion, skeleton_map, unit_m=0.01)
    real = [j for j in range(21) if j in back.skeleton.real_joints]
    angles = quat.angle_between(back.rotations_wxyz[:, real], clip.rotations_wxyz[:, real])
    np.testing.assert_allclose(angles, 0.0, atol=1e-6)
    assert np.nanmax(folding_error_m(motion, back, skeleton_map, unit_m=0.01)) < 1e-9


@EACH
def test_mirrored_performance_is_the_mirrored_clip(name: str) -> None:
    clip = random_clip(4)
    source = SOURCES[name]
    ours, theirs = (
        to_canonical(with_bare_names(on_source(c, source)), source.skeleton_map, unit_m=0.01)
        for c in (clip, mirror(clip))
    )
    flipped = world_positions(ours)[:, list(MIRROR_JOINTS)] * [-1.0, 1.0, 1.0]
    np.testing.assert_allclose(world_positions(mirror(ours)), flipped, atol=1e-9)
    np.testing.assert_allclose(world_positions(theirs), flipped, atol=1e-6)


def test_arms_that_are_up_in_the_zero_pose() -> None:
    """ZeroEGGS: clavicles and arms run along local y, so that clavicles turned by 90 degrees about z make a T-pose."""
    motion = on_source(random_clip(2), SOURCES["zeroeggs"])
    values = np.zeros_like(motion.channel_values)
    columns = [
        (name, channel) for name, channels in zip(motion.names, motion.channels, strict=True) for channel in channels
    ]
    values[:, columns.index(("LeftShoulder", "Zrotation"))] = -90.0
    values[:, columns.index(("RightShoulder", "Zrotation"))] = 90.0
    posed = replace(motion, channel_values=values)
    clip = to_canonical(posed, ZEROEGGS, unit_m=0.01)
    places = world_positions(clip)[0]
    left_arm, left_hand, left_finger = (
        CANONICAL_NAMES.index(name) for name in ("LeftArm", "LeftHand", "LeftHandIndex1")
    )
    assert places[left_arm, 0] == pytest.approx(0.132, abs=1e-3)
    assert places[left_hand, 0] - places[left_arm, 0] == pytest.approx(0.51, abs=1e-3)
    assert quat.angle_between(clip.rotations_wxyz[0, left_finger], quat.IDENTITY) < 1e-6
    assert np.nanmax(folding_error_m(posed, clip, ZEROEGGS, unit_m=0.01)) < 1e-6


def test_zero_pose_along_other_axes_is_the_same_motion() -> None:
    """A zero pose that is Z up and faces -Y, as modelling programs write it."""
    source = SOURCES["mixamo"]
    motion = with_bare_names(on_source(random_clip(5), source))
    turn = quat.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.pi / 2)
    turned = turned_zero_pose(motion.names, source, turn)
    clip = random_clip(5)
    rotated = on_source(clip, Source(MIXAMO, turned))
    back = to_canonical(rotated, MIXAMO, unit_m=0.01)
    np.testing.assert_allclose(quat.angle_between(back.rotations_wxyz, clip.rotations_wxyz), 0.0, atol=1e-6)
    assert_t_pose(replace(back.skeleton, offsets_m=back.skeleton.offsets_m * 0.9), 1e-9)


def turned_zero_pose(
    names: tuple[str, ...], source: Source, turn: np.ndarray[tuple[int, ...], np.dtype[np.float64]]
) -> dict[str, tuple[str | None, tuple[float, float, float]]]:
    tree: dict[str, tuple[str | None, tuple[float, float, float]]] = {}
    for name in names:
        parent, offset = source.tree[name]
        x, y, z = quat.rotate(turn, np.asarray(offset)).tolist()
        tree[name] = (parent, (x, y, z))
    return tree


def test_bones_along_local_axes_have_no_zero_pose() -> None:
    lafan = on_source(random_clip(2), SOURCES["lafan1"])
    named_like_mixamo = replace(lafan, names=tuple(n.replace("Toe", "ToeBase") for n in lafan.names))
    with pytest.raises(BadMotion, match=r"no known skeleton fits .* nearest is mixamo without fingers: .*not stand"):
        recognise(named_like_mixamo)
    match = match_joints(named_like_mixamo, known_map("mixamo without fingers"))
    assert not match.missing
    assert not match.complete


def test_match_says_what_is_missing() -> None:
    motion = with_bare_names(on_source(random_clip(2), SOURCES["mixamo"]))
    match = match_joints(motion, LAFAN1)
    assert match.missing == ("LeftToe", "RightToe")
    assert match.virtual == tuple(FINGERS_M)
    assert match.matched["Spine1"] == "Spine2"
    assert {"Spine", "LeftToeBase"} < set(match.dropped)


def test_prefixes_are_dropped_where_names_stay_unique() -> None:
    motion = on_source(random_clip(2), SOURCES["mixamo"])
    assert with_bare_names(motion).names[0] == "Hips"
    named = replace(motion, names=tuple(name.replace("rig:", "rig2_") for name in motion.names))
    assert with_bare_names(named).names[0] == "Hips"
    twice = replace(motion, names=("a:Hips", "b:Hips", *motion.names[2:]))
    assert with_bare_names(twice) is twice


@pytest.mark.parametrize(("stature", "unit"), [(1.45, "m"), (150.0, "cm"), (1400.0, "mm"), (55.0, "inch"), (25, "cmu")])
def test_unit_from_stature(stature: float, unit: str) -> None:
    assert guess_unit(stature) == unit


def test_units_are_refused() -> None:
    with pytest.raises(BadMotion, match="Head over toes is 10 file units"):
        guess_unit(10.0)
    with pytest.raises(BadConfig, match="unit must be one of m, cm"):
        unit_metres("ell")
    assert unit_metres(0.5) == 0.5
    assert unit_metres("cmu") == UNITS_M["cmu"] == CMU_UNIT_M


def test_up_is_refused_where_people_lie() -> None:
    assert guess_up([np.array([0.1, 0.2, 0.9])]) == "z"
    with pytest.raises(BadMotion, match="neither Y nor Z up"):
        guess_up([np.array([1.0, 0.0, 0.0])])


def test_unknown_skeleton_is_refused() -> None:
    with pytest.raises(BadConfig, match="no skeleton called 'cat'"):
        known_map("cat")
    assert "mixamo" in KNOWN_SKELETONS


def test_xia_files_are_recognised(xia_folder: Path) -> None:
    for file in sorted(xia_folder.glob("*.bvh")):
        motion = read_bvh(file)
        assert recognise(motion) is CMU_31
        assert guess_unit(rest_stature(motion, CMU_31)) == "cmu"
        assert guess_up([head_over_feet(motion, CMU_31)]) == "y"


def user_map_text(*, joints: str = "", extra: str = "") -> str:
    lines = [f'{ours} = "{theirs}"' for ours, theirs in MIXAMO.joints.items() if "Index" not in ours]
    return "name = 'mine'\n[joints]\n" + "\n".join(lines) + f"\n{joints}\n{extra}"


def test_own_map(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(user_map_text())
    ours = read_skeleton_map(path)
    assert (ours.name, ours.zero_pose, ours.virtual_offsets_m) == ("mine", True, FINGERS_M)
    clip = random_clip(3)
    motion = with_bare_names(on_source(clip, SOURCES["mixamo"]))
    back = to_canonical(motion, ours, unit_m=0.01)
    np.testing.assert_allclose(
        quat.angle_between(back.rotations_wxyz[:, :16], clip.rotations_wxyz[:, :16]), 0.0, atol=1e-6
    )
    path.write_text(user_map_text(extra='[t_pose]\nHips = { x = "up", y = "right" }'))
    with_axes = read_skeleton_map(path)
    assert not with_axes.zero_pose
    np.testing.assert_allclose(
        quat.rotate(with_axes.t_pose_wxyz["Hips"], np.array([1.0, 0.0, 0.0])), [0, 1, 0], atol=1e-9
    )


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("[joints", "cannot be read as TOML"),
        ("colour = 1", "unknown colour"),
        ("name = 'x'", r"needs a table \[joints\]"),
        ('[joints]\nHips = "pelvis"', "each canonical joint must be mapped or virtual"),
        (user_map_text(extra="[virtual]\nHead = [1]"), "virtual.Head must be three metres"),
        (user_map_text(extra='[t_pose]\nHips = { x = "up", y = "down" }'), "must say where x and y point"),
    ],
)
def test_own_map_is_refused(text: str, match: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(text)
    with pytest.raises(BadConfig, match=match):
        read_skeleton_map(path)
