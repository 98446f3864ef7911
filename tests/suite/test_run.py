from __future__ import annotations

from pathlib import Path

import pytest

from bench.errors import BadConfig, BadData, BadFile
from bench.suite.request import RunRequest, protocols_of, sources_of
from bench.suite.run import run

SILENT = lambda *_: None  # noqa: E731


def request(folder: Path, **changes: object) -> RunRequest:
    """A request that would write into ``folder``."""
    values: dict[str, object] = {"data": {"procedural": None}, "out": folder / "out", "store": folder / "store"}
    return RunRequest(**(values | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"methods": ("nope",)}, BadConfig, "unknown method 'nope'"),
        ({"tracks": ("nope",)}, BadConfig, "unknown track 'nope'"),
        ({"protocols": ("park2021@9",)}, BadConfig, "unknown protocol 'park2021@9'"),
        ({"profile": "nope"}, BadConfig, "unknown profile 'nope'"),
        ({"data": {"nope": None}}, BadConfig, "unknown dataset 'nope'"),
        ({"data": {"bandai-namco": None}}, BadConfig, "read from your disk"),
        ({"data": {"bandai-namco": Path("/nonexistent")}}, BadData, "no such file or folder"),
        ({"data": {"procedural": Path("/tmp")}}, BadConfig, "takes no path"),
        ({"adapter_files": ("/nope.py",)}, BadConfig, "no Python file"),
        ({"seeds": (0, 0)}, BadConfig, "expected different numbers from 0 on"),
        ({"seeds": ()}, BadConfig, "expected different numbers from 0 on"),
        ({"out": Path("/dev/null/out")}, BadConfig, "cannot be written"),
        ({"store": Path("/dev/null/store")}, BadConfig, "cannot be written"),
        ({"foreign": {"procedural": None}}, BadConfig, "'procedural' is given to --data, too"),
    ],
)  # fmt: skip
def test_bad_requests_are_refused_and_write_nothing(
    tmp_path: Path, changes: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        run(request(tmp_path, **changes), SILENT)
    assert list(tmp_path.iterdir()) == []


def test_a_text_file_and_an_empty_folder_are_no_dataset(tmp_path: Path) -> None:
    text, folder = tmp_path / "text.txt", tmp_path / "folder"
    text.write_text("hello")
    folder.mkdir()
    with pytest.raises(BadFile, match="expected a folder or a zip"):
        run(request(tmp_path, data={"bandai-namco": text}), SILENT)
    with pytest.raises(BadData, match="expected files called like"):
        run(request(tmp_path, data={"bandai-namco": folder}), SILENT)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["folder", "text.txt"]


def test_two_adapters_of_one_name_are_refused(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "from bench.adapters.base import Adapter\n\nclass Mine(Adapter):\n    name = 'copy-content'\n"
        "    def transfer(self, content, style, *, rng):\n        return content.clip\n"
    )
    with pytest.raises(BadConfig, match="two adapters are called 'copy-content'"):
        sources_of(request(tmp_path, adapter_files=(str(file),)))


def test_defaults_are_all_anchors_on_the_transfer_track(tmp_path: Path) -> None:
    names = [source.name for source in sources_of(request(tmp_path))]
    assert "label-oracle" in names and "classify-and-retrieve" in names
    assert [protocol.track for protocol in protocols_of(request(tmp_path))] == ["transfer"]


def test_beside_other_rows_only_the_new_one_is_run(tmp_path: Path) -> None:
    file = tmp_path / "mine.py"
    file.write_text(
        "from bench.adapters.base import Adapter\n\nclass Mine(Adapter):\n    name = 'mine'\n"
        "    def transfer(self, content, style, *, rng):\n        return content.clip\n"
    )
    alone = request(tmp_path, adapter_files=(str(file),), only_files=True)
    assert [source.name for source in sources_of(alone)] == ["mine"]
    assert len(sources_of(request(tmp_path, adapter_files=(str(file),)))) > 10


def test_a_foreign_dataset_gives_contents_and_has_no_rows(tmp_path: Path, bandai_namco_zip: Path) -> None:
    asked = request(
        tmp_path, foreign={"bandai-namco": bandai_namco_zip}, methods=("copy-content",), tracks=(),
        protocols=("stylebench-transfer@1/foreign",), profile="smoke",
    )  # fmt: skip
    [record] = run(asked, SILENT).records
    assert (record.status, record.dataset, record.condition) == ("ok", "procedural@1", "foreign")
