from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.adapters import ADAPTERS
from bench.adapters.base import Adapter, Description, Traits
from bench.adapters.loading import AdapterSource, find_adapter, source_from_option
from bench.adapters.oracles import Oracle, World
from bench.adapters.post_processed import plain, plain_instance, post_processed, split_suffix
from bench.datasets.take import Take
from bench.errors import BadConfig, BadOutput
from bench.metrics.contacts import foot_skate
from bench.motion.cleanup import IK_SETTINGS, PARK_IK, planted_feet, remove_foot_skate
from bench.motion.clip import Clip
from bench.motion.kinematics import FOOT_JOINTS, world_positions
from bench.suite.keys import adapter_digest, generate_key
from tests.motion.factory import random_clip

CONTENT = Take(random_clip(64, seed=1), content="walk", style="old")
STYLE = Take(random_clip(90, seed=2), content="run", style="angry")


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


class Sliding(Adapter):
    """Content with a root that slides."""

    name = "sliding"
    title = "sliding"

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        root = content.clip.root_xyz_m.copy()
        root[:, 0] += 0.1 * np.arange(content.clip.n_frames) / content.clip.fps
        return content.clip.with_motion(content.clip.rotations_wxyz, root)


class Windowed(Sliding):
    """Answers 64 frames only."""

    name = "windowed"
    traits = Traits(designed_input_frames=64, only_designed_input=True)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        assert content.clip.n_frames == 64
        return super().transfer(content, style, rng=rng)


def standing() -> Take:
    clip = random_clip(64, amount_rad=0.0)
    rotations = clip.rotations_wxyz.copy()
    for joints, half in (((1, 5), -0.2), ((2, 6), 0.4), ((3, 7), -0.2)):
        rotations[:, joints] = [np.cos(half / 2), np.sin(half / 2), 0.0, 0.0]
    return Take(clip.with_motion(rotations, np.tile([0.0, 0.94, 0.0], (64, 1))), content="walk", style="old")


def skate(clip: Clip) -> float:
    return float(foot_skate(world_positions(clip)[None], clip.fps, FOOT_JOINTS)[0])


@pytest.mark.parametrize("suffix", IK_SETTINGS)
@pytest.mark.parametrize("name", ADAPTERS)
def test_every_row_there_is_can_be_cleaned(name: str, suffix: str) -> None:
    found, inner = find_adapter(AdapterSource(f"{name}+{suffix}")), ADAPTERS[name]
    assert found.name == f"{name}+{suffix}" and found.title == f"{inner.title} + {IK_SETTINGS[suffix].title}"
    assert set(inner.capabilities()) - set(found.capabilities()) <= {"streams", "predicts"}
    assert (found.kind, found.draws_from, found.fits()) == (inner.kind, inner.draws_from, inner.fits())
    assert issubclass(found, Oracle) == issubclass(inner, Oracle)
    assert plain(found) is inner and plain(inner) is inner
    assert isinstance(plain_instance(found()), inner)


@pytest.mark.parametrize("suffix", IK_SETTINGS)
def test_answers_are_cleaned_by_the_contacts_of_the_source(suffix: str) -> None:
    cleaned = post_processed(Sliding, suffix)()
    source = standing()
    assert skate(Sliding().transfer(source, STYLE, rng=rng())) == pytest.approx(10.0)
    assert skate(cleaned.transfer(source, STYLE, rng=rng())) < 0.5


def test_an_oracle_keeps_labels_and_the_contacts_of_its_own_answer() -> None:
    cleaned = find_adapter(AdapterSource("real-test+park-ik"))()
    assert isinstance(cleaned, Oracle)
    take = cleaned.answer(CONTENT, 0, STYLE, World([], []), rng=rng())
    assert (take.content, take.style) == ("walk", "old")
    expected = remove_foot_skate(CONTENT.clip, PARK_IK, planted_feet(CONTENT.clip, PARK_IK))
    np.testing.assert_array_equal(take.clip.rotations_wxyz, expected.rotations_wxyz)


def test_pieces_of_a_fixed_length_are_joined_before_they_are_cleaned() -> None:
    cleaned = post_processed(Windowed, "park-ik")
    assert not cleaned.traits.only_designed_input
    answer = cleaned().transfer(CONTENT.with_clip(random_clip(150, seed=4)), STYLE, rng=rng())
    assert answer.n_frames == 150


def test_a_wrong_answer_is_the_methods_fault() -> None:
    class Short(Sliding):
        def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
            return random_clip(10)

    with pytest.raises(BadOutput, match="64 frames"):
        post_processed(Short, "park-ik")().transfer(CONTENT, STYLE, rng=rng())


def test_fit_is_that_of_the_plain_row(tmp_path: Path) -> None:
    inner = ADAPTERS["mean-pose"]
    cleaned = post_processed(inner, "aberman-ik")
    fitted = inner()
    fitted.fit([CONTENT, STYLE], seed=0, budget="small", progress=lambda *_: None)
    fitted.save(tmp_path)
    loaded = cleaned()
    loaded.load(tmp_path)
    assert loaded.transfer(CONTENT, STYLE, rng=rng()).n_frames == 64


def test_description_says_that_the_whole_clip_is_needed() -> None:
    described = find_adapter(AdapterSource("copy-content+park-ik"))().describe()
    assert described == replace(ADAPTERS["copy-content"]().describe(), look_ahead_frames=None)
    assert isinstance(described, Description)


def test_keys_differ_from_each_other_and_from_the_plain_row() -> None:
    rows: list[type[Adapter]] = [Sliding, *(post_processed(Sliding, suffix) for suffix in IK_SETTINGS)]
    digests = [adapter_digest(row) for row in rows]
    assert len(set(digests)) == 4
    assert adapter_digest(post_processed(Sliding, "park-ik")) == digests[2]
    assert generate_key("fit", "tasks", 0) != generate_key("fit", "tasks", 0, after=digests[1])


def test_a_users_file_can_be_cleaned_too(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text("from bench.adapters.base import Adapter\n\n\nclass Mine(Adapter):\n    name = 'mine'\n")
    for option in (f"{file}+puzzle-ik", f"{file}:Mine+puzzle-ik"):
        source = source_from_option(option)
        assert source.name == "mine+puzzle-ik"
        assert find_adapter(source).name == "mine+puzzle-ik"


def test_unknown_suffixes_are_part_of_an_unknown_name() -> None:
    assert split_suffix("copy-content+other") == ("copy-content+other", "")
    assert split_suffix("+park-ik") == ("+park-ik", "")
    with pytest.raises(BadConfig, match=r"copy-content\+other.*\+aberman-ik, \+park-ik, \+puzzle-ik"):
        find_adapter(AdapterSource("copy-content+other"))
