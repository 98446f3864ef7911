"""What records say of a toy row, against what lies beside it or was worked out anew: no score changes a number."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.datasets.take import Take
from bench.metrics import interpolation, locality, physics
from bench.metrics.paired import rotation_errors_deg
from bench.motion.kinematics import world_positions
from bench.motion.skeleton import CANONICAL_PARENTS, PARTS
from bench.protocols.transfer import TRANSFER
from bench.suite.motions import Motions
from bench.suite.scores import SCORES
from bench.suite.scores.base import PlainRow, Reference, Row, Scored
from bench.suite.scores.papers import CUT_OF, CUTS
from bench.suite.scores.parts import displacements
from tests.motion.factory import random_clip
from tests.suite import test_track_scores as tracks
from tests.suite.factory import N_TASKS, reference, row


@pytest.fixture(scope="module")
def ref() -> Reference:
    return reference()


@pytest.fixture(scope="module")
def jumbled(ref: Reference) -> Row:
    """A row that is nowhere right nor still: other motion, some labels wrong, bones that grow."""
    takes = [Take(random_clip(64, seed=900 + n), content=t.content, style=t.target_style)
             for n, t in enumerate(ref.tasks)]  # fmt: skip
    made = row(ref, content_right=0.7, style_right=0.6, outputs=Motions.of(takes))
    vars(made)["positions_m"] = made.motions.world_positions() * np.linspace(1.0, 1.2, 64)[:, None, None]
    return made


def check_means(scored: Scored, reference_slices: dict[str, np.ndarray]) -> None:
    """Every value is the mean of the per-sample values in its slice, or of its judges' values, and is not 0."""
    for found in scored.measurements:
        if found.value is None:
            continue
        assert found.value != 0.0
        values = scored.per_sample.get(found.name)
        if values is not None:
            assert found.value == pytest.approx(float(np.nanmean(values[reference_slices[found.slice]])), rel=1e-6)
        else:
            assert found.judge_values, f"{found.name}: nothing beside it says what it is"
            assert found.value == pytest.approx(float(np.mean(found.judge_values)), rel=1e-9)


SOURCE = ("copied_share", "contact_precision", "contact_recall")
"""Metrics that are 0 for other motion than the source: the row of its copies has 100."""
ALONE = ("neighbour_ratio", "jerk_ratio", "jerk_ratio_worst_content", "speed_ratio")
"""Metrics that are neither a mean over samples nor over judges."""


@pytest.mark.parametrize("name", [n for n in (*TRANSFER.metrics, *TRANSFER.truth_metrics) if n not in ALONE])
def test_transfer_records_are_means_of_what_lies_beside_them(name: str, ref: Reference, jumbled: Row) -> None:
    made = row(ref, content_right=0.7, style_right=0.6) if name in SOURCE else jumbled
    scored = SCORES[name](made, ref)
    assert any(found.value is not None for found in scored.measurements)
    check_means(scored, dict(ref.slices))


@pytest.mark.parametrize("name", ["reconstruction_position", "reconstruction_rotation", "path_drift"])
def test_errors_against_the_source_are_means_over_samples(name: str, ref: Reference, jumbled: Row) -> None:
    check_means(SCORES[name](jumbled, ref), dict(ref.slices))


def test_neighbour_ratio_is_that_of_its_medians(ref: Reference, jumbled: Row) -> None:
    [found] = SCORES["neighbour_ratio"](jumbled, ref).measurements
    assert found.value == pytest.approx(found.details["median_to_fit"] / found.details["median_to_test"])


def test_jerk_ratio_is_to_real_motion_of_the_same_contents(ref: Reference, jumbled: Row) -> None:
    uneven = replace(ref, floor_jerk=np.where(ref.floor.contents == 0, 20.0, 80.0))
    jerk = physics.jerk_per_sample(jumbled.positions_m, 30.0, joints=jumbled.joints)
    expected = np.where(jumbled.contents == 0, 20.0, 80.0)
    found = {m.slice: m.value for m in SCORES["jerk_ratio"](jumbled, uneven).measurements}
    assert found["all"] == pytest.approx(jerk.mean() / expected.mean())
    ratios = [jerk[jumbled.contents == c].mean() / level for c, level in ((0, 20.0), (1, 80.0))]
    [worst] = SCORES["jerk_ratio_worst_content"](jumbled, uneven).measurements
    assert worst.value == pytest.approx(max(ratios, key=lambda ratio: abs(np.log(ratio))))


def test_speed_ratio_is_to_the_fit_part_of_the_same_contents(ref: Reference, jumbled: Row) -> None:
    of_content: dict[str, list[float]] = {}
    for take in map(ref.pack.take, ref.fit_take_ids):
        speed = physics.speed_per_sample(world_positions(take.clip)[None], take.clip.fps, joints=jumbled.joints)
        of_content.setdefault(str(take.content), []).append(float(speed[0]))
    expected = [float(np.mean(of_content[ref.content_labels[content]])) for content in jumbled.contents]
    speed = physics.speed_per_sample(jumbled.positions_m, 30.0, joints=jumbled.joints)
    found = {m.slice: m.value for m in SCORES["speed_ratio"](jumbled, ref).measurements}
    assert found["all"] == pytest.approx(speed.mean() / np.mean(expected))


def test_bone_drift_is_that_of_the_positions(ref: Reference, jumbled: Row) -> None:
    lengths = np.linalg.norm(jumbled.motions.offsets_m, axis=-1)[jumbled.motions.skeleton_index]
    [found] = SCORES["bone_drift"](jumbled, ref).measurements
    assert found.value == pytest.approx(physics.bone_drift(jumbled.positions_m, CANONICAL_PARENTS, lengths).mean())
    assert found.value and found.value > 1.0


@pytest.mark.parametrize("name", ["fmd[stgcn]", *CUT_OF])
def test_papers_distances_are_means_over_judges(
    name: str, ref: Reference, jumbled: Row, monkeypatch: pytest.MonkeyPatch
) -> None:
    rng = np.random.default_rng(3)
    per_sample = {cut: len(starts) for cut, starts in CUTS.items()}
    real = {cut: rng.normal(size=(2, 200, 6)).astype(np.float32) for cut in CUTS}
    seen = {cut: rng.normal(0.4, 1.0, (2, N_TASKS * n, 6)).astype(np.float32) for cut, n in per_sample.items()}
    monkeypatch.setattr("bench.suite.scores.papers.activations", lambda judges, motions, cut: seen[cut])
    judged = replace(ref, trials=(np.arange(60), np.arange(30, 90)), activations=real, judges="any")  # type: ignore[arg-type]
    check_means(SCORES[name](jumbled, judged), dict(ref.slices))


class TestTracks:
    """Rows of the other tracks, changed from what their own tests use so that no value is 0."""

    def parts_row(self) -> PlainRow:
        sources = tracks.source_clips(tracks.TestParts.tasks)
        return tracks.plain_row(sources, [random_clip(64, seed=n) for n in range(len(sources))])

    @pytest.mark.parametrize("name", ["locality_msd", "locality_distance", "joints_above_0.1", "joints_above_0.05"])
    def test_parts_are_what_their_joints_say(self, name: str) -> None:
        scored = SCORES[name](self.parts_row(), tracks.basis(tracks.TestParts.tasks))
        assert scored.measurements
        for found in scored.measurements:
            joints = {int(label.split()[0]): value for label, value in found.details.items()}
            inside = [value for joint, value in joints.items() if joint in PARTS[found.slice.removeprefix("part=")]]
            expected = float(len(joints)) if name.startswith("joints_above") else float(np.mean(inside))
            assert found.value == pytest.approx(expected) and found.value

    @pytest.mark.parametrize("name", ["leak_ratio", "leak_ratio[position]"])
    def test_leaks_are_ratios_of_mean_changes(self, name: str) -> None:
        made, setting = self.parts_row(), tracks.basis(tracks.TestParts.tasks)
        rotations = (side.window_rotations_wxyz for side in (made.source, made.motions))
        angles = np.stack([rotation_errors_deg(a, b).mean(axis=0) for a, b in zip(*rotations, strict=True)])
        change = displacements(made, squared=True) if "position" in name else angles
        found = {m.slice: m.value for m in SCORES[name](made, setting).measurements}
        parts = [slice_name for slice_name in found if slice_name != "all" and found[slice_name] is not None]
        virtual = [joint for joint in range(21) if joint not in made.joints]
        for slice_name in parts:
            mean = change[setting.slices[slice_name]].mean(axis=0)
            touched = PARTS[slice_name.removeprefix("part=")]
            assert found[slice_name] == pytest.approx(locality.leak_ratio(mean, touched, virtual))
        assert len(parts) == 3 and found["all"] == pytest.approx(np.mean([found[part] for part in parts]))

    @pytest.mark.parametrize("name", ["next_frame_error", "bone_length_loss"])
    def test_prediction(self, name: str) -> None:
        tasks = tracks.prediction_tasks_of_toys()
        setting = tracks.basis(tasks)
        frames = tracks.TestPrediction().true_frames()
        longer = [replace(f, skeleton=replace(f.skeleton, offsets_m=1.1 * f.skeleton.offsets_m)) for f in frames]
        check_means(SCORES[name](tracks.plain_row(frames, longer), setting), dict(setting.slices))

    @pytest.mark.parametrize("name", ["monotonicity", "evenness", "end_recognition", "middle_content"])
    def test_interpolation(self, name: str) -> None:
        made, setting = tracks.TestInterpolation().setting()
        moving = Motions.of([Take(random_clip(64, seed=n), content="run", style="old") for n in range(50)])
        made = replace(made, motions=moving)
        scored = SCORES[name](made, setting)
        check_means(scored, {"all": np.ones(10, dtype=bool)})
        if name == "evenness":
            groups = moving.window_positions[:, :, list(made.joints)].reshape(10, 5, 64, -1, 3)
            expected = [interpolation.evenness(group) for group in groups]
            np.testing.assert_allclose(scored.per_sample[name], expected)
