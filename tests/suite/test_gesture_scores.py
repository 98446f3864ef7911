from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.arrays import FloatArray
from bench.datasets.joined import joined_take
from bench.datasets.pack import Pack, write_pack
from bench.datasets.take import Take
from bench.errors import BadInput
from bench.metrics.gesture import (
    content_error_components,
    hand_trajectories,
    style_error_components,
    summarise,
)
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.kinematics import world_positions
from bench.protocols.base import Task
from bench.suite.motions import Motions
from bench.suite.scores.base import Basis, PlainRow, Scored
from bench.suite.scores.gesture import FORMS, gesture_error, gesture_error_to_truth, hand_error
from reports.bootstrap import cluster_counts
from reports.records import Measurement
from tests.motion.factory import person, random_clip

PAIRS = ((0, 0), (1, 1), (0, 1), (1, 0))
"""Scenarios on the content and on the style side of each task."""


def sequence(scenario: int, style: str) -> Take:
    """Pieces of different length in each scenario and style."""
    n_frames = 90 + 20 * scenario + (15 if style == "old" else 0)
    pieces = [
        Take(random_clip(n_frames, seed=10 * scenario + i + 50 * (style == "old")), f"{scenario}{style}{i}", "toy")
        for i in range(3)
    ]
    labelled = [replace(piece, content="wave", style=style) for piece in pieces]
    return joined_take(f"scenario-0{scenario}/{style}", labelled, person(), 60.0, content=f"scenario-0{scenario}")


CONTENTS, STYLES = ([sequence(i, style) for i in range(2)] for style in ("neutral", "old"))


def task(content: int, style: int) -> Task:
    return Task(
        sample_id=f"{content}-{style}",
        content_take_id=CONTENTS[content].take_id,
        start_frame=0,
        style_take_id=STYLES[style].take_id,
        content=str(CONTENTS[content].content),
        source_style="neutral",
        target_style="old",
        reference_content=str(STYLES[style].content),
        seed=0,
        n_frames=0,
        group="slice:intra" if content == style else "slice:inter",
    )


@pytest.fixture(scope="module")
def basis(tmp_path_factory: pytest.TempPathFactory) -> Basis:
    folder = tmp_path_factory.mktemp("pack")
    write_pack(folder, [*CONTENTS, *STYLES])
    tasks = [task(*pair) for pair in PAIRS]
    counts = cluster_counts(np.array([task.content_take_id for task in tasks]), 50, seed=0)
    return Basis(tasks=tasks, content_labels=(), style_labels=(), counts=counts, pack=Pack.open(folder))


def row_of(clips: list[Clip]) -> PlainRow:
    source = Motions.of([CONTENTS[content] for content, _ in PAIRS])
    return PlainRow(Motions.of([Take(clip, content="s", style="old") for clip in clips]), source)


COPY_CONTENT = row_of([CONTENTS[content].clip for content, _ in PAIRS])
COPY_STYLE = row_of([STYLES[style].clip for _, style in PAIRS])


def lifted(clip: Clip, angle_rad: float) -> Clip:
    """The left upper arm turned by a constant angle."""
    rotations = clip.rotations_wxyz.copy()
    rotations[:, 13] = quat.multiply(rotations[:, 13], quat.from_rotation_vector(np.array([0.0, 0.0, angle_rad])))
    return clip.with_motion(rotations, clip.root_xyz_m)


LIFTED = row_of([lifted(CONTENTS[content].clip, 0.5) for content, _ in PAIRS])


def found(scored: Scored, slice_name: str) -> Measurement:
    return next(m for m in scored.measurements if m.slice == slice_name)


def hands(clip: Clip) -> FloatArray:
    return hand_trajectories(world_positions(clip))


@pytest.mark.parametrize("name", [name for name in FORMS if name.startswith("content")])
def test_copy_content_has_no_content_error(name: str, basis: Basis) -> None:
    scored = hand_error(name, COPY_CONTENT, basis)
    assert [m.value for m in scored.measurements] == [0.0, 0.0, 0.0]


@pytest.mark.parametrize("name", [name for name in FORMS if name.startswith("style")])
def test_the_whole_style_has_no_style_error_though_its_length_differs(name: str, basis: Basis) -> None:
    assert COPY_STYLE.motions.lengths.tolist() != COPY_STYLE.source.lengths.tolist()
    scored = hand_error(name, COPY_STYLE, basis)
    assert [m.value for m in scored.measurements] == [0.0, 0.0, 0.0]


def test_errors_are_those_of_the_metric(basis: Basis) -> None:
    stored = row_of([COPY_STYLE.motions.clip(i) for i in range(4)])
    errors = hand_error("content_error_worst_quarter", stored, basis).per_sample["content_error_worst_quarter"]
    for value, (content, style) in zip(errors, PAIRS, strict=True):
        components = content_error_components(hands(CONTENTS[content].clip), hands(STYLES[style].clip))
        assert value == pytest.approx(summarise(components).worst_quarter, abs=1e-5)
    errors = hand_error("style_error[1.07s]", COPY_CONTENT, basis).per_sample["style_error[1.07s]"]
    for value, (content, style) in zip(errors, PAIRS, strict=True):
        args = hands(STYLES[style].clip), hands(CONTENTS[content].clip), 60.0
        assert value == pytest.approx(style_error_components(*args, theta_s=1.07).mean(), abs=1e-5)


def test_the_world_frame_sees_where_the_body_stands_and_the_root_frame_does_not(basis: Basis) -> None:
    clips = [CONTENTS[content].clip for content, _ in PAIRS]
    up = np.array([0.0, 0.3, 0.0])
    moved = row_of([clip.with_motion(clip.rotations_wxyz, clip.root_xyz_m + up) for clip in clips])
    assert found(hand_error("content_error", moved, basis), "all").value == pytest.approx(0.0, abs=1e-6)
    both_hands = 0.3 * np.sqrt(2.0)
    assert found(hand_error("content_error[world]", moved, basis), "all").value == pytest.approx(both_hands, rel=0.02)


def test_error_grows_with_the_fault(basis: Basis) -> None:
    def value(angle_rad: float) -> float:
        row = row_of([lifted(CONTENTS[content].clip, angle_rad) for content, _ in PAIRS])
        return found(hand_error("content_error", row, basis), "all").value or 0.0

    assert 0.0 < value(0.1) < value(0.3) < value(0.6)


def test_the_sum_is_the_sum_and_names_its_parts(basis: Basis) -> None:
    scored = gesture_error(LIFTED, basis)
    for slice_name in ("all", "intra", "inter"):
        parts = [found(hand_error(name, LIFTED, basis), slice_name).value for name in ("content_error", "style_error")]
        measured = found(scored, slice_name)
        assert measured.value == pytest.approx(sum(value or 0.0 for value in parts))
        assert list(measured.details.values()) == pytest.approx(parts)


@pytest.mark.parametrize("name", list(FORMS))
def test_records_are_means_over_samples(name: str, basis: Basis) -> None:
    clips = [lifted(STYLES[style].clip, 0.5) for _, style in PAIRS]
    scored = hand_error(name, row_of(clips), basis)
    for slice_name, samples in (("all", slice(None)), ("intra", slice(2)), ("inter", slice(2, None))):
        value = found(scored, slice_name).value
        assert value and value == pytest.approx(scored.per_sample[name][samples].mean())


def test_slices_intervals_and_replicates(basis: Basis) -> None:
    scored = hand_error("style_error", COPY_CONTENT, basis)
    values = scored.per_sample["style_error"]
    assert [(m.slice, m.n) for m in scored.measurements] == [("all", 4), ("intra", 2), ("inter", 2)]
    assert found(scored, "intra").value == pytest.approx(values[:2].mean())
    assert found(scored, "inter").value == pytest.approx(values[2:].mean())
    assert set(scored.replicates) == {f"style_error|{name}" for name in ("all", "intra", "inter")}
    measured = found(scored, "all")
    assert measured.low is not None and measured.high is not None and measured.value is not None
    assert measured.low <= measured.value <= measured.high


@pytest.mark.parametrize(("pair", "name"), [((0, 0), "intra"), ((0, 1), "inter")])
def test_a_slice_without_tasks_is_left_out(pair: tuple[int, int], name: str, basis: Basis) -> None:
    one = replace(basis, tasks=[task(*pair)], counts=basis.counts[:, :1])
    row = PlainRow(Motions.of([CONTENTS[0]]), Motions.of([CONTENTS[0]]))
    scored = hand_error("style_error", row, one)
    assert [m.slice for m in scored.measurements] == ["all", name]


def test_intra_details_hold_the_error_against_the_other_sample(basis: Basis) -> None:
    content = found(hand_error("content_error", COPY_STYLE, basis), "intra")
    assert content.details["against_style_sample"] == 0.0
    style = found(hand_error("style_error", COPY_CONTENT, basis), "intra")
    assert style.details["against_content_sample"] == 0.0
    assert "against_content_sample" not in found(hand_error("style_error", COPY_CONTENT, basis), "inter").details


def test_details_say_which_time_warping_and_which_segments(basis: Basis) -> None:
    exact = found(hand_error("content_error", LIFTED, basis), "all").details
    fast = found(hand_error("content_error[fastdtw]", LIFTED, basis), "all").details
    assert exact["dtw_exact"] == 1.0 and "fastdtw_radius" not in exact
    assert (fast["dtw_exact"], fast["fastdtw_radius"]) == (0.0, 1.0) and fast["fastdtw_compiled"] in (0.0, 1.0)
    assert fast["worst"] >= fast["worst_quarter"] > 0.0
    style = found(hand_error("style_error", LIFTED, basis), "all").details
    assert (style["theta_s"], style["theta_frames"], style["mirror_style"], style["tail_covered"]) == (
        2.13, 128.0, 1.0, 1.0,
    )  # fmt: skip


def test_errors_to_the_truth(basis: Basis) -> None:
    known = replace(basis, truth=LIFTED.motions)
    scored = gesture_error_to_truth(LIFTED, known)
    assert found(scored, "all").details["style_error"] == 0.0
    assert found(scored, "all").value == found(hand_error("content_error", LIFTED, basis), "all").value
    copied = found(gesture_error_to_truth(COPY_CONTENT, known), "all")
    assert copied.value == copied.details["style_error"] > 0.1
    with pytest.raises(BadInput, match="need true answers"):
        gesture_error_to_truth(LIFTED, basis)


def test_rows_do_not_share_results(basis: Basis, tmp_path: Path) -> None:
    first = found(hand_error("content_error", LIFTED, basis), "all").value
    hand_error("content_error", COPY_STYLE, basis)
    assert found(hand_error("content_error", LIFTED, basis), "all").value == first
    write_pack(tmp_path, [*CONTENTS, *(replace(s, clip=CONTENTS[0].clip) for s in STYLES)])
    other = replace(basis, pack=Pack.open(tmp_path))
    assert found(hand_error("style_error", COPY_STYLE, other), "all").value != 0.0
