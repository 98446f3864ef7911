from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from bench.protocols.transfer import TRANSFER
from bench.suite.embedding import Embedding
from bench.suite.scores import SCORES
from bench.suite.scores.base import Labelled, Reference, Scored
from reports.records import Measurement
from tests.suite.factory import N_TASKS, reference, row

SIDES = ("real", "floor")


@pytest.fixture(scope="module")
def ref() -> Reference:
    return reference()


def value(scored: Scored, slice_name: str) -> float:
    return float(found(scored, slice_name).value or 0.0)


def found(scored: Scored, slice_name: str) -> Measurement:
    [measurement] = [m for m in scored.measurements if m.slice == slice_name]
    return measurement


@pytest.mark.parametrize("name", (*TRANSFER.metrics, *TRANSFER.truth_metrics))
def test_every_score_of_a_perfect_row_is_complete(name: str, ref: Reference) -> None:
    scored = SCORES[name](row(ref), ref)
    assert scored.measurements
    for measurement in scored.measurements:
        assert measurement.name == name
        assert measurement.value is not None or measurement.reason
        if measurement.low is not None and measurement.value is not None and measurement.high is not None:
            assert measurement.low <= measurement.value <= measurement.high
    for draws in scored.replicates.values():
        assert draws.shape == (50,)
    for values in scored.per_sample.values():
        assert values.shape == (N_TASKS,)


def test_slices_cover_the_tasks(ref: Reference) -> None:
    assert ref.slices["all"].sum() == N_TASKS
    assert ref.slices["different_content"].sum() + ref.slices["same_content"].sum() == N_TASKS
    assert (
        sum(m.sum() for s, m in ref.slices.items() if s.startswith("style=")) == ref.slices["different_content"].sum()
    )


def test_joint_recognition_needs_both_on_the_same_sample(ref: Reference) -> None:
    """Content right on the first 60 %, style on the first 30 %: both on 30 %."""
    scored = SCORES["joint_recognition"](row(ref, content_right=0.6, style_right=0.3), ref)
    assert value(scored, "all") == pytest.approx(30.0)
    assert value(SCORES["cra"](row(ref, content_right=0.6), ref), "all") == pytest.approx(60.0)
    assert value(SCORES["sra"](row(ref, style_right=0.3), ref), "all") == pytest.approx(30.0)


def test_ratio_is_to_the_floor(ref: Reference) -> None:
    scored = SCORES["joint_recognition_ratio"](row(ref, style_right=0.5), ref)
    joint = SCORES["joint_recognition"](row(ref, style_right=0.5), ref)
    assert value(scored, "different_content") == pytest.approx(value(joint, "different_content") / 100.0)


def test_residue_counts_samples_left_in_the_source_style(ref: Reference) -> None:
    assert value(SCORES["source_style_residue"](row(ref, style_right=0.3), ref), "all") == pytest.approx(70.0)
    own = row(ref)
    same = replace(own, styles=own.source_styles)
    undefined = found(SCORES["source_style_residue"](same, ref), "different_content")
    assert undefined.value is None and "nothing was to be removed" in (undefined.reason or "")


@pytest.mark.parametrize("name", ["conditional_kid", "conditional_fmd"])
def test_conditional_distances_grow_when_either_label_is_wrong(name: str, ref: Reference) -> None:
    right = value(SCORES[name](row(ref), ref), "different_content")
    wrong_style = value(SCORES[name](row(ref, style_right=0.2), ref), "different_content")
    wrong_content = value(SCORES[name](row(ref, content_right=0.2), ref), "different_content")
    assert wrong_style > 3 * abs(right) and wrong_content > 3 * abs(right)


def test_distances_carry_floor_and_sizes(ref: Reference) -> None:
    measurement = found(SCORES["kid[stgcn-style]"](row(ref), ref), "all")
    assert measurement.floor is not None
    assert {"n_real": 120.0, "d": 8.0}.items() <= measurement.details.items()
    assert measurement.details["judge_spread"] == pytest.approx(np.std(measurement.judge_values, ddof=1))
    assert len(measurement.judge_values) == 2


def test_conditional_distance_of_too_few_real_windows_is_a_reason(ref: Reference) -> None:
    few = Labelled(ref.real.embedding.take(np.arange(12)), ref.real.contents[:12], ref.real.styles[:12])
    measurement = found(SCORES["conditional_kid"](row(ref), replace(ref, real=few)), "all")
    assert measurement.value is None
    assert measurement.reason == "no label has 20 real and 2 generated samples"


def test_frechet_of_too_few_samples_is_a_reason(ref: Reference) -> None:
    """With 64 features instead of 8, 90 samples are too few."""
    narrow = row(ref)
    wide_row = replace(narrow, embedding=_widened(narrow.embedding))
    sides = {side: replace(getattr(ref, side), embedding=_widened(getattr(ref, side).embedding)) for side in SIDES}
    measurement = found(SCORES["fmd[stgcn-content]"](wide_row, replace(ref, **sides)), "all")
    assert measurement.value is None
    assert measurement.reason == "n = 90 is below 2 d = 128: the number would be mostly bias"


def _widened(embedding: Embedding) -> Embedding:
    return replace(embedding, content_features=np.tile(embedding.content_features, (1, 1, 8)))


def test_sources_are_copies_unless_nothing_was_given(ref: Reference) -> None:
    assert value(SCORES["copied_share"](row(ref), ref), "all") == 100.0
    assert value(SCORES["copied_share"](row(ref, given=False), ref), "all") == 0.0


def test_jerk_ratio_is_to_real_motion_and_doubles_with_it(ref: Reference) -> None:
    once = value(SCORES["jerk_ratio"](row(ref), ref), "all")
    half = replace(ref, floor_jerk=np.full(N_TASKS, 25.0))
    assert value(SCORES["jerk_ratio"](row(half), half), "all") == pytest.approx(2 * once)


def test_frozen_outputs_have_no_time_correlation(ref: Reference) -> None:
    plain = row(ref)
    still = replace(
        plain.motions,
        rotations_wxyz=plain.motions.rotations_wxyz[::64].repeat(64, axis=0),
        root_xyz_m=plain.motions.root_xyz_m[::64].repeat(64, axis=0),
    )
    measurement = found(SCORES["time_correlation"](row(ref, outputs=still), ref), "all")
    assert measurement.value is None and measurement.reason == "undefined: the outputs do not move"
    assert value(SCORES["time_correlation"](plain, ref), "all") == pytest.approx(1.0)
    assert value(SCORES["bone_drift"](plain, ref), "all") == pytest.approx(0.0, abs=1e-6)
