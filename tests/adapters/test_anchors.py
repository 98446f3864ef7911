from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from bench.adapters import ADAPTERS
from bench.adapters.anchors import (
    CopyContent,
    CopyStyle,
    FrozenFrame,
    LinearBlend,
    NoiseHigh,
    NoiseLow,
    NoiseMiddle,
    PoseAdain,
    Splice,
)
from bench.adapters.base import Adapter
from bench.adapters.fitted_anchors import ClassifyAndRetrieve, MeanPose, NearestPose, StyleMeanShift
from bench.adapters.oracles import LabelOracle, Oracle, RealDisjoint, RealTest, World
from bench.adapters.piecewise import in_windows
from bench.datasets.take import Take
from bench.errors import BadConfig, BadData
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop, window
from bench.motion.kinematics import world_positions
from bench.motion.skeleton import PARTS
from tests.motion.factory import person, random_clip

STYLES, CONTENTS = ("angry", "old"), ("run", "walk")


def toy_takes() -> list[Take]:
    """Three takes of 90 frames for each of 2 x 2 cells; styles bend the spine, contents raise the arm."""
    takes = []
    for place, (content, style) in enumerate((c, s) for c in CONTENTS for s in STYLES):
        for number in range(3):
            clip = random_clip(90, seed=10 * CONTENTS.index(content) + number, amount_rad=0.2)
            rotations = clip.rotations_wxyz.copy()
            bend = quat.from_rotation_vector(np.array([0.3 * STYLES.index(style), 0.0, 0.0]))
            rotations[:, 9] = quat.multiply(rotations[:, 9], bend)
            lift = quat.from_rotation_vector(np.array([0.0, 0.0, 1.0 * CONTENTS.index(content)]))
            rotations[:, 13] = quat.multiply(rotations[:, 13], lift)
            bent = clip.with_motion(rotations, clip.root_xyz_m)
            takes.append(Take(bent, f"{place}-{number}", "toy", content, style))
    return takes


def source_and_style() -> tuple[Take, Take]:
    takes = toy_takes()
    source = takes[0]
    return source.with_clip(window(source.clip, 5, 64)), takes[-1]


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


def fitted(adapter: Adapter) -> Adapter:
    adapter.fit(toy_takes(), seed=0, budget="smoke", progress=lambda *_: None)
    return adapter


NORMAL = [a for a in ADAPTERS.values() if a.kind == "anchor" and not issubclass(a, Oracle)]


def answers(adapter: Adapter, source: Take, style: Take) -> dict[str, Clip]:
    """What an adapter answers to each capability it has, with half of the style where a share is asked for."""
    half = [(Take(source.clip, style=source.style), 0.5), (style, 0.5)]
    calls: dict[str, Callable[[], Clip]] = {
        "transfers": lambda: adapter.transfer(source, style, rng=rng()),
        "samples": lambda: adapter.sample(source, str(style.style), rng=rng()),
        "interpolates": lambda: adapter.interpolate(source, half, rng=rng()),
        "interpolates parts": lambda: adapter.interpolate_parts(source, "arms", half, rng=rng()),
        "transfers parts": lambda: adapter.transfer_parts(source, {"legs": style}, rng=rng()),
    }
    return {name: call() for name, call in calls.items() if name in adapter.capabilities()}


@pytest.mark.parametrize("adapter_class", NORMAL, ids=lambda a: a.name)
def test_every_anchor_answers_on_the_sources_bones(adapter_class: type[Adapter], tmp_path: Path) -> None:
    source, style = source_and_style()
    big_style = style.with_clip(Clip(person(1.2), style.clip.rotations_wxyz, style.clip.root_xyz_m, 30.0))
    adapter = adapter_class()
    if adapter.fits():
        fitted(adapter).save(tmp_path)
        adapter = adapter_class()
        adapter.load(tmp_path)
    first, second = (answers(adapter, source, big_style) for _ in range(2))
    assert first or "predicts" in adapter.capabilities()
    for name, out in first.items():
        assert (out.n_frames, out.fps) == (64, 30.0)
        assert out.skeleton.same_bones(source.clip.skeleton)
        np.testing.assert_array_equal(out.rotations_wxyz, second[name].rotations_wxyz)


@pytest.mark.parametrize("adapter_class", [a for a in NORMAL if "predicts" in a.capabilities()], ids=lambda a: a.name)
def test_predictions_are_one_frame(adapter_class: type[Adapter]) -> None:
    source, style = source_and_style()
    adapter = adapter_class()
    if adapter.fits():
        fitted(adapter)
    out = adapter.predict(crop(source.clip, 0, 30), style, np.zeros((30, 2)))
    assert (out.n_frames, out.fps) == (1, 30.0)


def test_splice_changes_the_part_and_nothing_else() -> None:
    source, style = source_and_style()
    for part in ("legs", "arms", "spine"):
        out = Splice().transfer_parts(source, {part: style}, rng=rng())
        angle = quat.angle_between(out.rotations_wxyz, source.clip.rotations_wxyz).mean(axis=0)
        inside = list(PARTS[part])
        assert angle[inside].mean() > 0.01
        assert np.delete(angle, inside).max() < 1e-9


def test_linear_blend_goes_from_end_to_end() -> None:
    source, style = source_and_style()
    own = Take(source.clip, style=source.style)
    clips = [LinearBlend().interpolate(source, [(own, 1.0 - w), (style, w)], rng=rng()) for w in (0.0, 0.5, 1.0)]
    np.testing.assert_allclose(quat.angle_between(clips[0].rotations_wxyz, source.clip.rotations_wxyz), 0.0, atol=1e-6)
    half, whole = (quat.angle_between(clips[0].rotations_wxyz, clip.rotations_wxyz) for clip in clips[1:])
    np.testing.assert_allclose(half, whole / 2.0, atol=1e-6)


def test_a_window_method_answers_a_long_content_in_pieces() -> None:
    long = random_clip(400, seed=3)
    out = in_windows(Clip(long.skeleton, long.rotations_wxyz, long.root_xyz_m, 60.0), 64, lambda clip: clip)
    assert (out.n_frames, out.fps) == (400, 60.0)
    inside = quat.angle_between(out.rotations_wxyz[40:120], long.rotations_wxyz[40:120])
    assert np.median(inside) < 0.05


def test_copies_copy() -> None:
    source, style = source_and_style()
    assert CopyContent().transfer(source, style, rng=rng()) is source.clip
    copied = CopyStyle().transfer(source, style, rng=rng()).rotations_wxyz
    starts = [s for s in range(27) if np.allclose(copied, style.clip.rotations_wxyz[s : s + 64])]
    assert len(starts) == 1


def test_frozen_frame_stands_still_in_the_middle_pose() -> None:
    source, style = source_and_style()
    out = FrozenFrame().transfer(source, style, rng=rng())
    assert np.ptp(world_positions(out), axis=0).max() == 0.0
    np.testing.assert_array_equal(out.rotations_wxyz[0], source.clip.rotations_wxyz[32])


@pytest.mark.parametrize(("anchor", "level"), [(NoiseLow, 0.03), (NoiseMiddle, 0.1), (NoiseHigh, 0.3)])
def test_noise_has_its_level(anchor: type[Adapter], level: float) -> None:
    source, style = source_and_style()
    out = anchor().transfer(source, style, rng=rng())
    turn = quat.angle_between(out.rotations_wxyz, source.clip.rotations_wxyz)
    assert np.sqrt(np.mean(turn**2) / 3.0) == pytest.approx(level, rel=0.05)


def test_pose_adain_takes_the_styles_statistics() -> None:
    source, style = source_and_style()
    out = PoseAdain().transfer(source, style, rng=rng())
    np.testing.assert_allclose(
        out.rotations_wxyz[:, 9].mean(axis=0), style.clip.rotations_wxyz[:, 9].mean(axis=0), atol=0.02
    )
    assert out.root_xyz_m[:, 1].mean() == pytest.approx(style.clip.root_xyz_m[:, 1].mean(), abs=1e-6)


def test_mean_pose_does_not_move() -> None:
    out = fitted(MeanPose()).transfer(*source_and_style(), rng=rng())
    assert np.ptp(world_positions(out), axis=0).max() < 1e-9


def test_style_mean_shift_bends_by_the_difference_and_needs_known_styles() -> None:
    shift = fitted(StyleMeanShift())
    source, style = source_and_style()
    out = shift.transfer(source, style, rng=rng())
    turn = quat.angle_between(out.rotations_wxyz[:, 9], source.clip.rotations_wxyz[:, 9])
    assert turn.mean() == pytest.approx(0.3, abs=0.02)
    same = shift.transfer(source, Take(style.clip, style=source.style), rng=rng())
    assert quat.angle_between(same.rotations_wxyz, source.clip.rotations_wxyz).max() < 1e-9
    with pytest.raises(BadData, match="style None was not in the fit part"):
        shift.transfer(source, style.hidden(content=False, style=False), rng=rng())


def test_nearest_pose_finds_the_source_where_it_is_in_the_bank() -> None:
    source = toy_takes()[0]
    query = source.with_clip(window(source.clip, 8, 64))
    out = fitted(NearestPose()).transfer(query, Take(query.clip, style=source.style), rng=rng())
    assert quat.angle_between(out.rotations_wxyz, query.clip.rotations_wxyz).max() < 1e-3


def test_classifier_knows_its_training_takes() -> None:
    row = fitted(ClassifyAndRetrieve())
    assert isinstance(row, ClassifyAndRetrieve)
    for take in toy_takes():
        assert row.predicted_content(window(take.clip, 0, 64)) == take.content


def test_oracles_answer_under_the_right_labels() -> None:
    source, style = source_and_style()
    world = World(toy_takes(), toy_takes())
    assert RealTest().answer(source, 5, style, world, rng=rng()) is source
    right = LabelOracle().answer(source, 5, style, world, rng=rng())
    assert (right.content, right.style, right.clip.n_frames) == (source.content, style.style, 64)
    any_take = RealDisjoint().answer(source, 5, style, world, rng=rng())
    assert any_take.content in CONTENTS and any_take.style in STYLES


def test_undeclared_capability_is_refused_with_a_remedy() -> None:
    source, _ = source_and_style()
    with pytest.raises(BadConfig, match=r"does not declare that it samples.*override sample\(\)"):
        CopyStyle().sample(source, "old", rng=rng())
