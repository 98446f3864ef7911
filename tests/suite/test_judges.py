"""Judge sets: trained, carded, stored, loaded, refused."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from numpy.typing import NDArray

from bench.datasets.base import Dataset
from bench.datasets.split import Split, deal
from bench.datasets.take import Take
from bench.errors import BadInput, JudgeRefused
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.skeleton import LEFT_ARM, RIGHT_ARM, SPINE, Skeleton, canonical_skeleton
from bench.suite import judges as judges_module
from bench.suite.judge_card import check_gate, recognition, to_markdown, within_session
from bench.suite.judge_training import JudgeRecipe, measure_split, train_again
from bench.suite.judges import JudgeSet, load_canonical, load_judges, read_card, save_judges, train_judges
from bench.suite.motions import Motions
from bench.suite.second_judges import load_second_judges, save_second_judges, train_second_judges
from bench.suite.store import Store
from classifiers.train import TrainingConfig

QUICK = JudgeRecipe(
    classifier=TrainingConfig(n_steps=30, batch_size=16, peak_rate=1e-2),
    autoencoder=TrainingConfig(n_steps=5, batch_size=16),
)
ARMS = {"lift-left": LEFT_ARM, "lift-right": RIGHT_ARM, "raise-right": RIGHT_ARM}
LEANS_RAD = {"upright": 0.0, "bent": 0.7}


def person() -> Skeleton:
    """Someone with plausible bones."""
    offsets = np.zeros((21, 3))
    for joint, offset in {
        1: (0.1, 0, 0), 2: (0, -0.4, 0), 3: (0, -0.4, 0), 4: (0, -0.05, 0.1), 9: (0, 0.15, 0), 10: (0, 0.2, 0),
        11: (0, 0.2, 0), 12: (0, 0.15, 0), 13: (0.2, 0.1, 0), 14: (0.28, 0, 0), 15: (0.25, 0, 0), 16: (0.1, 0, 0),
    }.items():  # fmt: skip
        offsets[joint] = offset
    for left, right in ((1, 5), (2, 6), (3, 7), (4, 8), (13, 17), (14, 18), (15, 19), (16, 20)):
        offsets[right] = offsets[left] * np.array([-1.0, 1.0, 1.0])
    return canonical_skeleton(offsets)


def lifting(skeleton: Skeleton, content: str, style: str, number: int) -> Take:
    """A take of one arm going up and down, upright or bent, facing anywhere."""
    rng = np.random.default_rng(number * 7 + len(content) + len(style))
    time = np.arange(70) / 30.0
    rotations = np.tile(quat.IDENTITY, (70, 21, 1))
    angle = np.sin(2.0 * np.pi * (0.5 + 0.1 * rng.random()) * time + rng.uniform(0.0, 6.0))
    rotations[:, ARMS[content]] = quat.from_axis_angle(np.array([0.0, 0.0, 1.0]), angle)
    lean = LEANS_RAD[style] + 0.05 * rng.standard_normal()
    rotations[:, SPINE] = quat.from_axis_angle(np.array([1.0, 0.0, 0.0]), np.full(70, lean))
    rotations[:, 0] = quat.about_y(np.full(70, rng.uniform(-3.0, 3.0)))
    clip = Clip(skeleton, rotations, np.tile([0.3, 0.9, 0.2], (70, 1)), 30.0)
    return Take(clip, f"{content}_{style}_{number:03d}", "lifts", content, style, session="one")


@pytest.fixture(scope="module")
def dataset() -> Dataset:
    skeleton = person()
    takes = [lifting(skeleton, content, style, n) for content in ARMS for style in LEANS_RAD for n in range(20)]
    merged = {"lift-left": "left", "lift-right": "right", "raise-right": "right"}
    return Dataset("lifts", "lifts@1", "d1", tuple(sorted(takes, key=lambda t: t.take_id)), merged, "CC0", "none")


@pytest.fixture(scope="module")
def split(dataset: Dataset) -> Split:
    return deal(dataset.takes)


@pytest.fixture(scope="module")
def judges(dataset: Dataset, split: Split) -> JudgeSet:
    return train_judges(dataset, split, seeds=(0,), recipe=QUICK, unseen=dataset.takes[:4])


@pytest.fixture(scope="module")
def features(dataset: Dataset) -> NDArray[np.float64]:
    takes = [take.with_clip(take.clip.with_motion(take.clip.rotations_wxyz[:64], take.clip.root_xyz_m[:64]))
             for take in dataset.takes[::9]]  # fmt: skip
    return Motions.of(takes).window_features()


def test_card_says_what_was_measured(judges: JudgeSet, dataset: Dataset, split: Split) -> None:
    card = judges.card
    assert [judge.id for judge in card.classifiers] == ["stgcn-content/0", "stgcn-style/0", "stgcn-native/0"]
    assert [judge.id for judge in card.autoencoders] == ["autoencoder/0"]
    assert card.content_labels == ("left", "right") and card.native_labels == ("lift-left", "lift-right", "raise-right")
    content, style, native = card.classifiers
    assert content.pooled.n == len(split.select(dataset.takes, "test", "real"))
    assert content.pooled.accuracy >= 93.0 and style.pooled.accuracy >= 95.0
    assert content.pooled.chance == 50.0 and content.unseen_actor_accuracy is not None
    assert native.pooled.accuracy < 93.0, "two native labels are one motion"
    assert style.within_session_chance == 50.0 and content.within_session_accuracy is None
    assert card.leak_share is not None and 0.0 <= card.leak_share <= 1.0


def test_outputs_have_the_promised_shapes(judges: JudgeSet, features: NDArray[np.float64]) -> None:
    out = judges.evaluate(features)
    n = len(features)
    assert out.content[0].features.shape == (n, 64) and out.style[0].log_probabilities.shape == (n, 2)
    assert out.native[0].log_probabilities.shape == (n, 3)
    assert out.encoded[0].activations.shape == (n, 512) and out.encoded[0].components.shape == (n, 32)
    embedding = out.embedding
    assert embedding.content_features.shape == (1, n, 64) and embedding.autoencoder_components.shape == (1, n, 32)
    assert [fact.id for fact in judges.facts] == ["stgcn-content/0", "stgcn-style/0", "autoencoder/0"]


def test_threads_and_company_change_nothing(judges: JudgeSet, features: NDArray[np.float64]) -> None:
    together = judges.evaluate(features).embedding
    threads = torch.get_num_threads()
    torch.set_num_threads(2 if threads == 1 else 1)
    other_threads = judges.evaluate(features).embedding
    torch.set_num_threads(threads)
    alone = judges.evaluate(features[2:3]).embedding
    for name in ("content_features", "style_features", "autoencoder_components"):
        assert np.array_equal(getattr(together, name), getattr(other_threads, name))
        assert np.allclose(getattr(together, name)[:, 2:3], getattr(alone, name), rtol=1e-6, atol=1e-6)


def test_turning_and_moving_a_window_changes_nothing(judges: JudgeSet, dataset: Dataset) -> None:
    clip = dataset.takes[0].clip
    rotations = clip.rotations_wxyz[:64].copy()
    turn = quat.about_y(2.0)
    rotations[:, 0] = -quat.multiply(np.broadcast_to(turn, (64, 4)), rotations[:, 0])
    moved = quat.rotate(np.broadcast_to(turn, (64, 4)), clip.root_xyz_m[:64]) + np.array([3.0, 0.4, -2.0])
    pair = [clip.with_motion(clip.rotations_wxyz[:64], clip.root_xyz_m[:64]), clip.with_motion(rotations, moved)]
    out = judges.evaluate(Motions.of([dataset.takes[0].with_clip(c) for c in pair]).window_features())
    for judged in (out.content[0].features, out.style[0].features, out.encoded[0].components):
        assert np.allclose(judged[0], judged[1], atol=1e-4)


def test_stored_judges_answer_alike(judges: JudgeSet, features: NDArray[np.float64], tmp_path: Path) -> None:
    save_judges(tmp_path, judges)
    again = load_judges(tmp_path)
    assert again.digest == judges.digest and again.card == judges.card
    assert np.array_equal(again.evaluate(features).content[0].features, judges.evaluate(features).content[0].features)
    assert all(path.stat().st_size < 2_000_000 for path in tmp_path.iterdir())


def test_windows_of_another_shape_are_refused(judges: JudgeSet) -> None:
    with pytest.raises(BadInput, match=r"\[any, 64, 21, 7\]"):
        judges.evaluate(np.zeros((2, 60, 21, 7)))


def test_changed_replaced_and_missing_files_are_refused(judges: JudgeSet, tmp_path: Path) -> None:
    save_judges(tmp_path, judges)
    content, style = tmp_path / "content-0.safetensors", tmp_path / "style-0.safetensors"
    original = content.read_bytes()
    content.write_bytes(style.read_bytes())
    with pytest.raises(JudgeRefused, match="its card names"):
        load_judges(tmp_path)
    content.write_bytes(original[:-1] + bytes([original[-1] ^ 1]))
    with pytest.raises(JudgeRefused, match="changed or damaged"):
        load_judges(tmp_path)
    content.unlink()
    with pytest.raises(JudgeRefused, match="cannot be read as a judge file"):
        load_judges(tmp_path)
    (tmp_path / "card.json").write_text("{}")
    with pytest.raises(JudgeRefused, match="judge card cannot be read"):
        read_card(tmp_path)


def test_canonical_judges_answer_for_their_data_only(
    judges: JudgeSet, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judges_module, "PRETRAINED", tmp_path)
    assert load_canonical("lifts@1", "d1", judges.card.split_digest) is None
    save_judges(tmp_path / "lifts@1", judges)
    found = load_canonical("lifts@1", "d1", judges.card.split_digest)
    assert found is not None and found.origin == "canonical"
    assert load_canonical("lifts@1", "d2", judges.card.split_digest) is None
    assert load_canonical("lifts@1", "d1", "other") is None


def test_poor_judges_are_refused(judges: JudgeSet, tmp_path: Path, dataset: Dataset, split: Split) -> None:
    save_judges(tmp_path, judges)
    card = json.loads((tmp_path / "card.json").read_text())
    card["classifiers"][0]["pooled"]["accuracy"] = 92.9
    (tmp_path / "card.json").write_text(json.dumps(card))
    with pytest.raises(JudgeRefused, match=r"stgcn-content/0 92\.9 % \(gate 93 %\)"):
        load_judges(tmp_path)
    untrained = JudgeRecipe(TrainingConfig(n_steps=1, batch_size=8), TrainingConfig(n_steps=1, batch_size=8))
    with pytest.raises(JudgeRefused, match="too few real windows right"):
        train_judges(dataset, split, seeds=(0,), recipe=untrained)
    check_gate(judges.card)


def test_other_splits_and_training_again(judges: JudgeSet, dataset: Dataset, split: Split) -> None:
    short = JudgeRecipe(TrainingConfig(n_steps=2, batch_size=8))
    rows = measure_split(dataset, deal(dataset.takes, kind="interleaved"), (0,), short)
    assert [(row.kind, row.target) for row in rows] == [
        ("interleaved", "content"), ("interleaved", "style"), ("interleaved", "native")
    ]  # fmt: skip
    repeat = train_again(dataset, split, judges.card.classifiers[0], judges.content[0], QUICK, "same machine")
    assert repeat.same_bytes and repeat.same_predictions == 100.0
    card = judges.card.model_copy(update={"other_splits": rows, "repeats": (repeat,)})
    text = to_markdown(card)
    assert "| interleaved | content | 0 |" in text and "| same machine | yes | 100.00 % |" in text
    assert "CC0" in text and "| true \\ predicted | left | right |" in text


def test_second_family_lies_beside_the_first_and_leaves_its_digest_alone(
    judges: JudgeSet, dataset: Dataset, split: Split, features: NDArray[np.float64], tmp_path: Path
) -> None:
    folder = tmp_path / "judges"
    save_judges(folder, judges)
    with pytest.raises(JudgeRefused, match="there is no second judge family"):
        load_second_judges(folder)
    second = train_second_judges(dataset, split, seeds=(0, 1), recipe=QUICK, unseen=dataset.takes[:4])
    save_second_judges(folder, second)
    found, first = load_second_judges(folder), load_judges(folder)
    assert first.digest == judges.digest and first.card.second == second.facts == found.facts
    assert [fact.id for fact in found.facts] == [f"temporal-{t}/{s}" for t in ("content", "style") for s in (0, 1)]
    assert "## Second family" in (folder / "card.md").read_text()
    said = found.evaluate(features)
    assert said.content_features.shape == (2, len(features), 64) and said.autoencoder_components.shape[2] == 0
    assert np.array_equal(said.style_log_probabilities, second.evaluate(features).style_log_probabilities)
    motions, store = Motions.of([dataset.takes[0].with_clip(crop(dataset.takes[0].clip, 0, 64))]), Store(tmp_path / "s")
    once, again = (found.stored_embedding(motions, store) for _ in range(2))
    assert np.array_equal(once.content_features, again.content_features)
    assert len(list((tmp_path / "s" / "embed").iterdir())) == 1
    (folder / "temporal-style-1.safetensors").write_bytes((folder / "temporal-style-0.safetensors").read_bytes())
    with pytest.raises(JudgeRefused, match="its card names"):
        load_second_judges(folder)


def test_a_poor_second_family_is_refused(dataset: Dataset, split: Split) -> None:
    untrained = JudgeRecipe(TrainingConfig(n_steps=1, batch_size=8))
    with pytest.raises(JudgeRefused, match=r"too few real windows right to score anything: temporal-"):
        train_second_judges(dataset, split, seeds=(0,), recipe=untrained)


def test_recognition_counts() -> None:
    facts = recognition(np.array([0, 0, 0, 1]), np.array([0, 0, 1, 1]), 2)
    assert facts.accuracy == 75.0 and facts.balanced_accuracy == pytest.approx(100.0 * (2 / 3 + 1) / 2)
    assert facts.majority_rate == 75.0 and facts.confusion == ((2, 1), (0, 1))


def test_within_session_chooses_among_the_styles_of_the_session() -> None:
    log_probabilities = np.log([[0.2, 0.3, 0.5], [0.3, 0.2, 0.5], [0.1, 0.1, 0.8], [0.6, 0.2, 0.2]])
    true = np.array([0, 1, 2, 0])
    assert within_session(true, log_probabilities, ["a", "a", "b", None]) == (0.0, 50.0)
    assert within_session(true, log_probabilities, [None] * 4) is None
