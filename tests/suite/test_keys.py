from __future__ import annotations

from pathlib import Path

from bench.adapters.anchors import CopyContent, CopyStyle
from bench.adapters.loading import find_adapter, source_from_option
from bench.suite import keys

ADAPTER = """
from bench.adapters.base import Adapter
from beside import SHIFT

class Mine(Adapter):
    name = "mine"

    def transfer(self, content, style, *, rng):
        return content.clip
"""


def digest_of_file(path: Path) -> str:
    return keys.adapter_digest(find_adapter(source_from_option(str(path))))


def test_digest_follows_the_file_and_what_lies_beside_it(tmp_path: Path) -> None:
    adapter, beside = tmp_path / "mine.py", tmp_path / "beside.py"
    adapter.write_text(ADAPTER)
    beside.write_text("SHIFT = 1\n")
    first = digest_of_file(adapter)
    assert digest_of_file(adapter) == first
    beside.write_text("SHIFT = 2\n")
    second = digest_of_file(adapter)
    assert second != first
    adapter.write_text(ADAPTER + "\n# changed\n")
    assert digest_of_file(adapter) != second


def test_two_classes_of_one_file_differ() -> None:
    assert keys.adapter_digest(CopyContent) != keys.adapter_digest(CopyStyle)


def test_every_part_of_a_key_counts() -> None:
    base = ("motions", "reference", True, "metric", 1)
    others = ("other", "other", False, "other", 2)
    variants = [(*base[:i], other, *base[i + 1 :]) for i, other in enumerate(others)]
    found = {keys.score_key(*args) for args in [base, *variants]}  # type: ignore[arg-type]
    assert len(found) == 6
