from __future__ import annotations

import math
import re
import zipfile
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray
from bench.errors import BadFile, BadInput, BadMotion
from bench.motion._bvh_hierarchy import MAX_JOINTS
from bench.motion.bvh import read_bvh, world_motion, write_bvh
from bench.motion.clip import Clip
from bench.motion.kinematics import world_positions
from bench.motion.skeleton import Skeleton
from tests.golden.make_bvh import BAD, FOLDER, GOOD, Joint, leg, rows_for, text_of
from tests.motion import reference_bvh
from tests.motion.factory import random_clip

ROUND_TRIP_M = 1e-5


def expected_positions(joints: tuple[Joint, ...], rows: tuple[tuple[float, ...], ...]) -> FloatArray:
    return reference_bvh.world_positions(
        [joint.parent for joint in joints],
        np.array([joint.offset for joint in joints]),
        [(joint.channels or "").split() for joint in joints],
        np.array(rows),
    )


def one_column(*tokens: str, frames: int | None = None) -> bytes:
    """A file whose motion block is one column of the given tokens."""
    header = "HIERARCHY\nROOT a\n{\nOFFSET 0 0 0\nCHANNELS 1 Xposition\n}\nMOTION\n"
    return f"{header}Frames: {frames or len(tokens)}\nFrame Time: 0.01\n{chr(10).join(tokens)}\n".encode()


def test_corpus_is_what_the_script_writes() -> None:
    stored = {path.relative_to(FOLDER).as_posix(): path.read_bytes() for path in FOLDER.rglob("*.bvh")}
    made = {f"good/{name}.bvh": case.content for name, case in GOOD.items()}
    made |= {f"bad/{name}.bvh": case.content for name, case in BAD.items()}
    assert stored == made
    assert len(made) >= 40


@pytest.mark.parametrize("name", GOOD)
def test_good_file_is_read_to_the_expected_world_positions(name: str) -> None:
    case = GOOD[name]
    motion = read_bvh(FOLDER / "good" / f"{name}.bvh")
    assert motion.names == tuple(joint.name for joint in case.joints)
    assert motion.parents == tuple(joint.parent for joint in case.joints)
    assert [" ".join(names) for names in motion.channels] == [joint.channels or "" for joint in case.joints]
    np.testing.assert_array_equal(motion.channel_values, np.array(case.rows))
    np.testing.assert_array_equal(motion.offsets, [joint.offset for joint in case.joints])
    assert (motion.n_frames, motion.fps, motion.frame_time_s) == (len(case.rows), 30.0, 0.0333333)
    np.testing.assert_allclose(world_motion(motion)[0], expected_positions(case.joints, case.rows), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", BAD)
def test_bad_file_is_refused_with_its_line_and_a_remedy(name: str) -> None:
    path = FOLDER / "bad" / f"{name}.bvh"
    with pytest.raises(BadFile, match=f"^{re.escape(str(path))}:{BAD[name].line}: .*{BAD[name].problem}") as raised:
        read_bvh(path)
    assert raised.value.remedy
    assert "\n" not in str(raised.value)


def test_pybvh_agrees_on_every_file_it_reads_whole() -> None:
    pybvh = pytest.importorskip("pybvh", reason="pybvh is not installed: no second opinion on BVH")
    errors = {}
    for name in GOOD:
        path = FOLDER / "good" / f"{name}.bvh"
        try:
            theirs = pybvh.read_bvh_file(path, world_up="+y")
        except Exception:
            continue
        ours = read_bvh(path)
        # It cuts names at their first space, after which several joints go by one name.
        if tuple(theirs.joint_names) == ours.names:
            joints = [theirs.node_index[joint] for joint in ours.names]
            errors[name] = float(np.abs(theirs.node_positions()[:, joints] - world_motion(ours)[0]).max())
    assert {name: error for name, error in errors.items() if error > 1e-9} == {}
    assert len(errors) >= 25


def test_too_many_joints_are_refused() -> None:
    joints = leg(*["Xrotation"] * (MAX_JOINTS + 1))
    content = text_of(joints, rows_for(joints, 1), indent="", end_sites=False).encode()
    with pytest.raises(BadFile, match=rf"^many\.bvh:{4 * MAX_JOINTS + 2}: more than {MAX_JOINTS} joints"):
        read_bvh(content, name="many.bvh")


def test_absurd_promise_takes_no_memory() -> None:
    with pytest.raises(BadFile, match="promises 999999999999999 frames of 1 values, the file has 2 rows"):
        read_bvh(one_column("1", "2", frames=999_999_999_999_999))


def test_missing_file_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"none\.bvh: cannot be read \(No such file or directory\)"):
        read_bvh(tmp_path / "none.bvh")


@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=1, max_size=20), st.sampled_from(range(5)))
def test_numbers_are_bit_exact_to_float(values: list[float], form: int) -> None:
    def token(value: float) -> str:
        return (repr(value), f"{value:.6f}", f"{value:.17e}", f"{value:+.3f}", f"{value:.25g}")[form]

    tokens = [token(value) for value in values]
    read = read_bvh(one_column(*tokens)).channel_values[:, 0]
    assert [value.hex() for value in read.tolist()] == [float(token).hex() for token in tokens]


@given(st.from_regex(r"[+-]?([0-9]{1,25}\.?[0-9]{0,25}|\.[0-9]{1,25})([eE][+-]?[0-9]{1,2})?", fullmatch=True))
def test_any_decimal_is_bit_exact_to_float(token: str) -> None:
    assert read_bvh(one_column(token)).channel_values[0, 0].hex() == float(token).hex()


PADDING = ["0.5"] * 10
"""Puts a token far enough from the end of a file for eight characters to be read at a time."""


@given(st.lists(st.from_regex(r"[+-]?[0-9]{1,9}\.[0-9]{0,9}", fullmatch=True), min_size=1, max_size=30))
def test_decimals_inside_a_block_are_bit_exact_to_float(tokens: list[str]) -> None:
    read = read_bvh(one_column(*tokens, *PADDING)).channel_values[: len(tokens), 0]
    assert [value.hex() for value in read.tolist()] == [float(token).hex() for token in tokens]


def test_any_byte_inside_a_number_is_read_as_float_does_or_refused() -> None:
    read = 0
    for byte in set(range(256)) - set(b"\t\n\v\f\r "):
        for before, after in ((b"-1", b"2.5"), (b"12", b".5"), (b"12.", b"5"), (b"1.25", b"")):
            content = one_column("TOKEN", *PADDING).replace(b"TOKEN", before + bytes([byte]) + after)
            try:
                value = read_bvh(content).channel_values[0, 0]
            except BadFile:
                continue
            assert value.hex() == float((before + bytes([byte]) + after).decode()).hex()
            read += 1
    assert read > 10 * 4


def test_more_odd_numbers_than_one_batch_holds() -> None:
    tokens = [f"{k}e-3" if k % 7 else str(k) for k in range(2000)]
    np.testing.assert_array_equal(
        read_bvh(one_column(*tokens)).channel_values[:, 0], [float(token) for token in tokens]
    )


@given(st.text(max_size=200))
def test_any_text_is_read_or_refused(text: str) -> None:
    for content in (text, f"HIERARCHY\n{text}", one_column("1").decode().replace("1\n", f"{text}\n")):
        try:
            read_bvh(content.encode("utf-8", errors="surrogatepass"))
        except BadFile as error:
            assert re.match(r"<bytes>:[1-9]\d*: ", str(error))


@pytest.mark.parametrize(
    ("written", "fps"),
    [
        ("0.0333333", 30.0),
        ("0.033333", 30.0),
        ("0.0333", 30.0),
        (".03333333333333", 30.0),
        ("0.008333", 120.0),
        ("0.0166667", 60.0),
        ("0.0166", 60.0),
        ("0.0167", 60.0),
        ("0.0168", 1 / 0.0168),
        ("0.0334", 1 / 0.0334),
        ("0.04", 25.0),
        ("0.0333667", 1 / 0.0333667),
        ("0.0417083", 1 / 0.0417083),
        ("1.0", 1.0),
        ("33.333", 1 / 33.333),
    ],
)
def test_frame_rate(written: str, fps: float) -> None:
    content = one_column("1").replace(b"Frame Time: 0.01", f"Frame Time: {written}".encode())
    assert read_bvh(content).fps == fps


def test_values_cannot_be_written_to() -> None:
    motion = read_bvh(one_column("1", "2"))
    for array in (motion.channel_values, motion.offsets):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@st.composite
def tree_clips(draw: st.DrawFn) -> Clip:
    """Any depth-first tree, rotations near and at the poles of the Euler angles among them."""
    n_joints, n_frames = draw(st.integers(1, 12)), draw(st.integers(1, 4))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    parents, open_joints = [-1], [0]
    for joint in range(1, n_joints):
        open_joints = open_joints[: rng.integers(1, len(open_joints) + 1)]
        parents.append(open_joints[-1])
        open_joints.append(joint)
    names = tuple(
        f"{draw(st.sampled_from(['End Site', 'MOTION', 'joint', 'Hüfte', 'OFFSET']))} {j}" for j in range(n_joints)
    )
    offsets = rng.normal(0.0, 0.3, (n_joints, 3))
    offsets[0] = 0.0
    angles = rng.uniform(-np.pi, np.pi, (n_frames, n_joints, 3))
    at_pole = rng.random((n_frames, n_joints)) < 0.3
    angles[at_pole, 1] = rng.choice([-1, 1]) * np.pi / 2 + rng.choice([0.0, 1e-12, 1e-9, 1e-7, 1e-5])
    turns = Rotation.from_euler("ZXY", angles.reshape(-1, 3)).as_quat(scalar_first=True).reshape(n_frames, n_joints, 4)
    skeleton = Skeleton(names, tuple(parents), offsets)
    return Clip(skeleton, turns, rng.normal(0.0, 5.0, (n_frames, 3)), draw(st.sampled_from([24.0, 29.97, 30.0, 120.0])))


@given(tree_clips(), st.sampled_from([0.01, 0.0254, 0.056444, 1.0]))
def test_random_tree_round_trip(tmp_path_factory: pytest.TempPathFactory, clip: Clip, unit_m: float) -> None:
    path = tmp_path_factory.getbasetemp() / "round_trip.bvh"
    write_bvh(path, clip, unit_m=unit_m)
    motion = read_bvh(path)
    assert (motion.names, motion.parents) == (clip.skeleton.names, clip.skeleton.parents)
    assert math.isclose(motion.fps, clip.fps, rel_tol=1e-8)
    error_m = np.abs(world_motion(motion)[0] * unit_m - world_positions(clip)).max()
    assert error_m < ROUND_TRIP_M


def test_round_trip_of_a_person(tmp_path: Path) -> None:
    clip = random_clip(200, amount_rad=2.0)
    write_bvh(tmp_path / "a.bvh", clip)
    motion = read_bvh(tmp_path / "a.bvh")
    np.testing.assert_allclose(world_motion(motion)[0] * 0.01, world_positions(clip), rtol=0, atol=ROUND_TRIP_M)
    assert [file.name for file in tmp_path.iterdir()] == ["a.bvh"]


def test_pybvh_reads_what_is_written(tmp_path: Path) -> None:
    pybvh = pytest.importorskip("pybvh", reason="pybvh is not installed: no second opinion on BVH")
    clip = random_clip(20, amount_rad=1.5)
    write_bvh(tmp_path / "a.bvh", clip)
    theirs = pybvh.read_bvh_file(tmp_path / "a.bvh", world_up="+y")
    joints = [theirs.node_index[name] for name in clip.skeleton.names]
    np.testing.assert_allclose(
        theirs.node_positions()[:, joints] * 0.01, world_positions(clip), rtol=0, atol=ROUND_TRIP_M
    )


@pytest.mark.parametrize("name", ["", " ", "a  b", "a ", "{", "a}", "a\nb", "a\tb", "a\0"])
def test_names_that_bvh_cannot_hold_are_refused(name: str, tmp_path: Path) -> None:
    clip = Clip(Skeleton((name,), (-1,), np.zeros((1, 3))), np.array([[[1.0, 0, 0, 0]]]), np.zeros((1, 3)), 30.0)
    with pytest.raises(BadMotion, match="cannot be written to BVH; remedy: rename"):
        write_bvh(tmp_path / "a.bvh", clip)
    assert not list(tmp_path.iterdir())


def test_joints_out_of_order_are_refused(tmp_path: Path) -> None:
    skeleton = Skeleton(("a", "b", "c", "d"), (-1, 0, 0, 1), np.zeros((4, 3)))
    clip = Clip(skeleton, np.tile([1.0, 0, 0, 0], (1, 4, 1)), np.zeros((1, 3)), 30.0)
    with pytest.raises(BadMotion, match="joint d: joints must be in depth-first order"):
        write_bvh(tmp_path / "a.bvh", clip)


def test_unwritable_place_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadFile, match=r"a\.bvh: cannot be written \(No such file or directory\)"):
        write_bvh(tmp_path / "none" / "a.bvh", random_clip(2))


@pytest.mark.parametrize("unit_m", [0.0, -0.01, math.nan, 100.0])
def test_unit_is_refused(unit_m: float, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="unit_m must be in"):
        write_bvh(tmp_path / "a.bvh", random_clip(2), unit_m=unit_m)


def test_bandai_namco_takes_agree_with_scipy(bandai_namco_zip: Path) -> None:
    check_members(bandai_namco_zip, slice(None, None, 131))


@pytest.mark.slow
def test_all_bandai_namco_takes_agree_with_scipy(bandai_namco_zip: Path) -> None:
    assert check_members(bandai_namco_zip, slice(None)) == 1310


def check_members(archive_path: Path, which: slice) -> int:
    """World positions of members of a zip, in centimetres, against the reference; the number of members."""
    with zipfile.ZipFile(archive_path) as archive:
        members = [name for name in archive.namelist() if name.endswith(".bvh")][which]
        for member in members:
            check_against_reference(archive.read(member), member, unit_m=0.01)
    return len(members)


def test_xia_files_agree_with_scipy(xia_folder: Path) -> None:
    files = sorted(xia_folder.glob("*.bvh"))
    assert len(files) == 4
    for file in files:
        check_against_reference(file.read_bytes(), file.name, unit_m=0.056444)


def check_against_reference(content: bytes, name: str, unit_m: float) -> None:
    ours, reference = read_bvh(content, name=name), reference_bvh.read_reference(content)
    assert ours.names == reference.names
    np.testing.assert_array_equal(ours.channel_values, reference.values)
    error_m = np.abs(world_motion(ours)[0] - reference.positions).max() * unit_m
    assert error_m < 1e-4, name
