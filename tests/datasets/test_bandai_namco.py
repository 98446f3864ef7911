from __future__ import annotations

import struct
import zipfile
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from bench.datasets import bandai_namco
from bench.datasets.bandai_namco import (
    FILE_NAME,
    MAX_MEMBER_BYTES,
    PublishedTake,
    channel_digest,
    judged_content,
    load,
    published_takes,
    write_takes_csv,
)
from bench.errors import BadData, BadFile
from bench.motion.bvh import BvhMotion, read_bvh
from bench.motion.kinematics import floor_height, world_positions
from tests.golden.make_bvh import POSITIONS, ZXY, Joint, text_of
from tests.motion.source_trees import BANDAI_NAMCO_TREE

NAMES = ("dataset-2_walk_normal_001", "dataset-2_walk_normal_002", "dataset-2_wave-left-hand_active_001")
DEPTH_IN_ZIP = "dataset/Bandai-Namco-Research-Motiondataset-2/data"


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.fixture
def parses(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The names of the files that are parsed, as they are parsed."""
    parsed: list[str] = []

    def counted(source: bytes, *, name: str) -> BvhMotion:
        parsed.append(name)
        return read_bvh(source, name=name)

    monkeypatch.setattr(bandai_namco, "read_bvh", counted)
    return parsed


def take_text(seed: int, n_frames: int = 5, hips_height: float = 82.12) -> str:
    """A take in the dataset's form: 22 joints of 6 channels, Zrot Xrot Yrot, absolute hips, 30 fps."""
    rng = np.random.default_rng(seed)
    names = list(BANDAI_NAMCO_TREE)
    bones = np.random.default_rng(0).uniform(5.0, 30.0, (len(names), 3)).round(4)
    bones[0], bones[1] = 0.0, (0.0, hips_height, 0.0)
    joints = [
        Joint(name, -1 if parent is None else names.index(parent), tuple(bone), f"{POSITIONS} {ZXY}")
        for (name, parent), bone in zip(BANDAI_NAMCO_TREE.items(), bones.tolist(), strict=True)
    ]
    rows = np.zeros((n_frames, len(names), 6))
    rows[:, :, :3] = bones
    rows[:, 1, :3] += rng.uniform(-50.0, 50.0, (n_frames, 3)).round(4)
    rows[:, 1:, 3:] = rng.uniform(-90.0, 90.0, (n_frames, len(names) - 1, 3)).round(4)
    return text_of(joints, rows.reshape(n_frames, -1).tolist())


def tiny_takes(names: tuple[str, ...] = NAMES) -> dict[str, str]:
    return {name: take_text(seed) for seed, name in enumerate(names)}


def as_folder(path: Path, takes: Mapping[str, str]) -> Path:
    for name, text in takes.items():
        target = path / "deep" / "data" / f"{name}.bvh"
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text)
    return path


def as_zip(path: Path, takes: Mapping[str, str], compression: int = zipfile.ZIP_DEFLATED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        archive.writestr("LICENSE", "a licence")
        for name, text in takes.items():
            archive.writestr(f"{DEPTH_IN_ZIP}/{name}.bvh", text)
    return path


def publish(monkeypatch: pytest.MonkeyPatch, takes: Mapping[str, str]) -> None:
    """Let these takes be the published subset."""
    rows = {
        name: PublishedTake(name, motion.n_frames, channel_digest(motion))
        for name, motion in ((name, read_bvh(text.encode())) for name, text in takes.items())
    }
    monkeypatch.setattr(bandai_namco, "published_takes", lambda: rows)


def test_folder_and_zip_give_the_same_dataset(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = tiny_takes()
    publish(monkeypatch, takes)
    sources = [
        as_folder(tmp_path / "folder", takes),
        as_zip(tmp_path / "a.zip", takes),
        as_zip(tmp_path / "stored.zip", dict(reversed(takes.items())), zipfile.ZIP_STORED),
        as_zip(tmp_path / "crlf.zip", {name: text.replace("\n", "\r\n") for name, text in takes.items()}),
    ]
    datasets = [load(source) for source in sources]
    assert {dataset.dataset_id for dataset in datasets} == {"bandai-namco@1"}
    assert len({dataset.digest for dataset in datasets}) == 1
    for dataset in datasets[1:]:
        for one, other in zip(datasets[0].takes, dataset.takes, strict=True):
            assert one.take_id == other.take_id
            np.testing.assert_array_equal(one.clip.rotations_wxyz, other.clip.rotations_wxyz)


def test_labels(tmp_path: Path) -> None:
    takes = {"dataset-1_walk-left_active_001": take_text(1, hips_height=80.5), **tiny_takes()}
    dataset = load(as_folder(tmp_path / "folder", takes))
    assert [(t.take_id, t.content, t.style, t.session) for t in dataset.takes] == [
        ("dataset-1_walk-left_active_001", "walk-left", "active", "hips offset 80.50 cm"),
        ("walk_normal_001", "walk", "normal", "hips offset 82.12 cm"),
        ("walk_normal_002", "walk", "normal", "hips offset 82.12 cm"),
        ("wave-left-hand_active_001", "wave-left-hand", "active", "hips offset 82.12 cm"),
    ]
    assert dataset.content_labels == ("left-hand", "walk", "walk-left")
    assert {(take.dataset, take.clip.fps, take.clip.n_frames) for take in dataset.takes} == {("bandai-namco", 30.0, 5)}
    for take in dataset.takes:
        assert abs(floor_height(world_positions(take.clip))) < 1e-9
        assert take.clip.skeleton.virtual == {"LeftHandIndex1", "RightHandIndex1"}


@pytest.mark.parametrize(
    ("content", "judged"),
    [
        ("raise-up-left-hand", "left-hand"),
        ("wave-left-hand", "left-hand"),
        ("wave-right-hand", "right-hand"),
        ("raise-up-both-hands", "both-hands"),
        ("wave-both-hands", "both-hands"),
        ("walk-turn-left", "walk-turn-left"),
        ("run", "run"),
    ],
)
def test_raise_up_and_wave_are_judged_as_one(content: str, judged: str) -> None:
    assert judged_content(content) == judged


def test_takes_beyond_the_published_are_left_out(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = tiny_takes()
    publish(monkeypatch, {name: takes[name] for name in NAMES[:2]})
    dataset = load(as_zip(tmp_path / "a.zip", takes))
    assert dataset.dataset_id == "bandai-namco@1"
    assert [take.take_id for take in dataset.takes] == ["walk_normal_001", "walk_normal_002"]
    assert "1 takes beyond the published subset are left out" in dataset.notes


def test_missing_takes_make_it_local(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = tiny_takes()
    publish(monkeypatch, takes)
    dataset = load(as_folder(tmp_path / "folder", {name: takes[name] for name in NAMES[:2]}))
    assert dataset.dataset_id == "bandai-namco-local"
    assert "1 of 3 published takes are missing, so all 2 found are used" in dataset.notes


def test_changed_takes_make_it_local(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    takes = tiny_takes()
    publish(monkeypatch, takes)
    changed = load(as_folder(tmp_path / "folder", {**takes, NAMES[0]: take_text(99)}))
    assert changed.dataset_id == "bandai-namco-local"
    assert "some takes differ from the published ones, so all takes found are used" in changed.notes
    assert changed.digest != load(as_zip(tmp_path / "a.zip", takes)).digest


@pytest.mark.parametrize("store", [as_folder, lambda path, takes: as_zip(path.with_suffix(".zip"), takes)])
def test_loading_twice_parses_once(
    store: Callable[[Path, Mapping[str, str]], Path], tmp_path: Path, parses: list[str]
) -> None:
    source = store(tmp_path / "data", tiny_takes())
    first = load(source)
    assert parses == [f"{name}.bvh" for name in NAMES]
    second = load(source)
    assert len(parses) == len(NAMES)
    assert (second.digest, second.dataset_id, second.notes) == (first.digest, first.dataset_id, first.notes)
    for one, other in zip(first.takes, second.takes, strict=True):
        np.testing.assert_allclose(one.clip.rotations_wxyz, other.clip.rotations_wxyz, rtol=0, atol=1e-15)
        np.testing.assert_array_equal(one.clip.root_xyz_m, other.clip.root_xyz_m)


def test_changed_file_is_parsed_again(tmp_path: Path, parses: list[str]) -> None:
    takes = tiny_takes()
    source = as_folder(tmp_path / "data", takes)
    before = load(source).digest
    as_folder(source, {NAMES[1]: take_text(77)})
    assert load(source).digest != before
    assert len(parses) == 2 * len(NAMES)


def test_progress_reaches_the_end(tmp_path: Path) -> None:
    seen: list[tuple[str, int, int]] = []
    load(as_folder(tmp_path / "data", tiny_takes()), lambda *step: seen.append(step))
    assert seen == [("reading BVH files", done, 3) for done in (1, 2, 3)]


def test_files_behind_links_are_read(tmp_path: Path) -> None:
    real = as_folder(tmp_path / "real", tiny_takes())
    (tmp_path / "links").mkdir()
    for file in real.rglob("*.bvh"):
        (tmp_path / "links" / file.name).symlink_to(file)
    assert len(load(tmp_path / "links").takes) == len(NAMES)


def test_table_of_published_takes(tmp_path: Path) -> None:
    write_takes_csv(as_zip(tmp_path / "a.zip", tiny_takes()), tmp_path / "takes.csv")
    lines = (tmp_path / "takes.csv").read_text().splitlines()
    assert lines[0] == "name,frames,digest"
    assert lines[1] == f"{NAMES[0]},5,{channel_digest(read_bvh(take_text(0).encode()))}"
    rows = published_takes()
    assert len(rows) == 1310
    assert all(FILE_NAME.fullmatch(f"{name}.bvh") and len(row.digest) == 32 for name, row in rows.items())


def refusal(source: Path | None, family: type[BadData] | type[BadFile]) -> str:
    with pytest.raises((BadData, BadFile)) as raised:
        load(source)
    assert type(raised.value) is family
    assert "\n" not in str(raised.value)
    assert raised.value.remedy
    return str(raised.value)


def test_no_path_is_refused() -> None:
    assert "no path is given" in refusal(None, BadData)


def test_missing_path_is_refused(tmp_path: Path) -> None:
    assert refusal(tmp_path / "none.zip", BadData).startswith(f"{tmp_path / 'none.zip'}: no such file or folder; ")


def test_text_file_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.txt").write_text("hello")
    assert "expected a folder or a zip, got neither" in refusal(tmp_path / "notes.txt", BadFile)


def test_empty_zip_is_refused(tmp_path: Path) -> None:
    zipfile.ZipFile(tmp_path / "a.zip", "w").close()
    assert "expected files called like dataset-2_walk_normal_001.bvh, found none; " in refusal(
        tmp_path / "a.zip", BadData
    )


def test_folder_without_takes_is_refused(tmp_path: Path) -> None:
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "readme.md").write_text("hello")
    assert "found none; " in refusal(tmp_path / "data", BadData)
    (tmp_path / "data" / "dance.bvh").write_text(take_text(0))
    assert "found none, but 1 other BVH files; " in refusal(tmp_path / "data", BadData)


def test_broken_files_are_counted_and_the_first_is_named(tmp_path: Path, own_cache: Path) -> None:
    takes = tiny_takes()
    takes[NAMES[1]] = takes[NAMES[1]].replace("MOTION", "MOTIONS")
    takes[NAMES[2]] = "\n".join(takes[NAMES[2]].splitlines()[:-1])
    message = refusal(as_folder(tmp_path / "data", takes), BadFile)
    line = takes[NAMES[1]].splitlines().index("MOTIONS") + 1
    assert message.startswith(f"{tmp_path / 'data'}: 2 of 3 BVH files cannot be read, the first is ")
    assert f"the first is {NAMES[1]}.bvh:{line}: expected JOINT" in message
    assert message.count("remedy: ") == 1
    assert not own_cache.exists()


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (("JOINT Chest", "JOINT Brust"), r"the skeleton lacks Chest"),
        (("Frame Time: 0.0333333", "Frame Time: 0.0166667"), r"expected 30 frames per second, got 60"),
        (("Frame Time: 0.0333333", "Frame Time: 33.3333"), r"expected 30 frames per second, got 0.03"),
    ],
)
def test_take_of_another_kind_is_named(change: tuple[str, str], problem: str, tmp_path: Path) -> None:
    source = as_folder(tmp_path / "data", {NAMES[0]: take_text(0).replace(*change)})
    assert f"the first is {NAMES[0]}.bvh: {problem}" in refusal(source, BadFile)


@pytest.mark.parametrize("member", ["../{}", "/{}", "a/../../{}", "..\\{}", "a\\..\\..\\{}"])
def test_member_outside_the_archive_is_refused(member: str, tmp_path: Path) -> None:
    source = as_zip(tmp_path / "a.zip", tiny_takes())
    with zipfile.ZipFile(source, "a") as archive:
        archive.writestr(member.format("dataset-2_run_normal_001.bvh"), take_text(4))
    assert "lies outside the archive; likely cause: not the archive as published" in refusal(source, BadFile)


def test_same_take_twice_is_refused(tmp_path: Path) -> None:
    source = as_folder(tmp_path / "data", tiny_takes())
    (source / "copy").mkdir()
    (source / "copy" / f"{NAMES[0]}.bvh").write_text(take_text(0))
    message = refusal(source, BadData)
    assert f"{NAMES[0]}.bvh is there twice: copy/{NAMES[0]}.bvh and deep/data/{NAMES[0]}.bvh" in message


def change_directory(source: Path, at: int, form: str, value: int) -> None:
    """Overwrite a field of the central directory entry of the archive's last member."""
    content = bytearray(source.read_bytes())
    struct.pack_into(form, content, content.rindex(b"PK\x01\x02") + at, value)
    source.write_bytes(content)


def test_encrypted_member_is_named(tmp_path: Path) -> None:
    source = as_zip(tmp_path / "a.zip", tiny_takes())
    change_directory(source, 8, "<H", 1)
    message = refusal(source, BadFile)
    assert "1 of 3 BVH files cannot be read" in message
    assert f"{NAMES[2]}.bvh: cannot be read" in message
    assert "encrypted" in message


def test_damaged_member_is_named(tmp_path: Path) -> None:
    source = as_zip(tmp_path / "a.zip", tiny_takes(), zipfile.ZIP_STORED)
    content = source.read_bytes()
    source.write_bytes(content.replace(b"JOINT Chest", b"JOINT Cheat", 1))
    assert f"{NAMES[0]}.bvh: cannot be read (Bad CRC-32" in refusal(source, BadFile)


def test_absurdly_big_member_is_refused(tmp_path: Path) -> None:
    source = as_zip(tmp_path / "a.zip", tiny_takes())
    change_directory(source, 24, "<I", MAX_MEMBER_BYTES + 1)
    assert f"claims {MAX_MEMBER_BYTES + 1}; likely cause" in refusal(source, BadFile)


def test_some_published_takes_from_folder_and_zip(
    bandai_namco_zip: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with zipfile.ZipFile(bandai_namco_zip) as archive:
        members = [name for name in archive.namelist() if name.endswith(".bvh")][::500]
        takes = {Path(name).stem: archive.read(name).decode() for name in members}
    rows = {name: published_takes()[name] for name in takes}
    monkeypatch.setattr(bandai_namco, "published_takes", lambda: rows)
    datasets = [load(as_folder(tmp_path / "folder", takes)), load(as_zip(tmp_path / "a.zip", takes))]
    assert [dataset.dataset_id for dataset in datasets] == ["bandai-namco@1"] * 2
    assert datasets[0].digest == datasets[1].digest
    assert [take.clip.n_frames for take in datasets[0].takes] == [row.frames for row in rows.values()]


def test_part_of_the_published_takes_is_local(bandai_namco_zip: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(bandai_namco_zip) as archive:
        members = [name for name in archive.namelist() if name.endswith(".bvh")][:2]
        takes = {Path(name).stem: archive.read(name).decode() for name in members}
    dataset = load(as_folder(tmp_path / "folder", takes))
    assert dataset.dataset_id == "bandai-namco-local"
    assert dataset.notes[0] == "1308 of 1310 published takes are missing, so all 2 found are used"


@pytest.mark.slow
def test_published_subset_as_a_whole(bandai_namco_zip: Path, parses: list[str]) -> None:
    dataset = load(bandai_namco_zip)
    assert (dataset.dataset_id, len(dataset.takes), len(parses)) == ("bandai-namco@1", 1310, 1310)
    assert (len(dataset.native_content_labels), len(dataset.content_labels), len(dataset.style_labels)) == (10, 7, 7)
    assert sum(take.clip.n_frames for take in dataset.takes) == 173_026
    assert len({take.session for take in dataset.takes}) == 3
    by_style = {
        style: {take.session for take in dataset.takes if take.style == style} for style in dataset.style_labels
    }
    assert all(len(sessions) == 1 for sessions in by_style.values())
    assert not any("left out" in note or "missing" in note for note in dataset.notes)
    assert load(bandai_namco_zip).digest == dataset.digest
    assert len(parses) == 1310
