"""Agreement of orders on cases worked by hand, stored numbers, and the page made of them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from matplotlib.text import Text

from reports.records import BadRecord
from reports.trust import (
    Curve,
    JudgedNumber,
    SessionNumbers,
    SplitNumber,
    TrustData,
    TrustJudge,
    TrustRow,
    agreements,
    judge_agreements,
    merged,
    order_agreement,
    read_trust,
    stored_judge_agreements,
    write_trust,
)
from reports.trust_figure import sample_size_figure
from reports.trust_page import FIGURE, SOURCES, at_infinity, check_page, render_page, verdicts, write_page

FIRST = {"a": (10.0, 12.0), "b": (20.0, 19.0), "c": (30.0, 33.0), "d": (40.0, 41.0), "e": (50.0, 30.0)}
"""Means 11, 19.5, 31.5, 40.5, 40; the seeds turn c and e, d and e."""
SECOND = {"a": (15.0, 15.0), "b": (12.0, 12.0), "c": (30.0, 30.0), "d": (44.0, 44.0), "e": (41.0, 41.0)}
"""Against the first family's means only a and b are turned."""


def number(metric: str, name: str, spread: float = 2.0) -> JudgedNumber:
    mean = float(np.mean(FIRST[name]))
    return JudgedNumber(
        metric=metric, slice="different_content", unit="%", better="higher", first=FIRST[name], second=SECOND[name],
        low=mean - spread, high=mean + spread,
    )  # fmt: skip


def row(name: str, spread: float = 2.0) -> TrustRow:
    metrics = ("joint_recognition", "conditional_kid", "cra", "sra")
    splits = [
        SplitNumber(source=source, metric=metric, value=FIRST[name][place], low=1.0, high=2.0, n=40 + place)
        for metric in metrics
        for place, source in enumerate(SOURCES)
    ]
    facts = SessionNumbers(n=80, session_right=90.0, within=70.0, within_second=71.0, chance=50.0, same_session=60.0,
                           other_session=40.0, n_same=30)  # fmt: skip
    return TrustRow(
        method=name, title=f"row {name}", kind="anchor", seed=0, motions_digest="m",
        numbers=tuple(number(metric, name, spread) for metric in metrics), splits=tuple(splits), sessions=facts,
    )  # fmt: skip


def curve(method: str, metric: str) -> Curve:
    sizes = (100, 200, 400, 1000)
    return Curve(method=method, title=f"row {method}", metric=metric, n=sizes,
                 mean=tuple(3.0 + 50.0 / n for n in sizes), sd=(0.1,) * 4)  # fmt: skip


def trust_data(names: str = "abcde", spread: float = 2.0) -> TrustData:
    judges = {
        family: tuple(
            TrustJudge(id=f"{family}-{target}/{seed}", digest=f"{family}{target}{seed}", target=target, accuracy=97.0,
                       chance=14.3, within_session=99.0, within_session_chance=43.0, unseen_actors=None)
            for target in ("content", "style") for seed in (0, 1)
        )
        for family in ("stgcn", "temporal")
    }  # fmt: skip
    curves = tuple(curve(m, k) for m in ("floor", "a") for k in ("fmd[stgcn-content]", "kid[stgcn-content]"))
    return TrustData(
        dataset="toy@1", dataset_digest="d", protocol="stylebench-transfer@1", profile="quick", n=100,
        tasks_digest="t", judges_digest="j", second_digest="s", neutral_style="plain", draws=5,
        sessions={"one": ("plain", "sad"), "two": ("happy",)}, judges=judges["stgcn"], second=judges["temporal"],
        rows=tuple(row(name, spread) for name in names), curves=curves,
    )  # fmt: skip


def test_tau_of_cases_worked_by_hand() -> None:
    # 10 pairs of 5 rows, one turned: (9 - 1) / 10
    assert order_agreement([1, 2, 3, 4, 5], [2, 1, 3, 4, 5]) == pytest.approx(0.8)
    assert order_agreement([1, 2, 3], [3, 2, 1]) == -1.0
    # tau-b: two pairs agree, none disagree, one is tied in the first list: 2 / sqrt(2 * 3)
    assert order_agreement([1, 1, 2], [1, 2, 3]) == pytest.approx(2.0 / np.sqrt(6.0))
    assert order_agreement([1, 2, np.nan, 3], [1, 2, 0, 3]) == 1.0
    assert np.isnan(order_agreement([1, 2], [1, 2])) and np.isnan(order_agreement([1, 1, 1], [1, 2, 3]))


def test_agreement_of_seeds_and_families() -> None:
    found = {agreement.metric: agreement for agreement in agreements(trust_data())}["joint_recognition"]
    assert found.n_rows == 5
    # of 10 pairs the seeds turn (c, e) and (d, e)
    assert found.seeds == found.seeds_least == pytest.approx(0.6)
    assert found.second_seeds == pytest.approx(1.0)
    # the families turn (a, b) alone
    assert found.families == pytest.approx(0.8)
    [turned] = found.turned
    assert turned.titles == ("row a", "row b") and turned.first == (11.0, 19.5) and turned.second == (15.0, 12.0)
    assert turned.separable
    [overlapping] = agreements(trust_data(spread=6.0))[0].turned
    assert not overlapping.separable


def test_agreement_of_single_judges() -> None:
    found = judge_agreements(trust_data())
    assert set(found) == {f"{f}-{t}/{s}" for f in ("stgcn", "temporal") for t in ("content", "style") for s in (0, 1)}
    # seed 0 (10, 20, 30, 40, 50) against the second family (15, 12, 30, 44, 41): (a, b) and (d, e) are turned
    assert found["stgcn-content/0"] == pytest.approx(0.6)
    assert found["temporal-style/1"] == pytest.approx(0.8)


def test_seeds_of_a_method_are_averaged_and_undefined_values_left_out() -> None:
    data = trust_data("abc")
    again = data.rows[0].model_copy(
        update={"seed": 1, "numbers": (data.rows[0].numbers[0].model_copy(update={"first": (30.0, 32.0)}),)}
    )
    undefined = row("d").model_copy(update={"numbers": (number("joint_recognition", "d").model_copy(
        update={"first": (), "second": ()}),)})  # fmt: skip
    data = data.model_copy(update={"rows": (*data.rows, again, undefined)})
    values = data.values("joint_recognition", "first")
    assert values.shape == (4, 2) and values[0].tolist() == [20.0, 22.0] and np.isnan(values[3]).all()
    assert agreements(data)[0].n_rows == 3


def test_stored_rows_stay_beside_new_ones() -> None:
    both = merged(trust_data("abc"), trust_data("cde", spread=6.0))
    assert [one.method for one in both.rows] == list("abcde")
    assert both.rows[2].numbers[0].low == 31.5 - 6.0
    assert len(both.curves) == 4
    other = trust_data("de").model_copy(update={"judges_digest": "another"})
    with pytest.raises(BadRecord, match=r"measured under another protocol, data or judges \(j\)"):
        merged(trust_data("abc"), other)


def test_what_is_written_is_read(tmp_path: Path) -> None:
    path = write_trust(tmp_path, trust_data())
    assert path.name == "toy@1.json" and read_trust(tmp_path) == {"toy@1": trust_data()}
    assert stored_judge_agreements(tmp_path, "toy@1")["stgcncontent0"] == pytest.approx(0.6)
    assert stored_judge_agreements(tmp_path, "other@1") == {} == stored_judge_agreements(tmp_path / "none", "toy@1")
    path.write_text('{"dataset": "toy@1"}')
    with pytest.raises(BadRecord, match="not measured by `stylebench trust`"):
        read_trust(tmp_path)


def test_page_says_what_was_measured_and_is_checked(tmp_path: Path) -> None:
    folder, page = tmp_path / "numbers", tmp_path / "docs" / "trust.md"
    with pytest.raises(BadRecord, match="nothing was measured yet"):
        render_page(folder)
    write_trust(folder, trust_data())
    assert "missing" in check_page(page, folder)
    write_page(folder, page)
    assert check_page(page, folder) == "" and page.with_name(FIGURE).stat().st_size > 10_000
    text = page.read_text()
    assert "**toy@1, joint recognition**: between judge seeds 0.60 (least 0.60), between families 0.80, over 5" in text
    assert "**under 0.9**" in text and "row a and row b (11.0 / 19.5 against 15.0 / 12.0)" in text
    assert "- one: plain, sad" in text and "| row e |" in text and "(40 samples) and the others\n(41)" in text
    page.write_text(text.replace("0.60", "0.99"))
    assert "differs from the stored numbers" in check_page(page, folder)


def test_verdict_says_whether_turned_rows_could_be_told_apart() -> None:
    assert "1 of 10 pairs of rows stand the other way round" in verdicts(trust_data())[0]
    assert "none of them can be told apart by the tasks either" in verdicts(trust_data(spread=6.0))[0]
    assert "reaches 0.9. No two rows change places." in verdicts(trust_data("bcd"))[0]


def test_page_without_sessions_and_curves(tmp_path: Path) -> None:
    write_trust(tmp_path, trust_data().model_copy(update={"sessions": {}, "curves": ()}))
    page = tmp_path / "trust.md"
    write_page(tmp_path, page)
    assert "No sessions to mistake for styles" in page.read_text() and not page.with_name(FIGURE).exists()


def test_line_through_one_over_n_meets_its_intercept() -> None:
    one = curve("a", "fmd[stgcn-content]")
    assert at_infinity(one.n, one.mean) == pytest.approx(3.0)


def test_figure_shows_every_curve_and_nothing_is_cut_off() -> None:
    figure = sample_size_figure([trust_data(), trust_data()])
    assert len(figure.axes) == 2
    assert {text.get_text() for text in figure.legends[0].get_texts()} == {"row floor", "row a"}
    figure.draw_without_rendering()
    width, height = figure.bbox.width, figure.bbox.height
    for text in figure.findobj(Text):
        if isinstance(text, Text) and text.get_visible() and any(letter.isalpha() for letter in text.get_text()):
            box = text.get_window_extent()
            assert box.x0 >= -1 and box.y0 >= -1 and box.x1 <= width + 1 and box.y1 <= height + 1, text.get_text()
    with pytest.raises(BadRecord, match="no curve"):
        sample_size_figure([])


def test_the_page_is_what_the_stored_numbers_give() -> None:
    root = Path(__file__).resolve().parents[2]
    assert check_page(root / "docs" / "trust.md", root / "reports" / "published_trust") == ""
    stored = read_trust(root / "reports" / "published_trust")
    assert {"procedural@1", "bandai-namco@1"} <= set(stored)
    assert stored["bandai-namco@1"].sessions and all(data.curves for data in stored.values())


def test_a_low_agreement_names_the_row_it_is_owed_to() -> None:
    found = {agreement.metric: agreement for agreement in agreements(trust_data())}["joint_recognition"]
    # seeds turn (c, e) and (d, e); families turn (a, b)
    assert found.seeds_without.title == "row e" and found.seeds_without.tau == pytest.approx(1.0)
    assert found.families_without.title in ("row a", "row b") and found.families_without.tau == pytest.approx(1.0)
    assert "Without row e, by seed 50.0 / 30.0, seeds agree by 1.00." in verdicts(trust_data())[0]
