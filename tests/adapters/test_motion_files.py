from __future__ import annotations

import contextlib
import io
import os
import tempfile
import tracemalloc
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bench.adapters.motion_files import motion_of, npz_bytes, parse_npz, read_bounded, read_motion
from bench.errors import BadFile, BenchError
from bench.motion.bvh import write_bvh
from tests.motion.factory import random_clip

CLIP = random_clip(12)
NAMES = ("rotations_wxyz", "root_xyz_m")
GOOD = npz_bytes({"rotations_wxyz": CLIP.rotations_wxyz, "root_xyz_m": CLIP.root_xyz_m})
HEADER = "{{'descr': '<f8', 'fortran_order': False, 'shape': {shape}, }}"


def npy(header: str, data: bytes = b"") -> bytes:
    text = header.encode() + b" " * (-(len(header) + 11) % 64) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text + data


def zipped(members: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", compression) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
    return buffer.getvalue()


def saved(rotations_wxyz: NDArray[Any]) -> bytes:
    buffer = io.BytesIO()
    np.savez(buffer, rotations_wxyz=rotations_wxyz, root_xyz_m=CLIP.root_xyz_m)
    return buffer.getvalue()


@pytest.mark.parametrize("content", [GOOD, saved(CLIP.rotations_wxyz)], ids=["ours", "numpy"])
def test_arrays_survive(content: bytes) -> None:
    arrays = parse_npz(content, NAMES, "x")
    np.testing.assert_array_equal(arrays["rotations_wxyz"], CLIP.rotations_wxyz)
    np.testing.assert_array_equal(arrays["root_xyz_m"], CLIP.root_xyz_m)


def test_numpy_reads_what_is_written() -> None:
    with np.load(io.BytesIO(GOOD), allow_pickle=False) as file:
        np.testing.assert_array_equal(file["rotations_wxyz"], CLIP.rotations_wxyz)
    with np.load(io.BytesIO(npz_bytes({"fps": np.array(30.0)})), allow_pickle=False) as file:
        assert file["fps"].shape == ()


@pytest.mark.parametrize("dtype", ["<f4", ">f4", ">f8"])
@pytest.mark.parametrize("order", ["C", "F"])
def test_other_floats_orders_and_compression_are_read(dtype: str, order: str) -> None:
    buffer = io.BytesIO()
    np.savez_compressed(buffer, a=np.asarray(CLIP.root_xyz_m, dtype=dtype, order=order))  # type: ignore[call-overload]
    np.testing.assert_allclose(parse_npz(buffer.getvalue(), ("a",), "x")["a"], CLIP.root_xyz_m, rtol=1e-6)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "is not a readable .npz"),
        (b"PK\x03\x04", "is not a readable .npz"),
        (GOOD[:-30], "is not a readable .npz"),
        (npz_bytes({"root_xyz_m": CLIP.root_xyz_m}), "no array 'rotations_wxyz'"),
        (saved(np.array([{"a": 1}], dtype=object)), "is not a plain array of float32 or float64.*need pickle"),
        (saved(np.zeros(3, dtype=np.int64)), "is not a plain array"),
        (zipped({f"{name}.npy": b"hello" for name in NAMES}), "is not an .npy array"),
        (zipped({f"{name}.npy": npy(HEADER.format(shape="(10000000, 21, 4)")) for name in NAMES}), "claims shape"),
        (zipped({f"{name}.npy": npy("(" * 5000) for name in NAMES}), "is not a plain array"),
        (zipped({f"{n}.npy": b"" for n in range(99)}), "more than 16 arrays"),
        (zipped({f"{name}.npy": bytes(50 << 20) for name in NAMES}, zipfile.ZIP_DEFLATED), "zip bomb"),
    ],
    ids=range(11),
)
def test_what_is_no_motion_is_refused(content: bytes, match: str) -> None:
    with pytest.raises(BadFile, match=match):
        parse_npz(content, NAMES, "x")


def test_bombs_and_claims_take_little_memory() -> None:
    bomb = zipped({f"{name}.npy": bytes(50 << 20) for name in NAMES}, zipfile.ZIP_DEFLATED)
    claim = zipped({f"{name}.npy": npy(HEADER.format(shape="(10000000, 21, 4)")) for name in NAMES})
    tracemalloc.start()
    for content in (bomb, claim):
        with pytest.raises(BadFile):
            parse_npz(content, NAMES, "x")
    assert tracemalloc.get_traced_memory()[1] < 4 << 20
    tracemalloc.stop()


@given(st.data())
def test_damaged_npz_raises_only_ours(data: st.DataObject) -> None:
    content = bytearray(GOOD)
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)))
    with contextlib.suppress(BenchError):
        motion_of(bytes(content[:cut] if data.draw(st.booleans()) else content), ".npz", CLIP, "x")


@given(st.text(max_size=200), st.binary(max_size=200))
def test_any_npy_header_raises_only_ours(header: str, data: bytes) -> None:
    with pytest.raises(BadFile):
        parse_npz(zipped({f"{name}.npy": npy(header[:100], data) for name in NAMES}), NAMES, "x")


@given(st.lists(st.tuples(st.integers(0, 10_000), st.binary(min_size=1, max_size=6)), max_size=8))
def test_damaged_bvh_raises_only_ours(edits: list[tuple[int, bytes]]) -> None:
    content = bytearray(BVH)
    for place, data in edits:
        content[place % len(content) : place % len(content) + len(data)] = data
    with contextlib.suppress(BenchError):
        motion_of(bytes(content), ".bvh", CLIP, "x")


def bvh_bytes() -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        write_bvh(Path(folder) / "clip.bvh", CLIP)
        return (Path(folder) / "clip.bvh").read_bytes()


BVH = bvh_bytes()


def test_bvh_answers_stand_on_the_contents_bones() -> None:
    clip = motion_of(BVH, ".bvh", CLIP, "x")
    assert clip.skeleton is CLIP.skeleton
    np.testing.assert_allclose(clip.root_xyz_m, CLIP.root_xyz_m, atol=1e-7)


@pytest.mark.parametrize(
    ("old", "new", "match"),
    [
        (b"LeftFoot", b"left_foot", "LeftFoot is missing"),
        (b"Frames: 12", b"Frames: 99999999999", "promises 99999999999 frames"),
    ],
)
def test_bvh_answers_of_other_skeletons_or_claims_are_refused(old: bytes, new: bytes, match: str) -> None:
    with pytest.raises(BenchError, match=match):
        motion_of(BVH.replace(old, new), ".bvh", CLIP, "x")


def test_only_regular_files_inside_the_folder_are_read(tmp_path: Path) -> None:
    folder = tmp_path / "in"
    (folder / "deep").mkdir(parents=True)
    (tmp_path / "secret").write_bytes(b"secret")
    (folder / "deep" / "a.npz").write_bytes(b"1234")
    (folder / "link.npz").symlink_to(tmp_path / "secret")
    (folder / "linked").symlink_to(tmp_path)
    os.mkfifo(folder / "pipe.npz")
    assert read_bounded(folder, "deep/a.npz", 4) == b"1234"
    for name, match in {
        "../secret": "is no path inside the folder",
        "/etc/hostname": "is no path inside the folder",
        "deep/../../secret": "is no path inside the folder",
        "": "is no path inside the folder",
        "a\0b": "is no path inside the folder",
        "link.npz": "it is a link",
        "linked/secret": "cannot be read",
        "pipe.npz": "is not a regular file",
        "deep": "is not a regular file",
        "none.npz": "No such file",
    }.items():
        with pytest.raises(BadFile, match=match):
            read_bounded(folder, name, 100)
    with pytest.raises(BadFile, match="has 4 bytes, at most 3"):
        read_bounded(folder, "deep/a.npz", 3)
    with pytest.raises(BadFile, match=r"expected \.npz or \.bvh"):
        read_motion(folder, "a.pkl", CLIP, max_frames=12)


@given(st.text(max_size=40))
def test_any_name_raises_only_ours(name: str) -> None:
    with pytest.raises(BadFile):
        read_bounded(Path("/nowhere"), name, 10)
