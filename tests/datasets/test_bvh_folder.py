from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.datasets.base import Dataset
from bench.datasets.bvh_folder import load
from bench.datasets.labels import labels_from_pattern
from bench.datasets.split import deal
from bench.datasets.table import load_dataset
from bench.errors import BadConfig, BadData, BadFile, BadMotion
from tests.motion.factory import random_clip
from tests.motion.source_skeletons import SOURCES, on_source, write_motion

PLACES = ("old/walk_1.bvh", "old/kick_1.bvh", "young/walk_1.bvh")
LABELS = (
    "file,content,style,actor\nold/walk_1.bvh,walk,old,ann\nold/kick_1,kick,old,\nyoung/walk_1.bvh,walk,young,bob\n"
)


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    for seed, place in enumerate(PLACES):
        write_motion(tmp_path / "mine" / place, on_source(random_clip(8, 60.0, seed=seed), SOURCES["mixamo"]))
    return tmp_path / "mine"


def labelled(folder: Path, text: str = LABELS) -> Path:
    (folder / "labels.csv").write_text(text)
    return folder


def options(folder: Path, text: str) -> Path:
    (folder / "stylebench.toml").write_text(text)
    return folder


def facts(dataset: Dataset) -> list[tuple[str, str | None, str | None, str | None]]:
    return [(take.take_id, take.content, take.style, take.actor) for take in dataset.takes]


def test_labels_csv(folder: Path) -> None:
    dataset = load_dataset("bvh-folder", labelled(folder))
    assert facts(dataset) == [
        ("old/kick_1", "kick", "old", None),
        ("old/walk_1", "walk", "old", "ann"),
        ("young/walk_1", "walk", "young", "bob"),
    ]
    assert dataset.dataset_id == "bvh-folder-mine"
    notes = "; ".join(dataset.notes)
    assert "skeleton mixamo, recognised" in notes
    assert "unit cm assumed" in notes
    assert "Y up assumed" in notes
    assert "60 frames per second" in notes
    assert {take.clip.fps for take in dataset.takes} == {60.0}


def test_pattern_gives_the_same_takes(folder: Path) -> None:
    by_table = load(labelled(folder, LABELS.replace(",ann", ",").replace(",bob", ",")))
    (folder / "labels.csv").unlink()
    by_pattern = load(options(folder, 'pattern = "{style}/{content}_{any}"'))
    assert facts(by_pattern) == facts(by_table)


def test_digest_follows_content_labels_and_options(folder: Path) -> None:
    first = load(labelled(folder)).digest
    assert load(folder).digest == first
    assert load(labelled(folder, LABELS.replace("bob", "eve"))).digest != first
    assert load(options(labelled(folder), "fps = 30")).digest != first


def test_options_override(folder: Path) -> None:
    assumed = load(labelled(folder)).takes[0].clip
    given = load(options(folder, 'unit = "inch"\nfps = 24\nup = "y"\nskeleton = "mixamo"'))
    assert given.notes == ()
    clip = given.takes[0].clip
    assert clip.fps == 24.0
    np.testing.assert_allclose(clip.skeleton.offsets_m, assumed.skeleton.offsets_m * 2.54, atol=1e-9)


def test_files_without_labels_are_said(folder: Path) -> None:
    dataset = load(labelled(folder, "\n".join(LABELS.splitlines()[:3])))
    assert len(dataset.takes) == 2
    assert any("1 BVH files without a row" in note for note in dataset.notes)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("file,style\n", r"labels.csv:1: lacks the column content; it has file, style"),
        (LABELS + "young/jump.bvh,jump,young,\n", r"labels.csv:5: there is no file young/jump.bvh"),
        (LABELS + "old/walk_1,walk,old,\n", r"labels.csv:5: old/walk_1.bvh is labelled twice"),
        ("file,content,style\nold/walk_1.bvh,,old\n", r"labels.csv:2: no content in this row"),
        ("file,content,style\n", "has no row"),
    ],
)
def test_bad_labels_are_refused(folder: Path, text: str, match: str) -> None:
    with pytest.raises(BadData, match=match):
        load(labelled(folder, text))


def test_no_labels_are_refused(folder: Path, tmp_path: Path) -> None:
    with pytest.raises(BadData, match=r"neither labels.csv nor a pattern .* 3 BVH files"):
        load(folder)
    with pytest.raises(BadConfig, match=r"labels.csv and a pattern are both given"):
        load(options(labelled(folder), 'pattern = "{style}/{content}_{any}"'))
    with pytest.raises(BadData, match="no path is given"):
        load(None)
    (tmp_path / "empty").mkdir()
    with pytest.raises(BadData, match="there is no BVH file"):
        load(tmp_path / "empty")


@pytest.mark.parametrize("pattern", ["{style}", "{content}_{style}_{style}", "{content}_{mood}", "x"])
def test_bad_patterns_are_refused(pattern: str) -> None:
    with pytest.raises(BadConfig, match=r"must hold \{content\} and \{style\} once"):
        labels_from_pattern(pattern, PLACES)


def test_pattern_that_fits_nothing_is_refused(folder: Path) -> None:
    with pytest.raises(BadData, match="no file fits the pattern"):
        load(options(folder, 'pattern = "{style}/{content}-{any}"'))


@pytest.mark.parametrize(
    ("text", "match"),
    [("colour = 1", "unknown colour"), ("fps = 'fast'", "fps cannot be 'fast'"), ("skeleton = 'cat'", "'cat'")],
)
def test_bad_options_are_refused(folder: Path, text: str, match: str) -> None:
    with pytest.raises(BadConfig, match=match):
        load(options(labelled(folder), text))


def test_broken_files_are_named(folder: Path) -> None:
    path = folder / PLACES[0]
    path.write_text(path.read_text().rpartition("\n")[0].rpartition("\n")[0])
    with pytest.raises(BadFile, match=r"old/walk_1.bvh:\d+.*header promises"):
        load(labelled(folder))


def test_other_skeleton_is_refused(folder: Path) -> None:
    path = folder / PLACES[0]
    motion = on_source(random_clip(4), SOURCES["mixamo"])
    write_motion(path, replace(motion, names=tuple(f"j{n}" for n in range(len(motion.names)))))
    for place in PLACES[1:]:
        (folder / place).unlink()
    labels = "file,content,style\nold/walk_1.bvh,walk,old\n"
    with pytest.raises(BadMotion, match="no known skeleton fits"):
        load(labelled(folder, labels))


def test_too_few_takes_say_how_many_are_needed(folder: Path) -> None:
    with pytest.raises(
        BadData, match=r"no take of content kick \(1 takes\).*19 takes with default.*7 takes with interleaved"
    ):
        deal(load(labelled(folder)).takes)
