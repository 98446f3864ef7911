from __future__ import annotations

from pathlib import Path

import pytest

from bench.datasets import bandai_namco
from bench.datasets.bandai_namco import PublishedTake, channel_digest
from bench.datasets.verify import Verdict, verify, write_manifest
from bench.errors import BadConfig, BadData
from bench.motion.bvh import read_bvh
from tests.datasets.test_bandai_namco import NAMES, as_folder, as_zip, tiny_takes
from tests.datasets.test_style_readers import style100_folder, write


def states(verdict: Verdict) -> dict[str, str]:
    return {finding.file: finding.state for finding in verdict.findings}


def truncated(path: Path) -> None:
    text = path.read_text()
    path.write_text(text[: len(text) - 60])


def test_manifest_names_every_kind(tmp_path: Path) -> None:
    for name in ("a", "b", "c", "d"):
        write(tmp_path / "deep" / f"{name}.bvh", "mixamo")
    write_manifest(tmp_path)
    assert verify("bvh-folder", tmp_path).findings == ()
    a, b, c = (tmp_path / "deep" / f"{name}.bvh" for name in "abc")
    a.write_text(a.read_text().replace("OFFSET 0.0", "OFFSET 1.0", 1))
    truncated(b)
    c.rename(c.with_name("e.bvh"))
    assert states(verify("bvh-folder", tmp_path)) == {
        "deep/a.bvh": "changed",
        "deep/b.bvh": "truncated",
        "deep/c.bvh": "missing",
        "deep/e.bvh": "extra",
    }


def test_broken_manifest_is_refused(tmp_path: Path) -> None:
    (tmp_path / "stylebench-manifest.csv").write_text("file\nx\n")
    with pytest.raises(BadData, match="is no manifest"):
        verify("bvh-folder", tmp_path)
    with pytest.raises(BadData, match="a manifest is written into a folder"):
        write_manifest(tmp_path / "nowhere")


@pytest.fixture
def published(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Three tiny takes as if they were the published subset."""
    takes = tiny_takes()
    rows = {}
    for name, text in takes.items():
        motion = read_bvh(text.encode())
        rows[name] = PublishedTake(name, motion.n_frames, channel_digest(motion))
    monkeypatch.setattr(bandai_namco, "published_takes", lambda: rows)
    return takes


def test_bandai_namco(published: dict[str, str], tmp_path: Path) -> None:
    assert verify("bandai-namco", as_zip(tmp_path / "whole.zip", published)).findings == ()
    first, second, third = NAMES
    copy = dict(published)
    extra = "dataset-2_run_normal_009"
    copy[extra] = copy.pop(third)
    last = copy[first].rstrip().rpartition(" ")
    copy[first] = f"{last[0]} 12.5\n"
    copy[second] = copy[second][:-80]
    assert states(verify("bandai-namco", as_folder(tmp_path / "copy", copy))) == {
        f"{first}.bvh": "changed",
        f"{second}.bvh": "truncated",
        f"{third}.bvh": "missing",
        f"{extra}.bvh": "extra",
    }


def test_labelled_folder(tmp_path: Path) -> None:
    for name in ("a", "b", "e"):
        write(tmp_path / f"{name}.bvh", "mixamo")
    truncated(tmp_path / "b.bvh")
    (tmp_path / "labels.csv").write_text("file,content,style\na,walk,old\nb.bvh,walk,old\nc.bvh,walk,old\n")
    assert states(verify("bvh-folder", tmp_path)) == {"b.bvh": "truncated", "c.bvh": "missing", "e.bvh": "extra"}


def test_100style(tmp_path: Path) -> None:
    folder = style100_folder(tmp_path)
    write(folder / "Angry" / "Angry_FW.bvh", "xsens", 900)
    write(folder / "Proud" / "Proud_ID.bvh", "xsens")
    assert states(verify("100style", folder)) == {
        "Angry/Angry_FW.bvh": "truncated",
        "Proud_BR.bvh": "missing",
        "Proud/Proud_ID.bvh": "extra",
    }


def test_zeroeggs(tmp_path: Path) -> None:
    write(tmp_path / "zeggs" / "002_Neutral_1.bvh", "zeroeggs")
    write(tmp_path / "zeggs" / "099_Neutral_1.bvh", "zeroeggs")
    found = states(verify("zeroeggs", tmp_path / "zeggs"))
    assert found["001_*.bvh"] == "missing"
    assert found["099_Neutral_1.bvh"] == "extra"
    assert "002_*.bvh" not in found


def test_xia_names_what_the_numbering_skips_and_other_joints(tmp_path: Path) -> None:
    write(tmp_path / "angry_01_000.bvh", "cmu-31")
    write(tmp_path / "angry_01_002.bvh", "cmu-31")
    write(tmp_path / "dance.bvh", "cmu-31")
    write(tmp_path / "old_13_000.bvh", "mixamo")
    write(tmp_path / "old_14_000.bvh", "cmu-31")
    truncated(tmp_path / "old_14_000.bvh")
    found = states(verify("xia2015", tmp_path))
    assert {file: state for file, state in found.items() if ", " not in file} == {
        "dance.bvh": "extra",
        "angry_01_001.bvh": "missing",
        "568 files": "missing",
        "old_13_000.bvh": "changed",
        "old_14_000.bvh": "truncated",
    }
    assert found["sexy, jumping"] == "missing"
    assert len([file for file in found if ", " in file]) == 6 * 8 - 2


def test_what_cannot_be_verified(tmp_path: Path) -> None:
    with pytest.raises(BadConfig, match="dataset 'procedural' has no files"):
        verify("procedural", tmp_path)
    with pytest.raises(BadData, match="no such file or folder"):
        verify("xia2015", tmp_path / "nowhere")
