"""Xia 2015: poses, registration, local mixtures, timing, streams."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bench.adapters.xia2015 import Xia2015
from bench.arrays import FloatArray
from bench.datasets.procedural import unseen_takes
from bench.datasets.take import Take
from bench.errors import BadConfig, BadData, BadFile, BadInput
from bench.methods.xia2015.database import (
    CONFIGS,
    Database,
    XiaConfig,
    build_database,
    search_space,
    slope,
    warp,
)
from bench.methods.xia2015.poses import joined_poses, mean_reference, read_poses, search_windows, to_rotations
from bench.methods.xia2015.xia2015 import Xia2015 as Method
from bench.methods.xia2015.xia2015 import XiaStream, mixture, retimed, transfer, transfer_with_timing
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import yaw_aligned
from tests.motion.factory import random_clip


def silent(what: str, done: int, total: int) -> None:
    """Progress that nobody sees."""


def rng() -> np.random.Generator:
    return np.random.default_rng(0)


@pytest.fixture(scope="module")
def takes() -> list[Take]:
    chosen = [take for take in unseen_takes(takes_per_cell=2) if take.style in ("neutral", "old", "proud")]
    return [take for take in chosen if take.content in ("walk", "kick")]


@pytest.fixture(scope="module")
def method(takes: list[Take]) -> Method:
    return Method(build_database(takes, XiaConfig(), silent), XiaConfig())


def test_poses_there_and_back() -> None:
    clip = random_clip(20, amount_rad=0.5)
    reference = mean_reference([clip])
    poses = read_poses(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton, reference)
    back = to_rotations(poses.vectors, poses.yaw_rad, reference)
    assert quat.angle_between(back, clip.rotations_wxyz).max() < 1e-6
    turned, root = yaw_aligned(clip.rotations_wxyz, clip.root_xyz_m, np.full(20, 2.5))
    again = read_poses(turned, root, clip.skeleton, reference)
    np.testing.assert_allclose(again.vectors, poses.vectors, atol=1e-9)
    np.testing.assert_allclose(search_windows(again), search_windows(poses), atol=1e-9)


def test_a_window_is_five_frames_of_the_past() -> None:
    clip = random_clip(20)
    poses = read_poses(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton, mean_reference([clip]))
    found = search_windows(poses)
    np.testing.assert_allclose(found[10, 63:126], (poses.vectors[10] - poses.vectors[6]) / 4.0)
    np.testing.assert_array_equal(found[0, 63:], 0.0)
    changed = poses.vectors.copy()
    changed[11:] += 1.0
    changed[:6] += 1.0
    other = search_windows(type(poses)(changed, poses.yaw_rad, poses.root_xyz_m))
    np.testing.assert_array_equal(other[10], found[10])


def test_windows_in_pieces_are_the_windows_at_once() -> None:
    clip = random_clip(12)
    reference = mean_reference([clip])

    def read(start: int, stop: int) -> object:
        return read_poses(clip.rotations_wxyz[start:stop], clip.root_xyz_m[start:stop], clip.skeleton, reference)

    whole = search_windows(read(0, 12))  # type: ignore[arg-type]
    before = read(0, 7)
    np.testing.assert_allclose(search_windows(read(7, 12), before), whole[7:])  # type: ignore[arg-type]
    joined = joined_poses(before, read(7, 12))  # type: ignore[arg-type]
    np.testing.assert_allclose(search_windows(joined), whole)


def test_each_group_of_a_window_counts_alike() -> None:
    windows = rng().normal(size=(500, 130)) * np.repeat([1.0, 50.0, 0.01, 7.0], [63, 63, 3, 1])
    mean, basis = search_space(windows, 130)
    placed = (windows - mean) @ basis
    assert placed.var(axis=0).sum() == pytest.approx(4.0, rel=1e-6)


def test_the_warp_is_the_mean_partner_and_its_slope_the_timing() -> None:
    pairs = np.array([[0, 0], [0, 1], [1, 2], [2, 3], [2, 4], [3, 5]])
    np.testing.assert_allclose(warp(pairs, 4), [0.5, 2.0, 3.5, 5.0])
    np.testing.assert_allclose(slope(2.0 * np.arange(30.0)), 2.0)
    np.testing.assert_array_equal(slope(np.zeros(1)), 1.0)


def test_a_frame_is_its_own_partner_and_others_are_of_the_style_and_content(method: Method, takes: list[Take]) -> None:
    database = method.database
    rows = np.arange(len(database.poses))
    np.testing.assert_array_equal(database.partners[rows, database.styles], rows)
    np.testing.assert_array_equal(database.slopes[rows, database.styles], 1.0)
    firsts = {int(start): take for start, take in zip(dict.fromkeys(database.starts.tolist()), takes, strict=True)}
    for column, style in enumerate(database.style_labels):
        partners = database.partners[:, column]
        assert {firsts[start].style for start in database.starts[partners].tolist()} == {style}
        same = [
            firsts[int(a)].content == firsts[int(b)].content
            for a, b in zip(database.starts, database.starts[partners], strict=True)
        ]
        assert all(same)


def test_a_stretched_copy_is_registered_to_itself_with_its_timing() -> None:
    clip = random_clip(60)
    slow = clip.with_motion(np.repeat(clip.rotations_wxyz, 2, axis=0), np.repeat(clip.root_xyz_m, 2, axis=0))
    pair = [Take(clip, content="walk", style="fast"), Take(slow, content="walk", style="slow")]
    database = build_database(pair, XiaConfig(neighbours=8), silent)
    partners = database.partners[:60, 1] - 60
    assert np.abs(partners / 2.0 - np.arange(60)).mean() < 2.0
    assert np.median(database.slopes[8:52, 1]) == pytest.approx(2.0, abs=0.3)


def linear_examples(n: int, styles: int) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    generator = rng()
    codes = generator.normal(size=(n, 5))
    maps = generator.normal(size=(styles, 5, 7))
    of = np.arange(n) % styles
    wanted = np.einsum("nd,ndp->np", codes, maps[of]) + of[:, None]
    return codes, wanted, of.astype(np.float64), maps


def test_one_component_is_weighted_ridge_regression() -> None:
    """The dual form against the primal one."""
    codes, wanted, _, _ = linear_examples(30, 1)
    wanted = wanted + rng().normal(size=wanted.shape)
    weights = np.linspace(1.0, 3.0, 30)
    weights /= weights.sum()
    code, ridge = np.full(5, 0.3), 0.2
    centred, targets = codes - weights @ codes, wanted - weights @ wanted
    penalty = ridge * (weights @ np.square(centred).sum(axis=1))
    each = weights[:, None] * len(weights)
    primal = np.linalg.solve(centred.T @ (each * centred) + penalty * np.eye(5), centred.T @ (each * targets))
    by_hand = weights @ wanted + (code - weights @ codes) @ primal
    found = mixture(code, codes, wanted, weights, np.zeros(30, dtype=np.int64), ridge)
    np.testing.assert_allclose(found, by_hand, rtol=1e-6)


def test_components_are_mixed_by_the_weights_of_their_examples() -> None:
    codes, wanted, of, maps = linear_examples(60, 2)
    weights = np.where(of == 0.0, 3.0, 1.0)
    weights /= weights.sum()
    code = np.full(5, 0.2)
    each = np.stack([code @ maps[0], code @ maps[1] + 1.0])
    found = mixture(code, codes, wanted, weights, of.astype(np.int64), 1e-9)
    np.testing.assert_allclose(found, 0.75 * each[0] + 0.25 * each[1], atol=1e-5)


def test_into_its_own_style_a_motion_stays_near_itself(method: Method, takes: list[Take]) -> None:
    for take in takes[::3]:
        made = transfer(method, take.clip, take.style)
        apart = quat.angle_between(made.rotations_wxyz, take.clip.rotations_wxyz)
        assert np.degrees(np.median(apart)) < 5.0


def test_another_style_moves_towards_that_style(method: Method, takes: list[Take]) -> None:
    """The mean pose of the answer is nearer to that of the wanted style's takes than the source's is."""
    walks = {take.style: take.clip for take in takes if take.content == "walk"}
    source, wanted = walks["neutral"], walks["old"]
    made = transfer(method, source, "old")

    def apart(one: Clip, other: Clip) -> float:
        return float(quat.angle_between(*(quat.mean(clip.rotations_wxyz[:, 1:]) for clip in (one, other))).mean())

    assert apart(made, wanted) < 0.7 * apart(source, wanted)


def frames_of(stream: XiaStream, clip: Clip, start: int = 0, stop: int | None = None) -> FloatArray:
    stop = clip.n_frames if stop is None else stop
    return np.stack([stream.step(clip.rotations_wxyz[t], clip.root_xyz_m[t])[0] for t in range(start, stop)])


def test_the_stream_is_the_offline_answer_and_reads_nothing_of_the_future(method: Method, takes: list[Take]) -> None:
    clip = takes[0].clip
    offline = transfer(method, clip, "old")
    np.testing.assert_allclose(frames_of(XiaStream(method, "old"), clip), offline.rotations_wxyz, atol=1e-9)
    cut = clip.with_motion(clip.rotations_wxyz[:9], clip.root_xyz_m[:9])
    np.testing.assert_allclose(transfer(method, cut, "old").rotations_wxyz, offline.rotations_wxyz[:9], atol=1e-9)


def test_streams_do_not_know_of_each_other_and_can_be_copied(method: Method) -> None:
    clip, other = random_clip(16, seed=1), random_clip(16, seed=2)
    alone = frames_of(XiaStream(method, "old"), clip)
    stream, second = XiaStream(method, "old"), XiaStream(method, "proud")
    for t in range(8):
        second.step(other.rotations_wxyz[t], other.root_xyz_m[t])
        np.testing.assert_array_equal(stream.step(clip.rotations_wxyz[t], clip.root_xyz_m[t])[0], alone[t])
    kept = stream.copy()
    frames_of(stream, other)
    np.testing.assert_array_equal(frames_of(kept, clip, 8), alone[8:])


def test_timing_is_that_of_the_partners() -> None:
    clip = random_clip(60)
    slow = clip.with_motion(np.repeat(clip.rotations_wxyz, 2, axis=0), np.repeat(clip.root_xyz_m, 2, axis=0))
    pair = [Take(clip, content="walk", style="fast"), Take(slow, content="walk", style="slow")]
    config = XiaConfig(neighbours=4)
    method = Method(build_database(pair, config, silent), config)
    assert transfer(method, clip, "slow").n_frames == 60
    assert 95 <= transfer_with_timing(method, clip, "slow").n_frames <= 130
    assert 55 <= transfer_with_timing(method, clip, "fast").n_frames <= 62


def test_retiming_by_hand() -> None:
    clip = random_clip(10)
    np.testing.assert_array_equal(retimed(clip, np.ones(10)).root_xyz_m, clip.root_xyz_m)
    np.testing.assert_array_equal(retimed(clip, np.full(10, 2.0)).root_xyz_m[::2], clip.root_xyz_m)
    assert retimed(clip, np.full(10, 0.5)).n_frames == 5
    assert retimed(clip, np.zeros(10)).n_frames == 1


def test_through_the_adapter(takes: list[Take], tmp_path: Path) -> None:
    row = Xia2015()
    with pytest.raises(BadConfig, match="once it has a database"):
        row.describe()
    row.fit(takes, seed=0, budget="smoke", progress=silent)
    assert row.method.config == CONFIGS["smoke"] and len(row.method.database.poses) > 0
    row.save(tmp_path)
    restored = Xia2015()
    restored.load(tmp_path)
    one, other = (each.transfer(takes[0], takes[-1], rng=rng()) for each in (row, restored))
    np.testing.assert_array_equal(one.rotations_wxyz, other.rotations_wxyz)
    assert restored.describe() == row.describe()
    with pytest.raises(BadInput, match="got 'angry'"):
        row.open_stream(Take(takes[0].clip, style="angry"), content_label=None, rng=rng())


def test_bad_input(takes: list[Take], tmp_path: Path) -> None:
    with pytest.raises(BadData, match="labels"):
        build_database([Take(takes[0].clip)], XiaConfig(), silent)
    with pytest.raises(BadFile, match="not a database"):
        Database.load(tmp_path)
