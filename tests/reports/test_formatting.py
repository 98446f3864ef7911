from __future__ import annotations

import re

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reports.formatting import (
    count,
    duration,
    escape_latex,
    escape_markdown,
    footnote_mark,
    number,
    one_line,
    with_interval,
)


@pytest.mark.parametrize(
    ("value", "unit", "text"),
    [
        (84.666, "%", "84.7"),
        (100.0, "%", "100.0"),
        (-0.04, "%", "0.0"),
        (1.0312, "1", "1.03"),
        (0.0071, "1", "0.01"),
        (334.2, "1", "334"),
        (0.01234, "distance", "0.0123"),
        (0.00001, "distance", "0.0000"),
        (12.345, "distance", "12.3"),
        (4321.0, "distance", "4321"),
        (0.0, "distance", "0.00"),
    ],
)
def test_numbers_get_the_decimals_of_their_unit(value: float, unit: str, text: str) -> None:
    assert number(value, unit) == text


def test_interval_ends_have_the_decimals_of_the_value() -> None:
    assert with_interval(84.66, 82.94, 86.41, "%") == "84.7 [82.9, 86.4]"
    assert with_interval(0.01, 0.0086, 0.0114, "distance") == "0.0100 [0.0086, 0.0114]"
    assert with_interval(1e-7, -2.0, 2.0, "distance") == "0.00 [-2.00, 2.00]"
    assert with_interval(84.66, None, None, "%") == "84.7"


def test_footnote_marks_count_on_after_z() -> None:
    assert [footnote_mark(place) for place in (0, 1, 25, 26, 27, 701, 702)] == ["a", "b", "z", "aa", "ab", "zz", "aaa"]


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.04, "0.04 s"), (8.2, "8 s"), (89.0, "89 s"), (200.0, "3 min"), (9000.0, "2.5 h")]
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_counts() -> None:
    assert [count(value) for value in (311, 1500, 12_000, 4_300_000, 12_000_000)] == [
        "311",
        "1.5 k",
        "12 k",
        "4.3 M",
        "12 M",
    ]


@given(st.text())
def test_escaped_text_keeps_a_table_in_one_piece(text: str) -> None:
    markdown = escape_markdown(text)
    assert "\n" not in markdown and "|" not in markdown.replace(r"\|", "")
    assert "<" not in markdown.replace(r"\<", "")
    # Taking the escapes away gives the text back, white space folded.
    assert re.sub(r"\\(.)", r"\1", markdown) == one_line(text)


@given(st.text(alphabet="ab\\{}$&%#_~^<>| \n"))
def test_latex_is_balanced_and_holds_no_bare_command(text: str) -> None:
    latex = escape_latex(text)
    bare = latex.replace(r"\{", "").replace(r"\}", "")
    assert bare.count("{") == bare.count("}") and "\n" not in latex
    for character in "&%$#_":
        assert latex.count(character) == latex.count(f"\\{character}")
