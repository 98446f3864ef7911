from __future__ import annotations

import hashlib
import io
import threading
import zipfile
from collections.abc import Iterator
from dataclasses import replace
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.cli import app
from bench.datasets.base import Archive
from bench.datasets.fetch import fetch
from bench.datasets.table import DATASETS
from bench.errors import BadConfig, BadData, BadFile

ENTRY = DATASETS["100style"]


def packed() -> bytes:
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w") as archive:
        archive.writestr("100STYLE/Angry/Angry_FW.bvh", "HIERARCHY")
        archive.writestr("100STYLE/Frame_Cuts.csv", "STYLE_NAME")
    return content.getvalue()


CONTENT = packed()


class Server:
    """Serves one file on this machine and counts how often it is asked for."""

    def __init__(self) -> None:
        self.content, self.asked = CONTENT, 0
        outer = self

        class Handler(BaseHTTPRequestHandler):
            def do_GET(self) -> None:
                outer.asked += 1
                self.send_response(200)
                self.send_header("Content-Length", str(len(outer.content)))
                self.end_headers()
                self.wfile.write(outer.content)

            def log_message(self, format: str, *args: object) -> None:
                """Keeps the output of tests clean."""

        self.server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.thread = threading.Thread(target=self.server.serve_forever)
        self.thread.start()

    @property
    def archive(self) -> Archive:
        url = f"http://127.0.0.1:{self.server.server_address[1]}/tiny.zip"
        return Archive("tiny.zip", url, hashlib.sha256(CONTENT).hexdigest(), len(CONTENT))

    def close(self) -> None:
        self.server.shutdown()
        self.thread.join()
        self.server.server_close()


@pytest.fixture
def server() -> Iterator[Server]:
    server = Server()
    yield server
    server.close()


def test_downloads_checks_and_unpacks_once(server: Server, tmp_path: Path) -> None:
    entry = replace(ENTRY, archives=(server.archive,))
    seen: list[str] = []
    for _ in range(2):
        found = fetch(
            "100style", entry, tmp_path / "data", lambda what, done, total: seen.append(f"{what} {done}/{total}")
        )
    assert server.asked == 1
    assert found.archives == (tmp_path / "data" / "tiny.zip",)
    assert found.data == tmp_path / "data" / "tiny"
    assert (found.data / "100STYLE" / "Angry" / "Angry_FW.bvh").read_text() == "HIERARCHY"
    assert any(line.startswith("downloading tiny.zip") for line in seen)
    assert "unpacking tiny.zip 2/2" in seen


def test_placed_archive_is_used_without_network(server: Server, tmp_path: Path) -> None:
    (tmp_path / "tiny.zip").write_bytes(CONTENT)
    found = fetch("bandai-namco", replace(ENTRY, archives=(server.archive,), unpack=False), tmp_path)
    assert found.data == tmp_path / "tiny.zip"
    assert server.asked == 0


def test_volumes_are_left_packed(server: Server, tmp_path: Path) -> None:
    volumes = (server.archive, replace(server.archive, file="tiny.z01"))
    found = fetch("zeroeggs", replace(ENTRY, archives=volumes), tmp_path)
    assert found.data is None
    assert [path.name for path in found.archives] == ["tiny.zip", "tiny.z01"]


def test_other_content_is_refused_and_not_kept(server: Server, tmp_path: Path) -> None:
    server.content = CONTENT[:-1] + b"?"
    with pytest.raises(BadFile, match="has not the known SHA-256"):
        fetch("100style", replace(ENTRY, archives=(server.archive,)), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("content", "match"), [(CONTENT[:-9], r"\d+ bytes, \d+ published"), (CONTENT[:-1] + b"?", "another")]
)
def test_wrong_placed_archive_is_refused_and_left(server: Server, tmp_path: Path, content: bytes, match: str) -> None:
    (tmp_path / "tiny.zip").write_bytes(content)
    with pytest.raises(BadFile, match=match):
        fetch("100style", replace(ENTRY, archives=(server.archive,)), tmp_path)
    assert (tmp_path / "tiny.zip").read_bytes() == content
    assert server.asked == 0


def test_no_answer_says_where_to_place_the_file(server: Server, tmp_path: Path) -> None:
    away = replace(server.archive, url="http://127.0.0.1:1/tiny.zip")
    with pytest.raises(BadData, match=r"cannot be downloaded .*place it as .*tiny.zip and fetch again"):
        fetch("100style", replace(ENTRY, archives=(away,)), tmp_path)


def test_what_has_no_address_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BadData, match="xia2015 has no fixed address"):
        fetch("xia2015", DATASETS["xia2015"], tmp_path)


def test_archives_name_a_version_and_a_digest() -> None:
    for entry in DATASETS.values():
        for archive in entry.archives:
            assert len(bytes.fromhex(archive.sha256)) == 32
            assert "/main/" not in archive.url and "/master/" not in archive.url


def test_command(server: Server, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(DATASETS, "100style", replace(ENTRY, archives=(server.archive,)))
    runner = CliRunner()
    result = runner.invoke(app, ["data", "fetch", "100style", "--out", str(tmp_path)])
    assert result.exit_code == 0
    assert "licence CC BY 4.0" in result.output
    assert "stylebench data verify 100style=" in result.output.replace("\n", " ")
    how = runner.invoke(app, ["data", "fetch", "100style", "--how"])
    assert how.exit_code == 0
    assert server.archive.url in how.output
    xia = runner.invoke(app, ["data", "fetch", "xia2015"])
    assert xia.exit_code == 1
    assert "deep-motion-editing" in xia.output
    assert runner.invoke(app, ["data", "fetch", "procedural"]).exit_code == 0
    assert isinstance(runner.invoke(app, ["data", "fetch", "cats"]).exception, BadConfig)
