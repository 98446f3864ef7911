"""Studies: clips without names, a key that tells them apart, and preferences counted by hand."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from reports.movie import write_movie, write_sheet
from reports.page import PlayerTable
from reports.records import BadRecord
from reports.study import COLUMNS, KEY_FILE, PAGE_FILE, score_study, write_study
from tests.reports.test_page import player

ROWS = ("body2", "body3")


def players() -> PlayerTable:
    made = player(n_bodies=4)
    bodies = dict(made.bodies)
    bodies["content"], bodies["style"] = bodies.pop("body0"), bodies.pop("body1")
    return replace(made, bodies=bodies)


def written(folder: Path, seed: int = 0) -> dict[str, dict[str, str]]:
    write_study(folder, players(), ROWS, 6, seed)
    key: dict[str, dict[str, str]] = json.loads((folder / KEY_FILE).read_text())["trials"]
    return key


def answers(path: Path, lines: list[tuple[str, str, str, str]]) -> Path:
    path.write_text("\n".join([",".join(COLUMNS), *(",".join(line) for line in lines)]) + "\n")
    return path


def test_the_page_does_not_tell_which_row_a_clip_is_of(tmp_path: Path) -> None:
    key = written(tmp_path)
    shown = (tmp_path / "trials.js").read_text() + (tmp_path / PAGE_FILE).read_text()
    assert not any(row in shown for row in ROWS)
    assert len(key) == 6
    assert {trial["a"] for trial in key.values()} == set(ROWS)
    assert written(tmp_path) == key
    assert written(tmp_path, seed=1) != key


def test_preferences_are_counted_whatever_the_side(tmp_path: Path) -> None:
    key = written(tmp_path)
    wanted = [("ann", trial, "style", "a" if sides["a"] == "body3" else "b") for trial, sides in key.items()]
    [found] = score_study(tmp_path, [answers(tmp_path / "ann.csv", wanted)])
    assert (found.row, found.other, found.preferred, found.answers) == ("body2", "body3", 0, 6)
    assert found.p == pytest.approx(2 * 0.5**6)
    assert found.low == 0.0 and found.high == pytest.approx(1 - 0.025 ** (1 / 6))


def test_wrong_answers_are_named(tmp_path: Path) -> None:
    key = written(tmp_path)
    first = next(iter(key))
    with pytest.raises(BadRecord, match=r"answers style of .* twice"):
        score_study(tmp_path, [answers(tmp_path / "a.csv", [("ann", first, "style", "a")] * 2)])
    with pytest.raises(BadRecord, match=r"a.csv:2: not an answer of this study"):
        score_study(tmp_path, [answers(tmp_path / "a.csv", [("ann", "t999", "style", "a")])])
    with pytest.raises(BadRecord, match="no answers to score"):
        score_study(tmp_path, [answers(tmp_path / "a.csv", [])])
    (tmp_path / "b.csv").write_text("who,what\n")
    with pytest.raises(BadRecord, match="expected the columns"):
        score_study(tmp_path, [tmp_path / "b.csv"])
    with pytest.raises(BadRecord, match="no key of a study"):
        score_study(tmp_path / "elsewhere", [])


def test_a_study_needs_two_rows_that_are_there(tmp_path: Path) -> None:
    with pytest.raises(BadRecord, match="needs two rows"):
        write_study(tmp_path, players(), ("body2",), 3, 0)
    with pytest.raises(BadRecord, match="no row 'nobody'"):
        write_study(tmp_path, players(), ("body2", "nobody"), 3, 0)


def test_a_movie_has_a_picture_a_frame(tmp_path: Path) -> None:
    with Image.open(write_movie(player(n_samples=1), 0, ["body0", "body1"], tmp_path / "m.gif")) as image:
        assert image.n_frames > 1  # type: ignore[attr-defined]
    with pytest.raises(BadRecord, match="no body 'nobody'"):
        write_movie(player(), 0, ["nobody"], tmp_path / "m.gif")
    with pytest.raises(BadRecord, match=r"saved as \.gif or \.mp4"):
        write_movie(player(), 0, ["body0"], tmp_path / "m.avi")


def test_a_contact_sheet_has_a_row_a_body_and_a_block_a_sample(tmp_path: Path) -> None:
    heights = []
    for samples in ([0], [0, 1]):
        with Image.open(write_sheet(player(n_samples=2), samples, ["body0", "body1"], tmp_path / "s.png")) as image:
            assert len(np.unique(np.asarray(image.convert("L")))) > 10
            heights.append(image.height)
    assert heights[1] == pytest.approx(2 * heights[0], abs=2)
    with pytest.raises(BadRecord, match="contact sheet"):
        write_sheet(player(), [0], ["body0"], tmp_path / "s.gif")
    with pytest.raises(BadRecord, match="nobody"):
        write_sheet(player(), [0], ["nobody"], tmp_path / "s.png")
