"""Training and transfer of gestures through the adapter."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.adapters.kuriyama2022 import KURIYAMA, SoftSwap
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.errors import BadData
from bench.methods.kuriyama2022.method import SWAPS, KuriyamaConfig, train_gestures
from bench.methods.training import Curves, FitRequest
from bench.motion.edit import crop


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    return [take for take in unseen_takes(takes_per_cell=1) if take.style in ("neutral", "old", "proud")]


@pytest.fixture(scope="module")
def fitted(takes: list[Take]) -> SoftSwap:
    adapter = SoftSwap()
    adapter.fit(takes, seed=0, budget="smoke", progress=silent)
    return adapter


def test_rows_cover_every_swap_and_every_ablation() -> None:
    assert {adapter.swap for adapter in KURIYAMA} == set(SWAPS)
    assert {adapter.without for adapter in KURIYAMA} - {""} == {"identity", "cyclic", "structure", "appearance"}


def test_answers_fit_the_content(fitted: SoftSwap, takes: list[Take]) -> None:
    style = takes[-1]
    for n_frames in (1, 10, 64):
        content = takes[0].with_clip(crop(takes[0].clip, 0, n_frames))
        answer = fitted.transfer(content, style, rng=rng())
        assert answer.n_frames == n_frames and answer.fps == content.clip.fps
        assert answer.skeleton == content.clip.skeleton
        assert np.isfinite(answer.root_xyz_m).all()


def test_saved_and_loaded_it_answers_the_same(fitted: SoftSwap, takes: list[Take], tmp_path: Path) -> None:
    fitted.save(tmp_path)
    assert sum(file.stat().st_size for file in tmp_path.iterdir()) < 2_000_000
    loaded = SoftSwap()
    loaded.load(tmp_path)
    assert loaded.config == fitted.config
    one, other = (method.transfer(takes[0], takes[-1], rng=rng()) for method in (fitted, loaded))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)
    assert loaded.describe().parameters == 23_743 + 50_240


def test_training_is_decided_by_its_seed(fitted: SoftSwap, takes: list[Take]) -> None:
    again = SoftSwap()
    again.fit(takes, seed=0, budget="smoke", progress=silent)
    for one, other in zip(fitted.network.parameters(), again.network.parameters(), strict=True):
        np.testing.assert_array_equal(one.detach().numpy(), other.detach().numpy())


def test_restoration_and_identity_losses_fall(takes: list[Take]) -> None:
    config = KuriyamaConfig(
        rate=3e-3,
        autoencoder_steps=60,
        autoencoder_batch=8,
        transformer_steps=40,
        transformer_batch=2,
        transformer_frames=160,
    )
    _, _, curves = train_gestures(config, FitRequest(takes, 0, "smoke", "cpu", None, silent))
    assert curves.names == ("restoration", "identity", "cyclic", "structure", "appearance")
    for loss in ("restoration", "identity"):
        values = curves.values[:, curves.names.index(loss)]
        values = values[np.isfinite(values)]
        assert values[-5:].mean() < 0.7 * values[0], loss


def test_curves_of_stages_follow_each_other() -> None:
    first = Curves(("a",), np.array([5, 10]), np.array([[1.0], [2.0]]), 3.0)
    second = Curves(("b",), np.array([4]), np.array([[7.0]]), 2.0)
    joined = Curves.one_after_the_other([first, second])
    assert joined.names == ("a", "b")
    assert joined.steps.tolist() == [5, 10, 14]
    np.testing.assert_array_equal(joined.values, [[1.0, np.nan], [2.0, np.nan], [np.nan, 7.0]])
    assert joined.seconds == 5.0


def test_takes_without_labels_are_refused(takes: list[Take]) -> None:
    with pytest.raises(BadData, match="style labels"):
        SoftSwap().fit([takes[0].hidden(content=False, style=False)], seed=0, budget="smoke", progress=silent)
