from __future__ import annotations

import multiprocessing
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bench.datasets import cache
from bench.datasets.cache import FACTS_FILE, Made, cache_root, cached_takes
from bench.datasets.pack import LABELS_FILE, ROOT_FILE, ROTATIONS_FILE
from bench.datasets.take import Take
from tests.motion.factory import random_clip


@pytest.fixture(autouse=True)
def own_cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


class Maker:
    """Makes two takes and counts how often."""

    def __init__(self) -> None:
        self.calls = 0

    def __call__(self) -> Made:
        self.calls += 1
        return [Take(random_clip(5), "a", content="walk"), Take(random_clip(7, seed=1), "b")], {"made": "once"}


def assert_made(found: tuple[tuple[Take, ...], dict[str, object]]) -> None:
    takes, facts = found
    assert [take.take_id for take in takes] == ["a", "b"]
    np.testing.assert_allclose(takes[1].clip.rotations_wxyz, random_clip(7, seed=1).rotations_wxyz, atol=1e-15)
    assert facts == {"made": "once"}


def test_made_once_then_read(own_cache: Path) -> None:
    make = Maker()
    for _ in range(3):
        assert_made(cached_takes("key", make))
    assert make.calls == 1
    assert [folder.name for folder in own_cache.iterdir()] == ["key"]


def test_keys_do_not_share() -> None:
    make = Maker()
    cached_takes("one", make)
    cached_takes("two", make)
    assert make.calls == 2


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-200])


def zeros(path: Path) -> None:
    """What a power cut may leave behind a name."""
    content = path.read_bytes()
    path.write_bytes(content[:128] + bytes(len(content) - 128))


DAMAGE: dict[str, tuple[str, Callable[[Path], object]]] = {
    "no_facts": (FACTS_FILE, Path.unlink),
    "facts_are_no_json": (FACTS_FILE, lambda path: path.write_text("{")),
    "no_labels": (LABELS_FILE, Path.unlink),
    "labels_are_a_list": (LABELS_FILE, lambda path: path.write_text("[]")),
    "labels_lack_takes": (LABELS_FILE, lambda path: path.write_text('{"skeletons": []}')),
    "rotations_are_cut": (ROTATIONS_FILE, cut),
    "rotations_are_zero": (ROTATIONS_FILE, zeros),
    "root_is_empty": (ROOT_FILE, lambda path: path.write_bytes(b"")),
}


@pytest.mark.parametrize("damage", DAMAGE)
def test_damaged_entry_is_made_again(damage: str, own_cache: Path) -> None:
    make = Maker()
    cached_takes("key", make)
    name, harm = DAMAGE[damage]
    harm(own_cache / "key" / name)
    assert_made(cached_takes("key", make))
    assert_made(cached_takes("key", make))
    assert make.calls == 2


def test_entry_of_another_process_stays(own_cache: Path) -> None:
    """Two processes find nothing and both make the takes: the second leaves the first's entry alone."""
    make = Maker()

    def made_elsewhere_meanwhile() -> Made:
        cached_takes("key", make)
        return make()

    assert_made(cached_takes("key", made_elsewhere_meanwhile))
    assert make.calls == 2
    assert [folder.name for folder in own_cache.iterdir()] == ["key"]


def test_many_at_once(own_cache: Path) -> None:
    """Six processes find nothing, make the takes at the same moment, and all get them; one entry is left."""
    processes = multiprocessing.get_context("fork")
    start = processes.Barrier(6)

    def make_together() -> Made:
        start.wait(timeout=20)
        return Maker()()

    def read() -> None:
        assert_made(cached_takes("key", make_together))

    readers = [processes.Process(target=read) for _ in range(6)]
    for reader in readers:
        reader.start()
    for reader in readers:
        reader.join(timeout=60)
    assert [reader.exitcode for reader in readers] == [0] * 6
    assert [folder.name for folder in own_cache.iterdir()] == ["key"]


def test_cache_that_cannot_be_written_is_no_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("not a folder")
    monkeypatch.setenv("STYLEBENCH_CACHE", str(tmp_path / "file"))
    make = Maker()
    for _ in range(2):
        assert_made(cached_takes("key", make))
    assert make.calls == 2


def test_full_disk_leaves_nothing_behind(own_cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(folder: Path, takes: object) -> None:
        (folder / ROTATIONS_FILE).write_bytes(b"half")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache, "write_pack", full)
    assert_made(cached_takes("key", Maker()))
    assert list(own_cache.iterdir()) == []


def test_failure_to_make_is_not_stored(own_cache: Path) -> None:
    def fail() -> Made:
        raise ValueError("broken source")

    with pytest.raises(ValueError, match="broken source"):
        cached_takes("key", fail)
    assert not own_cache.exists() or list(own_cache.iterdir()) == []


def test_removed_cache_is_made_again(own_cache: Path) -> None:
    make = Maker()
    cached_takes("key", make)
    shutil.rmtree(own_cache)
    cached_takes("key", make)
    assert make.calls == 2


def test_default_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("STYLEBENCH_CACHE")
    assert cache_root() == Path.home() / ".cache" / "stylebench"
