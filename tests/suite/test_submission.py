from __future__ import annotations

import contextlib
import json
import os
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bench.adapters.base import Traits
from bench.datasets.pack import Pack
from bench.errors import BadConfig, BadFile, BadOutput, BenchError
from bench.protocols import PROTOCOLS
from bench.suite.answering import source_of
from bench.suite.setting import Setting, prepare
from bench.suite.store import Store
from bench.suite.submission import ANSWERS, MANIFEST, SUBMISSION, check_submission, export_tasks, read_submission
from tests.suite.tiny import tiny_dataset


@pytest.fixture(scope="module")
def setting(tmp_path_factory: pytest.TempPathFactory) -> Setting:
    return setting_of("stylebench-transfer@1", tmp_path_factory.mktemp("store"))


def setting_of(name: str, store: Path) -> Setting:
    protocol = replace(PROTOCOLS[name], n_samples={"smoke": 6})
    return prepare(tiny_dataset(), protocol, "smoke", Store(store))


def manifest_of(folder: Path) -> dict[str, Any]:
    manifest: dict[str, Any] = json.loads((folder / MANIFEST).read_text())
    return manifest


def answered(setting: Setting, folder: Path, motions: str = "bvh") -> Path:
    """An export in which every answer is a copy of its content."""
    export_tasks(setting, folder, motions=motions)
    for row in manifest_of(folder)["tasks"]:
        shutil.copyfile(folder / row["content"], folder / row["answer"])
    return folder


def sources(setting: Setting) -> list[Any]:
    pack = Pack.open(setting.pack_folder)
    return [source_of(task, pack, setting.protocol.fps).clip for task in setting.tasks]


@pytest.mark.parametrize("motions", ["bvh", "npz"])
def test_copies_come_back_as_the_sources_under_the_tasks_labels(setting: Setting, tmp_path: Path, motions: str) -> None:
    submission = read_submission(answered(setting, tmp_path / "out", motions), setting)
    assert submission.name == "my-method"
    assert list(submission.motions.contents) == [task.content for task in setting.tasks]
    assert list(submission.motions.styles) == [task.target_style for task in setting.tasks]
    for number, source in enumerate(sources(setting)):
        clip = submission.motions.clip(number)
        np.testing.assert_allclose(clip.root_xyz_m, source.root_xyz_m, atol=1e-6)
        same = np.abs((clip.rotations_wxyz * source.rotations_wxyz).sum(axis=-1))
        np.testing.assert_allclose(same, 1.0, atol=1e-6)
        assert clip.skeleton.same_bones(source.skeleton)
    assert [row for row in check_submission(tmp_path / "out", setting) if row.ok is False] == []


def test_export_tells_no_take_and_only_labels_that_are_asked_for(setting: Setting, tmp_path: Path) -> None:
    export_tasks(setting, tmp_path / "blind")
    text = (tmp_path / "blind" / MANIFEST).read_text()
    assert not any(take.take_id in text for take in setting.takes)
    assert not any(label in text for label in ("bow", "wave", "bent", "plain"))
    traits = Traits(needs_content_label=True, needs_source_style_label=True, needs_style_label=True)
    export_tasks(setting, tmp_path / "labels", traits=traits)
    for row, task in zip(manifest_of(tmp_path / "labels")["tasks"], setting.tasks, strict=True):
        labels = row["content_label"], row["source_style_label"], row["style_label"]
        assert labels == (task.content, task.source_style, task.target_style)
    assert "needs_style_label = true" in (tmp_path / "labels" / SUBMISSION).read_text()


def test_fit_part_goes_along_when_asked_for(setting: Setting, tmp_path: Path) -> None:
    export_tasks(setting, tmp_path / "out", with_fit=True)
    rows = manifest_of(tmp_path / "out")["fit"]
    assert len(rows) == len(setting.fit_take_ids)
    assert all((tmp_path / "out" / row["file"]).is_file() and row["content"] and row["style"] for row in rows)


@pytest.mark.parametrize("track", ["latent", "gesture", "parts", "interpolation"])
def test_other_tracks_travel_too(track: str, tmp_path: Path) -> None:
    names = [name for name, protocol in PROTOCOLS.items() if protocol.track == track and protocol.extra_takes is None]
    for name in names[:1]:
        try:
            setting = setting_of(name, tmp_path / "store")
        except BenchError as error:
            pytest.skip(f"not on this toy data: {error}")
        submission = read_submission(answered(setting, tmp_path / "out"), setting)
        assert submission.motions.n == len(setting.tasks)
        row = manifest_of(tmp_path / "out")["tasks"][0]
        assert (track == "latent") == ("style_label" in row)
        assert (track == "interpolation") == ("start_style" in row)


def test_tracks_that_measure_a_program_are_refused(setting: Setting, tmp_path: Path) -> None:
    running = replace(setting, protocol=replace(setting.protocol, track="runtime"))
    with pytest.raises(BadConfig, match="measures a running method"):
        export_tasks(running, tmp_path / "out")
    with pytest.raises(BadConfig, match="measures a running method"):
        read_submission(answered(setting, tmp_path / "out"), running)


def test_folders_with_something_in_them_are_not_touched(setting: Setting, tmp_path: Path) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    with pytest.raises(BadConfig, match="is not empty"):
        export_tasks(setting, tmp_path)
    (tmp_path / "file").write_text("")
    with pytest.raises(BadConfig, match="cannot be written"):
        export_tasks(setting, tmp_path / "file" / "out")
    with pytest.raises(BadConfig, match="expected bvh or npz"):
        export_tasks(setting, tmp_path / "out", motions="pickle")


@pytest.fixture
def folder(setting: Setting, tmp_path: Path) -> Path:
    return answered(setting, tmp_path / "out")


def refused(folder: Path, setting: Setting, match: str) -> None:
    """Refused by score, and told by check without an exception."""
    with pytest.raises(BenchError, match=match):
        read_submission(folder, setting)
    assert [row for row in check_submission(folder, setting) if row.ok is False]


def test_missing_answers_are_counted(folder: Path, setting: Setting) -> None:
    (folder / ANSWERS / "s0003.bvh").unlink()
    (folder / ANSWERS / "s0004.bvh").unlink()
    refused(folder, setting, r"2 of 6 answers are missing, answers/s0003\.bvh first")


def test_either_form_answers(folder: Path, setting: Setting) -> None:
    source = sources(setting)[2]
    (folder / ANSWERS / "s0002.bvh").unlink()
    np.savez(
        folder / ANSWERS / "s0002.npz",
        rotations_wxyz=source.rotations_wxyz.astype(np.float32),
        root_xyz_m=source.root_xyz_m.astype(np.float32),
    )
    assert read_submission(folder, setting).motions.n == 6


def test_answers_to_other_tasks_are_refused(folder: Path, setting: Setting) -> None:
    other = replace(setting, tasks=setting.tasks[:3])
    refused(folder, other, "the tasks are not those of stylebench-transfer@1 on tiny@1, smoke")


def test_links_pickles_and_wrong_motions_are_refused(folder: Path, setting: Setting, tmp_path: Path) -> None:
    path = folder / ANSWERS / "s0001.bvh"
    good = path.read_bytes()
    secret = tmp_path / "secret.bvh"
    secret.write_bytes(good)
    path.unlink()
    path.symlink_to(secret)
    refused(folder, setting, "it is a link")
    path.unlink()
    path.write_bytes(good.replace(b"Frames: 64", b"Frames: 10000000"))
    refused(folder, setting, "promises 10000000 frames")
    path.write_bytes(good.replace(b"Frame Time: 0.03333333333", b"Frame Time: 0.01666666667"))
    refused(folder, setting, "fps: expected 30 fps, got 60 fps")
    path.unlink()
    np.savez(path.with_suffix(".npz"), rotations_wxyz=np.array([{}], dtype=object), root_xyz_m=np.zeros(3))
    refused(folder, setting, "need pickle")
    np.savez(path.with_suffix(".npz"), rotations_wxyz=np.ones((64, 21, 4)), root_xyz_m=np.zeros((64, 3)))
    refused(folder, setting, "must be unit quaternions")


@pytest.mark.parametrize(
    "name", ["../secret.bvh", "/etc/passwd", "answers/../../secret.bvh", "a\0.bvh", "", "a//b.bvh"]
)
def test_manifest_paths_cannot_leave_the_folder(folder: Path, setting: Setting, name: str) -> None:
    manifest = manifest_of(folder)
    manifest["tasks"][0]["answer"] = name
    (folder / MANIFEST).write_text(json.dumps(manifest))
    refused(folder, setting, "lies outside the folder")


@pytest.mark.parametrize(
    ("content", "match"),
    [
        (b"", "is not JSON"),
        (b"[" * 50000, "is not JSON"),
        (b"\xff\xfe", "is not JSON"),
        (b"[]", "is no manifest"),
        (b'{"format": 2, "tasks": []}', "is no manifest"),
        (b'{"format": 1, "tasks": 3}', "is no manifest"),
        (b" " * (1 << 20), "has 1048576 bytes, at most"),
    ],
    ids=range(7),
)
def test_manifests_that_are_none(folder: Path, setting: Setting, content: bytes, match: str) -> None:
    (folder / MANIFEST).write_bytes(content)
    refused(folder, setting, match)


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("name = 1", "name: Input should be a valid string"),
        ('name = "x"\nscript = "run.sh"', "no key 'script'"),
        ('name = "<b>x</b>"', "name: String should match pattern"),
        ('name = "x"\n[traits]\nuses_judges = true', "no trait 'uses_judges'; remedy: did you mean 'uses_judge'"),
        ("name = ", "is not TOML"),
        ('name = "copy-content"', "there is a row 'copy-content' already"),
        ('name = "x"\ntitle = "two\\nlines"', "title: Value error, must be one line"),
    ],
)
def test_submission_toml_is_checked(folder: Path, setting: Setting, text: str, match: str) -> None:
    (folder / SUBMISSION).write_text(text)
    refused(folder, setting, match)


def test_device_in_place_of_the_manifest_is_refused(folder: Path, setting: Setting) -> None:
    (folder / MANIFEST).unlink()
    os.mkfifo(folder / MANIFEST)
    refused(folder, setting, "is not a regular file")


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=8,
)
PLACES = st.sampled_from(["format", "tasks", "tasks_digest", "row", "sample_id", "answer"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(place=PLACES, value=JSON)
def test_any_manifest_raises_only_ours(folder: Path, setting: Setting, place: str, value: object) -> None:
    original = (folder / MANIFEST).read_text()
    manifest = json.loads(original)
    if place == "row":
        manifest["tasks"][0] = value
    elif place in manifest:
        manifest[place] = value
    else:
        manifest["tasks"][0][place] = value
    try:
        (folder / MANIFEST).write_text(json.dumps(manifest))
        with contextlib.suppress(BadFile, BadOutput):
            read_submission(folder, setting)
    finally:
        (folder / MANIFEST).write_text(original)
