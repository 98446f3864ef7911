"""The page in a real browser, from disk, without a network: it plays, scrubs, sorts, follows links, runs no names."""

from __future__ import annotations

import importlib.util
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bench.suite.page import build_page
from bench.suite.store import Store
from tests.suite.tiny import METHODS, tiny_run, tiny_tables

pytestmark = pytest.mark.slow
CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")
MARKUP = "<script>window.hacked = 1</script>"
ADAPTER = f"""
from bench.adapters.base import Adapter

class Mine(Adapter):
    name = "mine"
    title = {MARKUP!r}

    def transfer(self, content, style, *, rng):
        return content.clip
"""


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("page")
    adapter = folder / "mine.py"
    adapter.write_text(ADAPTER)
    tiny_run(folder / "out", folder / "store", methods=METHODS, adapter_files=(str(adapter),))
    with tiny_tables():
        return build_page(folder / "out", Store(folder / "store"))


@pytest.fixture(scope="module")
def page(page_file: Path) -> Iterator[Any]:
    if importlib.util.find_spec("playwright") is None:
        pytest.skip("playwright is not installed: no browser test")
    if CHROMIUM is None:
        pytest.skip("chromium is not installed: no browser test")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        shown: Any = browser.new_context(offline=True).new_page()
        shown.set_default_timeout(120_000)  # a busy machine draws slowly
        shown.heard, shown.asked = [], []
        shown.on("console", lambda message: shown.heard.append(message.text))
        shown.on("pageerror", lambda error: shown.heard.append(str(error)))
        shown.on("request", lambda request: shown.asked.append(request.url))
        shown.goto(page_file.as_uri())
        wait_until_said(shown, r"Frame 1 of")
        yield shown
        browser.close()


def wait_until_said(page: Any, pattern: str) -> None:
    """Polled from here: the page forbids the evaluation of strings, which is how a browser would wait."""
    from playwright.sync_api import expect

    expect(page.locator("[data-part=said]")).to_have_text(re.compile(pattern), timeout=120_000)


def frame(page: Any) -> int:
    return int(page.locator("[data-part=frame]").input_value())


def test_no_errors_and_no_request_leaves_the_page(page: Any) -> None:
    assert page.heard == []
    assert all(url.startswith(("file:", "data:")) for url in page.asked)


def test_names_with_markup_are_text(page: Any) -> None:
    assert page.evaluate("window.hacked") is None
    assert MARKUP in page.locator("table.stylebench").first.inner_text()
    assert MARKUP in page.locator("[data-part=rows]").inner_text()


def test_it_plays_and_scrubs(page: Any) -> None:
    page.locator("[data-part=play]").click()
    wait_until_said(page, r"Frame ([4-9]|[1-9]\d) of")
    page.locator("[data-part=play]").click()
    page.locator("[data-part=frame]").evaluate("e => { e.value = 40; e.dispatchEvent(new Event('input')); }")
    assert "Frame 41 of 64" in page.locator("[data-part=said]").inner_text()
    before = page.locator("canvas").evaluate("c => c.toDataURL()")
    page.locator("canvas").focus()
    page.keyboard.press("ArrowRight")
    assert frame(page) == 41
    assert page.locator("canvas").evaluate("c => c.toDataURL()") != before


def test_a_deep_link_opens_its_sample(page: Any, page_file: Path) -> None:
    page.goto("about:blank")
    page.goto(f"{page_file.as_uri()}#sample=s0007&frame=12&table=stylebench-transfer-tiny@1-smoke&rows=content,mine")
    wait_until_said(page, r"^s0007")
    assert frame(page) == 12
    assert page.locator("[data-part=rows] input:checked").count() == 2


def test_tables_sort(page: Any) -> None:
    header = page.locator("table.stylebench").first.locator("thead th").nth(1)
    header.locator("button").click()
    rows = page.locator("table.stylebench").first.locator("tbody").last.locator("tr:not(.section) td:nth-child(2)")
    names = rows.all_inner_texts()
    assert header.get_attribute("aria-sort") == "ascending"
    assert names == sorted(names, key=str.lower)


def test_plots_are_drawn(page: Any) -> None:
    place = page.locator("#pareto .plot").first
    place.scroll_into_view_if_needed()
    place.locator(".main-svg").first.wait_for()
