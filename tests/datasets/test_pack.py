from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.datasets.pack import LABELS_FILE, Pack, write_pack
from bench.datasets.take import Take
from bench.errors import BadFile
from tests.motion.factory import person, random_clip


def some_takes() -> list[Take]:
    big = person(1.2, frozenset({"LeftHandIndex1"}))
    return [
        Take(random_clip(10), "a", "toy", "walk", "old", "anna", "monday"),
        Take(random_clip(20, 60.0, skeleton=big), "b", "toy", "run", None, None, None),
        Take(random_clip(5, seed=3, skeleton=big), "c", "toy", "run", "old"),
    ]


def test_round_trip(tmp_path: Path) -> None:
    takes = some_takes()
    write_pack(tmp_path, takes)
    for stored, take in zip(Pack.open(tmp_path).takes(), takes, strict=True):
        np.testing.assert_allclose(stored.clip.rotations_wxyz, take.clip.rotations_wxyz, atol=1e-15)
        np.testing.assert_array_equal(stored.clip.root_xyz_m, take.clip.root_xyz_m)
        assert stored.clip.skeleton.same_bones(take.clip.skeleton, 0.0)
        assert stored.clip.skeleton.virtual == take.clip.skeleton.virtual
        assert stored.clip.fps == take.clip.fps
        labels = ("take_id", "dataset", "content", "style", "actor", "session")
        assert [getattr(stored, name) for name in labels] == [getattr(take, name) for name in labels]


def test_damaged_pack_is_refused(tmp_path: Path) -> None:
    write_pack(tmp_path, some_takes())
    (tmp_path / LABELS_FILE).write_text("{")
    with pytest.raises(BadFile, match="stored takes cannot be read"):
        Pack.open(tmp_path)


def test_labels_are_hidden_unless_declared() -> None:
    take = some_takes()[0]
    assert take.hidden(content=False, style=False) != take
    hidden = take.hidden(content=False, style=True)
    assert (hidden.take_id, hidden.dataset, hidden.content, hidden.style, hidden.actor) == ("", "", None, "old", None)
