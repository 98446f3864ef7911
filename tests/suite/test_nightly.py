"""Nights: a seeded regression is found on every seed and nothing else is; ten seeds raise no alarm; locks, configs."""

from __future__ import annotations

import fcntl
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

from bench.adapters import ADAPTERS
from bench.errors import BadConfig
from bench.protocols import PROTOCOLS
from bench.suite import nightly
from bench.suite.nightly import HISTORY, LATEST, LOCK, TREND, NightlyConfig, night, read_config
from reports.nightly import read_history
from tests.suite import tiny

N_SAMPLES = 160
ADAPTER = """
import numpy as np
from bench.adapters.base import Adapter
from bench.motion import quat

NOISE_RAD, SEED = {noise}, {seed}

class Leaner(Adapter):
    name = "leaner"

    def transfer(self, content, style, *, rng):
        rotations = content.clip.rotations_wxyz.copy()
        rotations[:, 9] = np.median(style.clip.rotations_wxyz[:, 9], axis=0)
        rotations[:, 9] /= np.linalg.norm(rotations[:, 9], axis=-1, keepdims=True)
        shake = np.random.default_rng([int(rng.integers(2**31)), SEED]).normal(size=(len(rotations), 21, 3))
        return content.clip.with_motion(
            quat.multiply(rotations, quat.from_rotation_vector((0.02 + NOISE_RAD) * shake)), content.clip.root_xyz_m
        )
"""


@pytest.fixture
def small(tmp_path: Path) -> Iterator[NightlyConfig]:
    """The tiny benchmark with enough samples to tell rows apart."""
    name = "stylebench-transfer@1"
    adapters = (str(tmp_path / "leaner.py"),)
    methods = ("copy-content", "noise-0.1")
    with tiny.tiny_tables():
        PROTOCOLS[name] = replace(PROTOCOLS[name], n_samples={"smoke": N_SAMPLES})
        yield NightlyConfig(tmp_path / "nightly", ("tiny",), methods, adapters, profile="smoke", jobs=1)


def one_night(config: NightlyConfig, number: int, *, noise: float, seed: int) -> nightly.NightResult:
    Path(config.adapters[0]).write_text(ADAPTER.format(noise=noise, seed=seed))
    return night(config, f"2026-01-{number + 1:02d}T03-00-00Z", "test", lambda *_: None)


@pytest.mark.slow
def test_a_seeded_regression_is_reported_on_each_seed_and_nothing_else_is(small: NightlyConfig) -> None:
    assert one_night(small, 0, noise=0.0, seed=0).good
    for seed in range(1, 6):
        result = one_night(small, seed, noise=0.4, seed=seed)
        assert not result.good and result.comparison is not None
        assert {change.method for change in result.comparison.regressions} == {"leaner"}
        assert not result.failed and not result.comparison.lost
        assert "leaner" in (small.folder / LATEST).read_text()
    history = read_history(small.folder / HISTORY)
    assert [old.good for old in history] == [True, False, False, False, False, False]
    assert (small.folder / TREND).is_file()


@pytest.mark.slow
def test_ten_nights_with_ten_seeds_raise_no_alarm(small: NightlyConfig) -> None:
    results = [one_night(small, seed, noise=0.0, seed=seed) for seed in range(10)]
    assert all(result.good for result in results)
    compared = [result.comparison.compared for result in results[1:] if result.comparison]
    assert len(compared) == 9 and min(compared) > 0


@pytest.mark.slow
def test_a_method_that_fails_is_named_and_the_others_go_on(small: NightlyConfig) -> None:
    assert one_night(small, 0, noise=0.0, seed=0).good
    Path(small.adapters[0]).write_text("raise RuntimeError('broken tonight')")
    result = night(small, "2026-01-02T03-00-00Z", "test", lambda *_: None)
    assert not result.good
    assert any("broken tonight" in reason for reason in result.failed.values())
    assert len(list((result.folder / "records").glob("*.json"))) == 3
    assert (result.folder / "page" / "index.html").is_file()


def test_two_nights_at_once_are_refused(tmp_path: Path) -> None:
    config = NightlyConfig(tmp_path)
    with (tmp_path / LOCK).open("w") as held:
        fcntl.flock(held, fcntl.LOCK_EX)
        with pytest.raises(BadConfig, match="another night is running here"):
            night(config, "a", "test", lambda *_: None)


def test_a_run_that_cannot_start_is_a_failed_night(tmp_path: Path) -> None:
    result = night(NightlyConfig(tmp_path, methods=("nobody",)), "a", "test", lambda *_: None)
    assert not result.good and "nobody" in result.failed[nightly.NO_RUN]
    assert "1 to look at" in (tmp_path / LATEST).read_text()
    assert read_history(tmp_path / HISTORY) == []


def test_config_is_read_relative_to_its_file(tmp_path: Path) -> None:
    file = tmp_path / "nightly.toml"
    file.write_text(
        'folder = "here"\ndata = ["procedural", "bandai-namco=data.zip"]\nadapters = ["mine.py"]\nseeds = [1]\n'
    )
    config = read_config(file)
    assert config.folder == tmp_path / "here"
    assert config.data == ("procedural", f"bandai-namco={tmp_path / 'data.zip'}")
    assert config.adapters == (str(tmp_path / "mine.py"),)
    assert config.seeds == (1,)


def test_the_example_can_be_used_as_it_is(tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "examples" / "nightly" / "nightly.toml"
    config = read_config(example)
    assert set(config.methods) <= set(ADAPTERS)
    assert config.folder == example.parent / "nightly"


@pytest.mark.parametrize(
    ("text", "match"),
    [
        ("method = []", "unknown key 'method'"),
        ("seeds = ['a']", "seeds must be a list of int"),
        ("jobs = 'two'", "jobs must be int"),
        ("a = [", "is not TOML"),
    ],
)
def test_bad_configs_are_refused(tmp_path: Path, text: str, match: str) -> None:
    file = tmp_path / "nightly.toml"
    file.write_text(text)
    with pytest.raises(BadConfig, match=match):
        read_config(file)
    with pytest.raises(BadConfig, match="cannot be read"):
        read_config(tmp_path / "none.toml")


def test_history_says_where_it_is_broken(tmp_path: Path) -> None:
    from reports.records import BadRecord

    (tmp_path / HISTORY).write_text(json.dumps({"name": "a", "good": True, "values": {}}) + "\nnot json\n")
    with pytest.raises(BadRecord, match=r"history.jsonl:2: not a night"):
        read_history(tmp_path / HISTORY)
