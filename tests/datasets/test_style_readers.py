"""Readers of Xia 2015, 100STYLE and ZeroEGGS, on small files that the tests write in each format."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.datasets import style100, xia2015, zeroeggs
from bench.datasets.table import how_to_place
from bench.errors import BadConfig, BadData
from bench.motion.skeleton_maps import CMU_UNIT_M
from tests.motion.factory import random_clip
from tests.motion.source_skeletons import SOURCES, on_source, write_motion

CUTS = """STYLE_NAME,BR_START,BR_STOP,FW_START,FW_STOP,TR2_START,TR2_STOP
Angry,N/A,N/A,10,1000,N/A,N/A
Proud,5,30,0,20,N/A,N/A
"""


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "cache"))


def write(path: Path, skeleton: str, n_frames: int = 6, fps: float = 60.0, unit_m: float = 0.01) -> None:
    write_motion(path, on_source(random_clip(n_frames, fps), SOURCES[skeleton], unit_m))


@pytest.mark.parametrize(
    ("stem", "labels"),
    [
        ("angry_13_000", ("running", "angry")),
        ("sexy_01_001", ("walking", "sexy")),
        ("strutting_28", ("transitions", "strutting")),
        ("old_fast_punching_003", ("punching", "old")),
        ("neutral_kicking_001", ("kicking", "neutral")),
        ("normal walking_proud_07", ("walking", "proud")),
        ("jumping_childlike_02", ("jumping", "childlike")),
        ("fast walking_proud_07_m", None),
        ("proud_dancing_001", None),
        ("Angry_FW", None),
    ],
)
def test_xia_names(stem: str, labels: tuple[str, str] | None) -> None:
    assert xia2015.labels_of(stem) == labels


def test_xia_numbers() -> None:
    counts = [xia2015.content_of_number(number) for number in range(1, 29)]
    assert {content: counts.count(content) for content in dict.fromkeys(counts)} == {
        "walking": 12, "running": 3, "jumping": 2, "punching": 4, "kicking": 2, "transitions": 5,
    }  # fmt: skip
    with pytest.raises(BadData, match="action numbers are 1 to 28, got 29"):
        xia2015.labels_of("angry_29_000")


def test_aberman_split_has_56_files() -> None:
    names = [f"{style}_{number:02d}_{n:03d}" for style in xia2015.STYLES for number in range(1, 29) for n in range(2)]
    test = xia2015.aberman_test_names(reversed(names))
    assert len(test) == 56
    assert [name for name in test if name.startswith("angry")] == [
        "angry_01_000", "angry_01_001", "angry_02_000", "angry_13_000", "angry_16_000", "angry_18_000", "angry_22_000",
    ]  # fmt: skip


def test_xia_folder_of_all_schemes(tmp_path: Path) -> None:
    folder = tmp_path / "xia"
    for stem in ("angry_13_000", "old_fast_punching_003", "jumping_childlike_02", "jumping_childlike_02_m"):
        write(folder / f"{stem}.bvh", "cmu-31", fps=120.0, unit_m=CMU_UNIT_M)
    dataset = xia2015.load(folder)
    assert [(take.take_id, take.content, take.style) for take in dataset.takes] == [
        ("angry_13_000", "running", "angry"),
        ("jumping_childlike_02", "jumping", "childlike"),
        ("old_fast_punching_003", "punching", "old"),
    ]
    assert {take.clip.fps for take in dataset.takes} == {120.0}
    assert 1.2 < dataset.takes[0].clip.skeleton.stature_m < 1.5
    assert any("1 files are mirrored copies" in note for note in dataset.notes)
    with pytest.raises(BadData, match="no path is given"):
        xia2015.load(None)


def test_xia_sample(xia_folder: Path) -> None:
    dataset = xia2015.load(xia_folder)
    assert {take.take_id: (take.content, take.clip.n_frames) for take in dataset.takes} == {
        "angry_13_000": ("running", 140),
        "depressed_18_000": ("punching", 105),
        "neutral_01_000": ("walking", 327),
        "sexy_01_000": ("walking", 258),
    }


def style100_folder(tmp_path: Path, cuts: str = CUTS) -> Path:
    folder = tmp_path / "100STYLE"
    write(folder / "Angry" / "Angry_FW.bvh", "xsens", 1010)
    write(folder / "Proud" / "Proud_FW.bvh", "xsens", 25)
    (folder / "Frame_Cuts.csv").write_text(cuts)
    return folder


def test_100style_uses_half_open_cuts_and_pieces(tmp_path: Path) -> None:
    dataset = style100.load(style100_folder(tmp_path))
    assert [(take.take_id, take.style, take.clip.n_frames) for take in dataset.takes] == [
        ("Angry/Angry_FW-001", "Angry", 480),
        ("Angry/Angry_FW-002", "Angry", 510),
        ("Proud/Proud_FW-001", "Proud", 20),
    ]
    assert {take.content for take in dataset.takes} == {"forwards walking"}
    assert any(f"2 of {style100.PUBLISHED_FILES} recordings" in note for note in dataset.notes)


def test_100style_cuts_are_checked(tmp_path: Path) -> None:
    folder = style100_folder(tmp_path, CUTS.replace("0,20", "20,20"))
    with pytest.raises(BadData, match=r"Frame_Cuts.csv:3: FW from '20' to '20' is no range"):
        style100.load(folder)
    (folder / "Frame_Cuts.csv").write_text("NAME\n")
    with pytest.raises(BadData, match="has no column STYLE_NAME"):
        style100.load(folder)
    (folder / "Frame_Cuts.csv").unlink()
    with pytest.raises(BadData, match=r"there is no Frame_Cuts.csv"):
        style100.load(folder)


def test_100style_totals_are_the_published_ones() -> None:
    wrong = style100.check_totals({("Angry", "FW"): (0, 100)})
    assert wrong[0] == "1 recordings in Frame_Cuts.csv, 810 published"
    gaits = [*list(style100.GAITS)[:8]]
    cuts = {(f"S{n}", gait): (0, 10) for n in range(100) for gait in gaits}
    cuts |= {(f"S{n}", "TR2"): (0, 10) for n in range(8)} | {(f"S{n}", "TR3"): (0, 10) for n in range(2)}
    cuts["S1", "TR3"] = (0, style100.PUBLISHED_TRANSITION_FRAMES - 109 * 10)
    cuts["S1", "FW"] = (0, style100.PUBLISHED_FRAMES - style100.PUBLISHED_TRANSITION_FRAMES - 699 * 10)
    assert style100.check_totals(cuts) == []


def test_zeroeggs(tmp_path: Path) -> None:
    folder = tmp_path / "clean"
    write(folder / "001_Neutral_0_x_1_0.bvh", "zeroeggs", 500)
    write(folder / "006_Sad_0.bvh", "zeroeggs")
    write(folder / "001_Neutral_0_mirror.bvh", "zeroeggs")
    dataset = zeroeggs.load(folder)
    assert [(take.take_id, take.style, take.clip.n_frames) for take in dataset.takes] == [
        ("001_Neutral_0_x_1_0-001", "neutral", 500),
        ("006_Sad_0-001", "Sad", 6),
    ]
    assert dataset.content_labels == ("speech",)
    assert any("unit cm assumed" in note for note in dataset.notes)
    write(folder / "original" / "006_Sad_0.bvh", "zeroeggs")
    with pytest.raises(BadData, match="sequence 006 is there twice"):
        zeroeggs.load(folder)


def test_foreign_folders_are_refused(tmp_path: Path) -> None:
    write(tmp_path / "walk.bvh", "mixamo")
    (tmp_path / "Frame_Cuts.csv").write_text(CUTS)
    for load in (xia2015.load, style100.load, zeroeggs.load):
        with pytest.raises(BadData, match="no file is called like"):
            load(tmp_path)


def test_how_to_place() -> None:
    assert "https://www.ianxmason.com/100style/" in how_to_place("100style")
    assert "nothing to fetch" in how_to_place("procedural")
    with pytest.raises(BadConfig, match="unknown dataset 'cats'"):
        how_to_place("cats")
