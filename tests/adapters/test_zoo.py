"""A zoo of hostile adapters in one run: each bad row says why, and no good row notices."""

from __future__ import annotations

import os
import tempfile
from contextlib import suppress
from pathlib import Path

import psutil
import pytest

from bench.suite.workers import Limits
from reports.records import Record
from tests.adapters.outside import with_worker
from tests.suite.conftest import undisturbed as undisturbed
from tests.suite.tiny import METHODS, contents, tiny_run
from tests.waiting import wait_for

pytestmark = pytest.mark.slow

HEAD = """
import os, shutil, signal, subprocess, sys, tempfile, threading, time
import numpy as np
from bench.adapters.base import Adapter
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton, canonical_skeleton

class {name}(Adapter):
    name = "{name}"
    calls = 0

    def transfer(self, content, style, *, rng):
        clip = content.clip
        self.calls += 1
        rotations, root = clip.rotations_wxyz, clip.root_xyz_m
{body}
        return clip
"""

OPEN = """

def _open(descriptor):
    try:
        os.fstat(descriptor)
    except OSError:
        return False
    return True
"""

NAP = f"{1000 + os.getpid()}.5"
"""Seconds that children sleep; other tests beside these sleep for others."""

ZOO: dict[str, tuple[str, str, str]] = {
    "CrashAtClip5": ("if self.calls == 5: raise RuntimeError('clip 5')", "failed", "RuntimeError: clip 5"),
    "DiesAtClip5": ("if self.calls == 5: os._exit(7)", "failed", "exit code 7"),
    "Segfaults": ("os.kill(os.getpid(), signal.SIGSEGV)", "failed", "killed by SIGSEGV"),
    "InfiniteLoop": ("while True: pass", "timeout", "no answer within"),
    "Sleeps": ("time.sleep(600)", "timeout", "no answer within"),
    "ReturnsLate": ("time.sleep(30)", "timeout", "no answer within"),
    "NeverStopsTalking": ("while True: sys.stdout.write('x' * 65536 + chr(10))", "timeout", "no answer within"),
    "NeverStopsComplaining": ("while True: sys.stderr.write('y' * 65536)", "timeout", "no answer within"),
    "Allocates2GB": ("self.kept = np.ones(2**28)\ntime.sleep(600)", "oom", "the limit is"),
    "Leaks": ("self.kept = getattr(self, 'kept', []) + [np.ones(2**26)]\ntime.sleep(0.3)", "oom", "the limit is"),
    "IsNaN": ("return clip.with_motion(rotations, root * np.nan)", "invalid", "must be finite"),
    "IsInf": ("return clip.with_motion(rotations, root + np.inf)", "invalid", "must be finite"),
    "WrongT": ("return clip.with_motion(rotations[:9], root[:9])", "invalid", "expected 64 frames, got 9"),
    "WrongJ": (
        "s = clip.skeleton\n"
        "return Clip(Skeleton(s.names[:9], s.parents[:9], s.offsets_m[:9]), rotations[:, :9], root, clip.fps)",
        "invalid", "skeleton: expected",
    ),
    "WrongFps": ("return Clip(clip.skeleton, rotations, root, 25.0)", "invalid", "expected 30 fps, got 25 fps"),
    "Centimetres": ("return clip.with_motion(rotations, root * 100.0)", "invalid", "centimetres instead of metres"),
    "Teleports": (
        "root = root.copy()\nroot[30:, 0] += 5.0\nreturn clip.with_motion(rotations, root)", "invalid", "root path",
    ),
    "Stretches": (
        "return Clip(canonical_skeleton(clip.skeleton.offsets_m * 1.1), rotations, root, clip.fps)", "invalid",
        "bone lengths",
    ),
    "ReturnsNothing": ("return None", "invalid", "NoneType"),
    "ClosesItsPipes": ("os.closerange(0, 256)", "failed", "worker"),
    "Garbles": ("[os.write(fd, b'hello\\n') for fd in range(3, 64) if _open(fd)]", "failed", "line between worker"),
}  # fmt: skip
"""Name -> what it does in each call, the status it must get, and words of its reason."""

HARMLESS = {
    "Floods": "sys.stdout.write('x' * 10**6)\nsys.stderr.write('y' * 10**6)",
    "HasManyChildren": f"for _ in range(20): subprocess.Popen(['sleep', '{NAP}'])",
    "LeaksSlowly": "self.kept = getattr(self, 'kept', []) + [np.ones(5 * 2**17)]",
    "Forks": f"subprocess.Popen(['sleep', '{NAP}'], start_new_session=True)",
    "ForksAndComesBack": "if os.fork() == 0: time.sleep(0.01)",
    "IgnoresSigterm": "signal.signal(signal.SIGTERM, signal.SIG_IGN)",
    "DeletesItsScratch": "shutil.rmtree(tempfile.gettempdir(), ignore_errors=True)",
    "LeavesFiles": "tempfile.mkstemp()",
    "LeavesThreads": "threading.Thread(target=time.sleep, args=(600,)).start()",
}
"""Rude, but each task is answered: the row is good, and nothing of the rest stays behind."""

AT_IMPORT = {
    "raises": ("raise OSError('no weights')", "OSError: no weights"),
    "leaves": ("import os\nos._exit(3)", "ended without a word"),
}
OUTSIDE: dict[str, tuple[str, str, str]] = {
    "outside-good": ("", "ok", ""),
    "outside-forks": ("if os.fork() == 0: time.sleep(0.01)", "ok", ""),
    "outside-crashes": ("state.append(1)\nif len(state) == 5: raise RuntimeError('clip 5')", "failed", "clip 5"),
    "outside-dies": ("state.append(1)\nif len(state) == 5: os._exit(7)", "failed", "exit code 7"),
    "outside-cannot-be-stopped": (
        "for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP): signal.signal(number, signal.SIG_IGN)\n"
        f"subprocess.Popen(['sleep', '{NAP}'], start_new_session=True)\n"
        "while True: pass", "timeout", "no answer within",
    ),
    "outside-closes-its-pipes": ("os.closerange(0, 256)", "failed", "during 'transfer'"),
    "outside-deletes-its-exchange": ("shutil.rmtree(os.path.dirname(content.path))", "failed", "FileNotFoundError"),
    "outside-is-nan": ("return content.rotations_wxyz * float('nan'), content.root_xyz_m", "invalid", "finite"),
    "outside-cuts": ("return content.rotations_wxyz[1:], content.root_xyz_m[1:]", "invalid", "expected 64 frames"),
}  # fmt: skip
"""The same, of programs behind ``worker.py``."""

PROGRAM = """
import os, shutil, signal, subprocess, time
state = []
def transfer(content, style):
{body}
    return content
"""
LIMITS = Limits(wall_s=25.0, rss_mb=1500.0)


def write_zoo(folder: Path) -> list[str]:
    """One file per animal; returns the options that name them."""
    animals = {name: body for name, (body, _, _) in ZOO.items()} | HARMLESS
    for name, body in animals.items():
        indented = "\n".join(f"        {line}" for line in body.splitlines())
        (folder / f"{name}.py").write_text(HEAD.format(name=name, body=indented) + OPEN)
    for name, (text, _) in AT_IMPORT.items():
        (folder / f"{name}.py").write_text(text + "\n" + HEAD.format(name=name, body="        pass"))
    for name, (body, _, _) in OUTSIDE.items():
        (folder / name).mkdir()
        with_worker(folder / name, PROGRAM.format(body="\n".join(f"    {line}" for line in body.splitlines())))
        toml = folder / name / "adapter.toml"
        toml.write_text(toml.read_text().replace('"outside"', f'"{name}"'))
    return [str(path) for path in (*sorted(folder.glob("*.py")), *sorted(folder.glob("*/adapter.toml")))]


def descendants() -> set[int]:
    """Processes that come from this one, but the tracker that Python starts once and keeps."""
    found = set()
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.Error):
            if "resource_tracker" not in " ".join(process.cmdline()):
                found.add(process.pid)
    return found


@pytest.fixture(scope="module")
def visit(tmp_path_factory: pytest.TempPathFactory) -> tuple[dict[str, Record], Path]:
    """The records of one run with all animals, by method."""
    folder = tmp_path_factory.mktemp("zoo")
    (folder / "animals").mkdir()
    options = tuple(write_zoo(folder / "animals"))
    before, scratch = descendants(), folder / "tmp"
    scratch.mkdir()
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("TMPDIR", str(scratch))
        patch.setattr(tempfile, "tempdir", None)
        result = tiny_run(folder / "out", folder / "store", adapter_files=options, limits=LIMITS, jobs=2)
    wait_for(
        lambda: not descendants() - before and not list(scratch.glob("stylebench-*")), "the end of all animals", 60.0
    )
    assert not [p for p in psutil.process_iter(["cmdline"]) if p.info["cmdline"] == ["sleep", NAP]]
    return {record.method.name: record for record in result.records}, folder


@pytest.mark.parametrize("name", ZOO)
def test_bad_rows_say_why(name: str, visit: tuple[dict[str, Record], Path]) -> None:
    records, folder = visit
    _, status, words = ZOO[name]
    assert (records[name].status, words in records[name].reason) == (status, True), records[name].reason
    assert not records[name].measurements
    assert (folder / "out" / records[name].log).is_file()


@pytest.mark.parametrize("name", HARMLESS)
def test_rude_rows_that_answer_are_scored(name: str, visit: tuple[dict[str, Record], Path]) -> None:
    records, _ = visit
    assert records[name].status == "ok", records[name].reason
    assert records[name].motions_digest == records["copy-content"].motions_digest


@pytest.mark.parametrize("name", OUTSIDE)
def test_programs_say_why_or_are_scored(name: str, visit: tuple[dict[str, Record], Path]) -> None:
    records, _ = visit
    _, status, words = OUTSIDE[name]
    assert (records[name].status, words in records[name].reason) == (status, True), records[name].reason
    if status == "ok":
        assert records[name].motions_digest == records["copy-content"].motions_digest
    else:
        assert not records[name].measurements


@pytest.mark.parametrize("name", AT_IMPORT)
def test_what_cannot_be_imported_is_a_row(name: str, visit: tuple[dict[str, Record], Path]) -> None:
    records, _ = visit
    assert records[name].status == "failed" and AT_IMPORT[name][1] in records[name].reason


def test_no_good_row_notices(visit: tuple[dict[str, Record], Path], undisturbed: Path) -> None:
    records, folder = visit
    assert {records[name].status for name in METHODS} == {"ok"}
    alone, among = contents(undisturbed / "out"), contents(folder / "out")
    assert {name: among[name] for name in alone} == alone


def test_logs_are_bounded(visit: tuple[dict[str, Record], Path]) -> None:
    _, folder = visit
    sizes = {path.name: path.stat().st_size for path in (folder / "out" / "logs").iterdir()}
    assert max(sizes.values()) < 20 * 2**20, sizes
