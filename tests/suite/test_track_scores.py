"""Scores of the tracks beside transfer: known answers for rows that are made to be right or wrong."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields, replace

import numpy as np
import pytest

from bench.adapters.anchors import spliced
from bench.datasets.take import Take
from bench.errors import BadInput
from bench.metrics.interpolation import WEIGHTS
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop, window
from bench.motion.skeleton import PARTS
from bench.protocols import PROTOCOLS
from bench.protocols.base import Task, TaskPool
from bench.protocols.conditions import short_tasks
from bench.protocols.parts import part_tasks
from bench.suite.motions import Motions
from bench.suite.reference import trials_of
from bench.suite.samples import cut_motions, samples_of
from bench.suite.scores import SCORES
from bench.suite.scores.base import Basis, PlainRow, Reference, Row, Scored
from bench.suite.scores.conditions import SegmentRow, segments_of
from bench.suite.scores.prediction import frame_features
from reports.bootstrap import cluster_counts
from reports.records import Measurement
from tests.motion.factory import random_clip
from tests.suite.factory import CONTENTS, STYLES, pack_of, reference, row, toy_takes

UP_M = np.array([0.0, 1.0, 0.0])


def measured(scored: Scored, slice_name: str = "all") -> Measurement:
    [found] = [m for m in scored.measurements if m.slice == slice_name]
    return found


def value(scored: Scored, slice_name: str = "all") -> float:
    found = measured(scored, slice_name).value
    assert found is not None
    return found


def basis(tasks: Sequence[Task]) -> Basis:
    clusters = np.array([task.content_take_id for task in tasks])
    takes = toy_takes(0)
    return Basis(
        tasks=tasks,
        content_labels=CONTENTS,
        style_labels=STYLES,
        counts=cluster_counts(clusters, 20, seed=0),
        pack=pack_of(takes),
        fit_take_ids=tuple(take.take_id for take in takes),
    )


def source_clips(tasks: Sequence[Task]) -> list[Clip]:
    by_id = {take.take_id: take for take in toy_takes(0)}
    return [window(by_id[task.content_take_id].clip, task.start_frame, task.n_frames) for task in tasks]


def plain_row(sources: Sequence[Clip], outputs: Sequence[Clip]) -> PlainRow:
    return PlainRow(*(Motions.of([Take(clip) for clip in clips]) for clips in (outputs, sources)))


def bent(clip: Clip, joint: int, angle_rad: float) -> Clip:
    rotations = clip.rotations_wxyz.copy()
    turn = quat.from_rotation_vector(np.array([angle_rad, 0.0, 0.0]))
    rotations[:, joint] = quat.multiply(rotations[:, joint], turn)
    return clip.with_motion(rotations, clip.root_xyz_m)


class TestParts:
    tasks = part_tasks(TaskPool(toy_takes(0)), 16, 0)

    def outputs(self) -> list[Clip]:
        """The source with the part's rotations from other motion."""
        sources = source_clips(self.tasks)
        other = random_clip(64, seed=99)
        return [spliced(clip, Clip(clip.skeleton, other.rotations_wxyz, clip.root_xyz_m, 30.0), PARTS[task.part])
                for clip, task in zip(sources, self.tasks, strict=True)]  # fmt: skip

    def test_changing_the_part_alone_leaks_nothing(self) -> None:
        found = SCORES["leak_ratio"](plain_row(source_clips(self.tasks), self.outputs()), basis(self.tasks))
        assert value(found) == pytest.approx(0.0, abs=1e-6)
        assert measured(found, "part=all").reason == "no joint is outside the part"

    def test_a_copy_has_no_leak_and_says_why(self) -> None:
        sources = source_clips(self.tasks)
        found = SCORES["leak_ratio"](plain_row(sources, sources), basis(self.tasks))
        assert measured(found).value is None and measured(found).reason == "undefined: no part moved"
        assert value(SCORES["locality_msd"](plain_row(sources, sources), basis(self.tasks)), "part=legs") == 0.0

    def test_equal_angles_everywhere_leak_one(self) -> None:
        sources = source_clips(self.tasks)
        outputs = sources
        for joint in range(21):
            outputs = [bent(clip, joint, 0.2) for clip in outputs]
        found = SCORES["leak_ratio"](plain_row(sources, outputs), basis(self.tasks))
        assert value(found) == pytest.approx(1.0, abs=1e-3)

    def test_lists_name_the_joints_that_moved(self) -> None:
        sources = source_clips(self.tasks)
        lifted = [clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + UP_M) for clip in sources]
        found = SCORES["joints_above_0.1"](plain_row(sources, lifted), basis(self.tasks))
        assert value(found, "part=arms") == 21.0
        assert "15 LeftHand" in measured(found, "part=arms").details
        msd = SCORES["locality_msd"](plain_row(sources, lifted), basis(self.tasks))
        plain = SCORES["locality_distance"](plain_row(sources, lifted), basis(self.tasks))
        assert value(msd, "part=legs") == pytest.approx(value(plain, "part=legs") ** 2, rel=1e-6)
        statures = plain_row(sources, lifted).motions.statures_m
        assert value(plain, "part=legs") == pytest.approx(float((1.0 / statures).mean()), rel=1e-2)


def test_prefix_error_is_the_distance_from_the_full_answer() -> None:
    long = [take.with_clip(random_clip(80, seed=i)) for i, take in enumerate(toy_takes(0))]
    tasks = short_tasks(TaskPool(long), 12, 0)
    by_id = {take.take_id: take for take in long}
    sources = [window(by_id[t.content_take_id].clip, t.start_frame, t.n_frames) for t in tasks]
    same = SCORES["prefix_error"](plain_row(sources, sources), basis(tasks))
    assert {m.slice for m in same.measurements} == {"frames=10", "frames=16", "frames=32"}
    assert value(same, "frames=32") == pytest.approx(0.0, abs=1e-3)
    raised = [
        clip if task.n_frames == 64 else clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + 0.1 * UP_M)
        for clip, task in zip(sources, tasks, strict=True)
    ]
    off = SCORES["prefix_error"](plain_row(sources, raised), basis(tasks))
    assert value(off, "frames=16") == pytest.approx(10.0, abs=1e-3)


def test_a_copy_of_the_source_reconstructs_it_and_a_lifted_one_is_off_by_the_lift() -> None:
    ref = reference()
    assert value(SCORES["reconstruction_position"](row(ref), ref)) == pytest.approx(0.0, abs=1e-4)
    assert value(SCORES["reconstruction_rotation"](row(ref), ref)) == pytest.approx(0.0, abs=1e-3)
    plain = row(ref)
    lifted = replace(plain.motions, root_xyz_m=plain.motions.root_xyz_m + np.array([0.0, 0.05, 0.0], dtype=np.float32))
    assert value(SCORES["reconstruction_position"](row(ref, outputs=lifted), ref)) == pytest.approx(5.0, abs=1e-3)


@pytest.mark.parametrize("name", ["paired_position", "paired_rotation", "paired_position_aligned"])
def test_the_true_answer_has_no_error_and_needs_to_be_known(name: str) -> None:
    ref = reference()
    assert value(SCORES[name](row(ref), ref)) == pytest.approx(0.0, abs=1e-3)
    with pytest.raises(BadInput, match="need true answers"):
        SCORES[name](row(ref), replace(ref, truth=None))


def test_where_a_motion_starts_on_the_floor_does_not_count() -> None:
    ref = reference()
    plain = row(ref)
    moved = replace(plain.motions, root_xyz_m=plain.motions.root_xyz_m + np.array([3.0, 0.0, -1.0], dtype=np.float32))
    assert value(SCORES["paired_position"](row(ref, outputs=moved), ref)) == pytest.approx(0.0, abs=1e-3)


def prediction_tasks_of_toys() -> tuple[Task, ...]:
    """One frame of every toy take."""
    return tuple(
        Task(f"s{i}", take.take_id, 20 + i, take.take_id, str(take.content), str(take.style), str(take.style), "run", 0,
             n_frames=1)
        for i, take in enumerate(toy_takes(0))
    )  # fmt: skip


class TestPrediction:
    tasks = prediction_tasks_of_toys()

    def true_frames(self) -> list[Clip]:
        by_id = {take.take_id: take for take in toy_takes(0)}
        return [crop(by_id[task.content_take_id].clip, task.start_frame, 1) for task in self.tasks]

    def test_the_true_frame_has_no_error(self) -> None:
        frames = self.true_frames()
        found = SCORES["next_frame_error"](plain_row(frames, frames), basis(self.tasks))
        assert value(found) == pytest.approx(0.0, abs=1e-6)
        assert set(measured(found).details) >= {"position", "rotation", "velocity"}

    def test_error_grows_with_the_fault(self) -> None:
        frames = self.true_frames()
        errors = [
            value(SCORES["next_frame_error"](plain_row(frames, [bent(f, 9, a) for f in frames]), basis(self.tasks)))
            for a in (0.05, 0.1, 0.4)
        ]
        assert 0.0 < errors[0] < errors[1] < errors[2]

    def test_longer_bones_are_found(self) -> None:
        frames = self.true_frames()
        skeleton = frames[0].skeleton
        longer = replace(skeleton, offsets_m=skeleton.offsets_m * 1.1)
        outputs = [Clip(longer, f.rotations_wxyz, f.root_xyz_m, 30.0) for f in frames]
        expected = 10.0 * float(skeleton.bone_lengths_m[1:].mean())
        found = SCORES["bone_length_loss"](plain_row(frames, outputs), basis(self.tasks))
        assert value(found) == pytest.approx(expected, rel=1e-3)

    def test_features_do_not_see_place_or_heading(self) -> None:
        clip = random_clip(10, seed=4)
        turn = quat.about_y(1.3)
        rotations = clip.rotations_wxyz.copy()
        rotations[:, 0] = quat.multiply(np.broadcast_to(turn, (10, 4)), rotations[:, 0])
        root = quat.rotate(np.broadcast_to(turn, (10, 4)), clip.root_xyz_m) + np.array([2.0, 0.0, 1.0])
        moved = clip.with_motion(rotations, root)
        both = [frame_features(crop(c, 4, 1), crop(c, 5, 1)) for c in (clip, moved)]
        np.testing.assert_allclose(both[0], both[1], atol=1e-9)


class TestInterpolation:
    def setting(self) -> tuple[Row, Reference]:
        """Ten groups whose style log odds rise evenly while the poses stay."""
        ref = reference()
        plain = row(ref)
        rows = np.repeat(np.arange(10), len(WEIGHTS))
        weights = np.tile(WEIGHTS, 10)
        motions = plain.motions.take(rows)
        tasks = [ref.tasks[i] for i in range(10)]
        style = np.stack([[i, (i + 1) % 3] for i in plain.source_styles[:10]])
        starts, targets = style[:, 0].repeat(5), style[:, 1].repeat(5)
        log_probabilities = np.full((2, 50, 3), -9.0, dtype=np.float32)
        for n in range(50):
            log_probabilities[:, n, starts[n]] = 5.0 * (1.0 - weights[n]) - 5.0
            log_probabilities[:, n, targets[n]] = 5.0 * weights[n] - 5.0
        embedding = replace(
            plain.embedding.take(rows), style_log_probabilities=log_probabilities,
        )  # fmt: skip
        made = replace(
            plain, motions=motions, source=motions, embedding=embedding, contents=plain.contents[rows],
            styles=targets, source_styles=plain.source_styles[:10],
        )  # fmt: skip
        clusters = np.array([task.content_take_id for task in tasks])
        return made, replace(ref, tasks=tasks, counts=cluster_counts(clusters, 20, seed=0))

    def test_even_odds_are_monotone_and_right_at_both_ends(self) -> None:
        made, ref = self.setting()
        assert value(SCORES["monotonicity"](made, ref)) == pytest.approx(1.0)
        assert value(SCORES["end_recognition"](made, ref)) == pytest.approx(100.0)
        assert value(SCORES["middle_content"](made, ref)) == pytest.approx(100.0)

    def test_equal_outputs_have_no_evenness(self) -> None:
        made, ref = self.setting()
        found = measured(SCORES["evenness"](made, ref))
        assert found.value is None and "same at all weights" in str(found.reason)


class TestLong:
    task = Task("s0", "long", 0, "b", "joined", "old", "angry", "walk", 0, n_frames=0,
                segments=((0, "run"), (100, "walk"), (300, "run")))  # fmt: skip

    def test_segments_lie_inside_pieces_and_clear_of_blends(self) -> None:
        found = segments_of(self.task, 400)
        assert [(s.start_frame, s.content) for s in found] == [
            (0, "run"), (110, "walk"), (174, "walk"), (310, "run"),
        ]  # fmt: skip
        assert all(s.n_frames == 64 for s in found)

    def test_a_copy_jerks_at_joins_as_its_source_does(self) -> None:
        ref = reference()
        clip = random_clip(400, seed=5)
        pack = pack_of([Take(clip, "long", content="joined", style="old"), *toy_takes(0)])
        samples = samples_of(PROTOCOLS["stylebench-transfer@1/long"], [self.task], pack)
        whole = Motions.of([Take(clip, content="joined", style="angry")])
        motions = cut_motions(whole, [self.task], samples)
        assert motions.contents.tolist() == ["run", "walk", "walk", "run"]
        plain = row(ref)
        shared = {f.name: getattr(plain, f.name) for f in fields(plain)} | {"motions": motions, "source": motions}
        made = SegmentRow(**shared, uncut=whole, uncut_source=whole, sequences=(self.task,))
        short = replace(ref, tasks=samples, counts=np.ones((20, 4), dtype=np.int32))
        assert value(SCORES["join_jerk_ratio"](made, short)) == pytest.approx(1.0)


def test_trials_are_draws_without_repeats_from_a_larger_pool_else_of_clusters() -> None:
    protocol = PROTOCOLS["park2021@1/table2"]
    clusters = np.array([f"c{i // 4}" for i in range(3000)])
    drawn = trials_of(protocol, "standard", clusters)
    assert len(drawn) == 10 and all(len(np.unique(d)) == len(d) == 2500 for d in drawn)
    assert not np.array_equal(drawn[0], drawn[1])
    boot = trials_of(protocol, "quick", clusters[:1000])
    assert len(boot) == 3 and all(len(d) == 1000 for d in boot)
    counts = np.bincount(boot[0], minlength=1000).reshape(-1, 4)
    assert (counts == counts[:, :1]).all() and counts.max() > 1
    assert trials_of(PROTOCOLS["stylebench-transfer@1"], "quick", clusters) == ()


def test_papers_frechet_is_a_mean_over_trials_and_says_what_it_drew() -> None:
    ref = reference()
    trials = (np.arange(60), np.arange(30, 90))
    found = measured(SCORES["fmd[stgcn]"](row(ref), replace(ref, trials=trials, floors={"fmd[stgcn]": 0.5})))
    assert found.details["pool"] == 90.0 and found.details["trials"] == 2.0 and found.details["trial_sd"] > 0.0
    assert found.floor == 0.5 and found.n == 60
    halves = [value(SCORES["fmd[stgcn]"](row(ref), replace(ref, trials=(trial,), floors={}))) for trial in trials]
    assert found.value == pytest.approx(np.mean(halves))


def test_the_right_label_among_the_likeliest_three() -> None:
    ref = reference()
    assert value(SCORES["sra_top3"](row(ref, style_right=0.0), ref)) == pytest.approx(100.0)
    assert value(SCORES["cra_top3"](row(ref, content_right=0.0), ref)) == pytest.approx(100.0)
