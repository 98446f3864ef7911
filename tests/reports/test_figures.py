from __future__ import annotations

from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure
from matplotlib.image import imread
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from reports.curves import TrainingCurves, loss_figure
from reports.figures import interval_bars, recognition_scatter, save_figure
from reports.puzzle_figures import attention_figure, part_change_figure
from reports.records import BadRecord
from reports.tables import Table, tables_of_run
from tests.reports.factory import ANCHORS, METHODS, FakeMethod, FakeTasks, write_run

SMALL = FakeTasks(n=100, n_clusters=25)
DOLLARS = FakeMethod("dollars", "$x_1$ & <b>", "method", 66.0, 64.0, trained_on="fit part")
LONG = FakeMethod("long", "A title that goes on and on without any end in sight", "method", 30.0, 31.0)


@pytest.fixture(scope="module")
def table(tmp_path_factory: pytest.TempPathFactory) -> Table:
    [found] = tables_of_run(write_run(tmp_path_factory.mktemp("run"), (*ANCHORS, *METHODS, DOLLARS, LONG), SMALL))
    return found


@pytest.fixture(scope="module")
def scatter(table: Table) -> Figure:
    return recognition_scatter(table)


@pytest.fixture(scope="module")
def bars(table: Table) -> Figure:
    return interval_bars(table)


def extents(texts: list[Text]) -> list[Bbox]:
    # The words alone: an annotation's own extent holds its line too.
    return [Text.get_window_extent(text) for text in texts]


def test_labels_cover_neither_each_other_nor_leave_the_axes(scatter: Figure) -> None:
    scatter.draw_without_rendering()
    labels = [text for text in scatter.axes[0].texts if isinstance(text, Annotation)]
    assert len(labels) == len(ANCHORS) + len(METHODS) - 1 + 2
    boxes = extents([*labels])
    assert not [pair for pair in combinations(range(len(boxes)), 2) if boxes[pair[0]].overlaps(boxes[pair[1]])]
    frame = scatter.axes[0].get_window_extent()
    assert all(frame.x0 <= box.x0 and box.x1 <= frame.x1 for box in boxes)


@pytest.mark.parametrize("name", ["scatter", "bars"])
def test_nothing_is_cut_off(name: str, request: pytest.FixtureRequest) -> None:
    figure: Figure = request.getfixturevalue(name)
    figure.draw_without_rendering()
    drawn = [text for text in figure.findobj(Text) if isinstance(text, Text) and text.get_visible()]
    # Axes keep numbered ticks beyond their limits, which are not drawn.
    words = [text for text in drawn if any(letter.isalpha() for letter in text.get_text())]
    assert any("Judges (canonical): stgcn-content" in text.get_text() for text in words)
    whole = figure.bbox
    for text, box in zip(words, extents(words), strict=True):
        inside = whole.x0 <= box.x0 + 1 and box.x1 <= whole.x1 + 1 and whole.y0 <= box.y0 + 1 and box.y1 <= whole.y1 + 1
        assert inside, text.get_text()


def test_names_are_drawn_as_they_are_and_shortened(bars: Figure) -> None:
    ticks = [text.get_text() for text in bars.axes[0].get_yticklabels()]
    assert any(tick.startswith("$x_1$ & <b>") for tick in ticks)
    assert any("…" in tick for tick in ticks) and max(map(len, ticks)) < 42


def test_bars_stand_in_the_order_of_the_table_and_show_the_floor(table: Table) -> None:
    figure = interval_bars(table, "conditional_kid")
    ticks = [text.get_text() for text in figure.axes[0].get_yticklabels()]
    assert [tick.split("  #")[0] for tick in ticks][:3] == [row.title for row in table.rows][:3]
    legend = figure.axes[0].get_legend()
    assert legend is not None
    assert any("floor: real against real" in text.get_text() for text in legend.get_texts())


@pytest.mark.parametrize("suffix", ["png", "pdf", "svg"])
def test_the_same_table_gives_the_same_bytes_without_a_time(table: Table, tmp_path: Path, suffix: str) -> None:
    paths = [tmp_path / f"{number}.{suffix}" for number in range(2)]
    for path in paths:
        save_figure(interval_bars(table), path)
    first, second = (path.read_bytes() for path in paths)
    assert first == second and len(first) > 5000
    assert b"CreationDate" not in first and b"dc:date" not in first and b"Software" not in first


def test_png_is_a_picture_of_the_size_promised(scatter: Figure, tmp_path: Path) -> None:
    save_figure(scatter, tmp_path / "scatter.png")
    pixels = imread(tmp_path / "scatter.png")
    assert pixels.shape[:2] == tuple(np.round(scatter.get_size_inches() * 150.0).astype(int)[::-1])
    assert len(np.unique(pixels[..., 0])) > 50


def test_other_suffixes_and_empty_tables_are_refused(table: Table, bars: Figure, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"saved as \.png, \.pdf or \.svg, not \.bmp"):
        save_figure(bars, tmp_path / "bars.bmp")
    with pytest.raises(BadRecord, match="no column nothing"):
        interval_bars(table, "nothing")
    [unfinished] = tables_of_run(write_run(tmp_path / "run", METHODS[-1:], SMALL))
    with pytest.raises(BadRecord, match="no finished row"):
        interval_bars(unfinished)
    with pytest.raises(BadRecord, match="no column cra"):
        recognition_scatter(unfinished)


def test_logarithmic_axes_are_labelled_with_plain_numbers() -> None:
    values = np.geomspace(0.001, 100.0, 20)[:, None]
    figure = loss_figure("losses", [TrainingCurves("seed 0", ("loss",), np.arange(20), values)])
    figure.canvas.draw()
    labels = [label.get_text() for label in figure.axes[0].get_yticklabels()]
    assert "0.01" in labels and "10" in labels and not any("$" in label for label in labels)


def test_attention_figure_has_a_panel_a_part_and_says_what_even_attention_is() -> None:
    even = np.full((30, 60), 1 / 60)
    figure = attention_figure(
        {"walk as run": {"spine": even, "left_arm": even}, "run as walk": {"spine": even, "left_arm": even}}, 30.0
    )
    images = [image for axes in figure.axes for image in axes.images]
    assert len(images) == 4
    for image in images:
        np.testing.assert_allclose(np.asarray(image.get_array()), 1.0)
        assert list(image.get_extent()) == [0.0, 2.0, 1.0, 0.0]
    words = {text.get_text() for text in figure.findobj(Text)}
    assert {"spine", "left arm", "attention (1: spread evenly)"} <= words


def test_part_change_figure_writes_each_number_where_it_belongs() -> None:
    changes = {"by part": {"legs": {"legs": 8.0, "arms": 0.5}, "arms": {"legs": 0.25, "arms": 6.0}}}
    [panel] = part_change_figure(changes).axes
    written = {text.get_text(): text.get_position() for text in panel.texts}
    assert written == {"8.0": (0, 0), "0.5": (1, 0), "0.2": (0, 1), "6.0": (1, 1)}
    assert [label.get_text() for label in panel.get_yticklabels()] == ["legs", "arms"]
