from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.datasets import procedural
from bench.datasets.take import Take
from bench.errors import BadFile
from bench.metrics import METRICS
from bench.motion.kinematics import world_positions
from bench.protocols.transfer import TRANSFER
from bench.suite.ladder import page
from bench.suite.ladder.climb import measured
from bench.suite.ladder.declared import BLIND_SPOTS, DECLARED, Claim
from bench.suite.ladder.rungs import LADDERS, Material
from bench.suite.ladder.verdict import Range, cells_of
from bench.suite.store import Store
from reports.ladder import Cell, Rung, read_rungs, write_rungs
from reports.records import BadRecord
from tests.motion.factory import random_clip

ROOT = Path(__file__).resolve().parents[2]
NUMBERS = ROOT / "reports" / "published" / "ladder"


def steps(values: Iterable[float], *, metric: str = "cra", ladder: str = "noise", sd: float = 0.1) -> list[Rung]:
    return [
        Rung("toy@1", 200, "judges", metric, 1, ladder, float(level), value, sd, sd)
        for level, value in enumerate(values)
    ]


def cell(values: Iterable[float], claim: Claim, **options: float | str) -> Cell:
    """The cell of one ladder beside another that moves the metric by 100."""
    rungs = [*steps(values, **options), *steps((0.0, 100.0), ladder="mirror", metric=str(options.get("metric", "cra")))]  # type: ignore[arg-type]
    [found, _] = cells_of(rungs, {str(options.get("metric", "cra")): {"noise": claim, "mirror": Claim.OPEN}})
    return found


@pytest.mark.parametrize(
    ("values", "observed"),
    [
        ((50.0, 60.0, 70.0), "up"),
        ((50.0, 40.0, 30.0), "down"),
        ((50.0, 50.5, 50.1), "flat"),
        ((50.0, 70.0, 50.1), "mixed"),
        ((50.0, 70.0, 60.0), "mixed"),
        ((50.0, 70.0, 69.0), "up"),
        ((50.0, 60.0, float("nan")), "up"),
        ((float("nan"), 60.0, 70.0), "undefined"),
    ],
)
def test_what_is_observed(values: tuple[float, ...], observed: str) -> None:
    assert cell(values, Claim.OPEN).observed == observed


def test_chance_is_no_movement() -> None:
    assert cell((50.0, 55.0), Claim.OPEN, sd=4.0).observed == "flat"
    assert cell((50.0, 55.0), Claim.OPEN, sd=float("nan")).observed == "up"


@pytest.mark.parametrize(
    ("values", "claim", "contradicts"),
    [
        ((50.0, 60.0), Claim.UP, False),
        ((50.0, 60.0), Claim.DOWN, True),
        ((50.0, 50.0), Claim.UP, True),
        ((50.0, 50.4), Claim.IGNORE, False),
        ((50.0, 51.0), Claim.IGNORE, True),
        ((50.0, 51.0, 50.0), Claim.IGNORE, True),
        ((50.0, 45.0), Claim.BLIND, False),
        ((50.0, 90.0), Claim.BLIND, False),
        ((50.0, 5.0), Claim.BLIND, False),
        ((50.0, -5.0), Claim.BLIND, True),
        ((50.0, 0.0), Claim.OPEN, False),
    ],
)
def test_what_contradicts_a_declaration(values: tuple[float, ...], claim: Claim, contradicts: bool) -> None:
    assert bool(cell(values, claim).contradiction) == contradicts


def test_worse_is_a_matter_of_the_metrics_direction() -> None:
    assert cell((50.0, 30.0), Claim.OPEN).worsening == pytest.approx(0.2)
    assert cell((50.0, 30.0), Claim.OPEN, metric="fmd[dae]").worsening < 0.0
    assert cell((2.0, 3.0), Claim.OPEN, metric="jerk_ratio").worsening > 0.0
    assert cell((0.5, 1.0), Claim.OPEN, metric="jerk_ratio").worsening < 0.0


def test_range_of_percentages_is_straight_and_of_others_logarithmic() -> None:
    straight = Range.of([*steps((50.0, 60.0)), *steps((50.0, 10.0), ladder="mirror")])
    assert [straight.share(change) for change in (40.0, -20.0, 1e-9)] == [1.0, -0.5, 0.0]
    # changes of 1, 3 and 1000: the knee is 3
    ladders = [*steps((1.0, 2.0, 4.0), metric="fmd[dae]"), *steps((1.0, 1001.0), metric="fmd[dae]", ladder="mirror")]
    curved = Range.of(ladders)
    assert curved.knee == 3.0 and curved.share(1000.0) == 1.0
    assert curved.share(-3.0) == pytest.approx(-np.log(2.0) / np.log(1.0 + 1000.0 / 3.0))
    assert Range.of(steps((3.0, 3.0 + 1e-12), metric="bone_drift")).share(1.0) == 0.0


def test_declarations_cover_the_transfer_track() -> None:
    assert set(DECLARED) == {*TRANSFER.metrics, *TRANSFER.truth_metrics}


def test_every_metric_must_ignore_where_a_motion_stands() -> None:
    assert all(claims["translation"] == claims["resampling"] == Claim.IGNORE for claims in DECLARED.values())
    turned = {metric for metric, claims in DECLARED.items() if claims["global yaw"] != Claim.IGNORE}
    assert turned == set(TRANSFER.truth_metrics)


def test_blind_spots_name_every_blind_cell_once() -> None:
    blind = sorted((m, name) for m, claims in DECLARED.items() for name, c in claims.items() if c == Claim.BLIND)
    per_spot = [
        [(m, name) for m in spot.metrics for name in spot.ladders if DECLARED[m][name] == Claim.BLIND]
        for spot in BLIND_SPOTS
    ]
    assert all(per_spot)
    assert sorted(named for found in per_spot for named in found) == blind


def test_blind_spots_stand_where_a_reader_of_a_table_meets_them() -> None:
    reading = (ROOT / "docs" / "reading-tables.md").read_text(encoding="utf-8")
    pages = {path.stem: path.read_text(encoding="utf-8") for path in (ROOT / "docs" / "metrics").glob("*.md")}
    for name in ("`fmd[dae]`", "frozen", "noise", "copies", "metrics/ladder.md"):
        assert name in reading
    for spot in BLIND_SPOTS:
        for metric in spot.metrics:
            assert "(ladder.md)" in pages[METRICS[metric].docs], f"{METRICS[metric].docs}.md names no blind spots"


class TestRungs:
    material = Material(
        samples=tuple(Take(random_clip(64, seed=n), content=f"c{n % 3}", style=f"s{n % 4}") for n in range(12)),
        others=tuple(Take(random_clip(64, seed=50 + n), content=f"c{n % 3}", style="other") for n in range(12)),
        lookups=tuple(Take(random_clip(64, seed=90 + n), content=f"c{n % 3}", style=f"s{n % 4}") for n in range(12)),
    )

    @pytest.mark.parametrize("name", LADDERS)
    def test_a_rung_is_the_same_every_time_and_not_what_it_was(self, name: str) -> None:
        ladder = LADDERS[name]
        assert list(ladder.levels) == sorted(ladder.levels) and min(ladder.levels) > 0.0
        first, again = (ladder.rung(self.material, ladder.levels[-1]) for _ in range(2))
        assert len(first) == 12
        changed = False
        for one, other, sample in zip(first, again, self.material.samples, strict=True):
            np.testing.assert_array_equal(one.clip.rotations_wxyz, other.clip.rotations_wxyz)
            changed |= (one.content, one.style) != (sample.content, sample.style)
            changed |= not np.allclose(world_positions(one.clip), world_positions(sample.clip), atol=1e-9)
        assert changed == (name != "resampling")

    def test_labels_are_handed_round_and_none_is_lost(self) -> None:
        whole = LADDERS["label shuffle"].rung(self.material, 1.0)
        labels = sorted((str(t.content), str(t.style)) for t in whole)
        assert labels == sorted((str(t.content), str(t.style)) for t in self.material.samples)
        half = LADDERS["label shuffle"].rung(self.material, 0.5)
        moved = [a.style != b.style for a, b in zip(half, self.material.samples, strict=True)]
        assert 0 < sum(moved) <= 6


def test_numbers_survive_their_file(tmp_path: Path) -> None:
    rungs = [*steps((1.0, 2.5)), replace(steps((float("nan"),))[0], ladder="mirror")]
    write_rungs(tmp_path / "toy.csv", rungs)
    found = read_rungs(tmp_path / "toy.csv")
    assert found[:2] == rungs[:2] and np.isnan(found[2].value)
    (tmp_path / "toy.csv").write_text("a,b\n1,2\n")
    with pytest.raises(BadRecord, match="no table of ladder numbers"):
        read_rungs(tmp_path / "toy.csv")
    with pytest.raises(BadFile, match="stylebench ladder --data procedural"):
        page.stored_rungs(tmp_path / "nothing")


def test_the_page_is_what_the_stored_numbers_give_and_nothing_contradicts() -> None:
    stored = page.stored_rungs(NUMBERS)
    assert {"procedural@1", "bandai-namco@1"} <= set(stored)
    assert page.contradictions(page.all_cells(stored)) == []
    assert page.difference(ROOT / "docs" / "metrics", stored) == ""
    for rungs in stored.values():
        assert {rung.metric for rung in rungs} == set(DECLARED)
        assert {rung.ladder for rung in rungs} == set(LADDERS)


def test_page_and_figure_are_written_and_a_change_is_noticed(tmp_path: Path) -> None:
    stored = page.stored_rungs(NUMBERS)
    assert "missing" in page.difference(tmp_path, stored)
    assert [path.name for path in page.write_page(tmp_path, stored)] == ["ladder.md", "ladder.png"]
    assert page.difference(tmp_path, stored) == ""
    (tmp_path / "ladder.md").write_text("old")
    assert "differs" in page.difference(tmp_path, stored)


@pytest.mark.slow
def test_a_small_ladder_contradicts_nothing(tmp_path: Path) -> None:
    """Measured here and now; the published numbers are from more windows."""
    chosen = ("noise", "foot slide", "joint swap", "blend", "label shuffle", "frozen frames", "translation")
    levels = {
        name: LADDERS[name].levels[-2:] if name == "frozen frames" else LADDERS[name].levels[-1:] for name in chosen
    }
    ladders = {name: replace(LADDERS[name], levels=levels[name]) for name in chosen}
    rungs = measured(procedural.load(None), 140, Store(tmp_path), lambda *_: None, ladders)
    assert {rung.metric for rung in rungs} == set(DECLARED)
    assert [f"{c.metric}: {c.ladder}: {c.contradiction}" for c in cells_of(rungs, DECLARED) if c.contradiction] == []
