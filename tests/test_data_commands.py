from __future__ import annotations

import json
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.cli import app
from bench.errors import BadConfig
from tests.motion.factory import random_clip
from tests.motion.source_skeletons import SOURCES, on_source, write_motion

runner = CliRunner()


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "cache"))


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return write_motion(tmp_path / "mine" / "walk.bvh", on_source(random_clip(8), SOURCES["lafan1"]))


def test_skeleton_shows_matched_and_virtual(file: Path) -> None:
    result = runner.invoke(app, ["data", "skeleton", str(file), "--json"])
    assert result.exit_code == 0
    shown = json.loads(result.output)
    assert shown["facts"]["skeleton"] == "lafan1"
    assert "unit cm assumed" in shown["facts"]["notes"]
    assert ["LeftToeBase", "matched", "LeftToe"] in shown["joints"]
    assert ["LeftHandIndex1", "virtual", "-"] in shown["joints"]
    assert "stature" in runner.invoke(app, ["data", "skeleton", str(file)]).output


def test_skeleton_takes_overrides(file: Path) -> None:
    options = ["--unit", "0.02", "--up", "y", "--fps", "24", "--json"]
    shown = json.loads(runner.invoke(app, ["data", "skeleton", str(file), *options]).output)
    assert (shown["facts"]["fps"], shown["facts"]["stature of Head over Toes, m"]) == ("24", "3.228")
    assert "assumed" not in shown["facts"]["notes"]


def test_skeleton_shows_missing(file: Path) -> None:
    result = runner.invoke(app, ["data", "skeleton", str(file), "--map", "mixamo without fingers", "--json"])
    assert result.exit_code == 1
    shown = json.loads(result.output)
    assert shown["facts"]["missing"] == "LeftToeBase, RightToeBase"
    assert ["LeftToeBase", "missing", "LeftToeBase"] in shown["joints"]


def test_skeleton_says_what_cannot_be_assumed(tmp_path: Path) -> None:
    motion = on_source(random_clip(8), SOURCES["lafan1"], unit_m=3.0)
    file = write_motion(tmp_path / "giant.bvh", motion)
    result = runner.invoke(app, ["data", "skeleton", str(file), "--json"])
    assert result.exit_code == 1
    assert "adult's in none of" in json.loads(result.output)["facts"]["problem"]


def test_info_prints_what_the_dataset_is(file: Path) -> None:
    (file.parent / "labels.csv").write_text("file,content,style\nwalk,walk,old\n")
    result = runner.invoke(app, ["data", "info", f"bvh-folder={file.parent}"])
    assert result.exit_code == 0
    for expected in ("takes: 1", "fps: 30.0", "virtual: LeftHandIndex1", "licence:", "cannot be dealt: the", "walk"):
        assert expected in result.output


def test_verify(file: Path) -> None:
    data = f"bvh-folder={file.parent}"
    assert runner.invoke(app, ["data", "verify", data, "--write-manifest"]).exit_code == 0
    assert "all as they should be" in runner.invoke(app, ["data", "verify", data]).output
    file.rename(file.with_name("run.bvh"))
    result = runner.invoke(app, ["data", "verify", data, "--json"])
    assert result.exit_code == 1
    assert [(row["file"], row["state"]) for row in json.loads(result.output)] == [
        ("walk.bvh", "missing"),
        ("run.bvh", "extra"),
    ]
    refused = runner.invoke(app, ["data", "verify", "bvh-folder"])
    assert isinstance(refused.exception, BadConfig)


def test_fetch_says_where_to_place_it() -> None:
    output = runner.invoke(app, ["data", "fetch", "zeroeggs", "--how"]).output
    assert "CC BY-NC-ND 4.0" in output and "stylebench data verify zeroeggs=PATH" in output
