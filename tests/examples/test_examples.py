"""The worked examples do what their pages say."""

from __future__ import annotations

import shutil
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bench.adapters import worker
from bench.adapters.base import Adapter
from bench.adapters.check import check_adapter
from bench.adapters.external import External
from bench.adapters.loading import find_adapter, source_from_option
from bench.datasets.procedural import load
from bench.datasets.take import Take
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import window
from bench.motion.skeleton import PARTS, SPINE
from bench.protocols import PROTOCOLS
from bench.suite.setting import prepare
from bench.suite.store import Store
from bench.suite.submission import check_submission, export_tasks, read_submission
from tests.adapters.outside import left_behind
from tests.suite.tiny import tiny_dataset

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
SMALL_NUMPY = "1.26.4"


@pytest.fixture(autouse=True)
def few_calls(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bench.adapters.check.GROWTH_CALLS", 150)


def adapter_at(path: Path) -> type[Adapter]:
    return find_adapter(source_from_option(str(path)))


def answer_of(adapter: type[Adapter]) -> tuple[Clip, Clip, Clip]:
    """Content, style reference and the adapter's answer."""
    first, *_, last = (take for take in load(None).takes if take.clip.n_frames > 64)
    content, method = window(first.clip, 0, 64), adapter()
    answer = method.transfer(Take(content), Take(last.clip), rng=np.random.default_rng(0))
    if isinstance(method, External):
        method.close()
    return content, last.clip, answer


def passes(adapter: type[Adapter]) -> None:
    assert [row for row in check_adapter(adapter, load(None).takes) if row.ok is False] == []


def has_the_spine_of_the_style(content: Clip, style: Clip, answer: Clip) -> None:
    spine = PARTS["spine"][1:]
    mean = quat.mean(style.rotations_wxyz[:, spine])
    assert quat.angle_between(answer.rotations_wxyz[:, spine], mean).max() < 1e-6
    others = [joint for joint in range(21) if joint not in spine]
    np.testing.assert_allclose(answer.rotations_wxyz[:, others], content.rotations_wxyz[:, others], atol=1e-12)


def leans_forward(content: Clip, answer: Clip) -> None:
    turned = np.degrees(quat.angle_between(answer.rotations_wxyz, content.rotations_wxyz))
    assert turned[:, SPINE] == pytest.approx(20.0, abs=1e-3)
    assert np.delete(turned, SPINE, axis=1).max() < 1e-3


def test_python_class() -> None:
    adapter = adapter_at(EXAMPLES / "python_class" / "borrowed_posture.py")
    has_the_spine_of_the_style(*answer_of(adapter))
    passes(adapter)


def outside_program(folder: Path) -> Path:
    """The example in a folder of its own, with the worker beside it as its page says."""
    shutil.copytree(EXAMPLES / "outside_program", folder)
    shutil.copyfile(worker.__file__, folder / "worker.py")
    return folder / "adapter.toml"


def test_outside_program_in_this_environment(tmp_path: Path) -> None:
    toml = outside_program(tmp_path / "program")
    toml.write_text(toml.read_text().replace("venv/bin/python", sys.executable))
    has_the_spine_of_the_style(*answer_of(adapter_at(toml)))


@pytest.mark.slow
def test_outside_program_in_an_environment_with_another_numpy(
    tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    toml = outside_program(tmp_path / "program")
    subprocess.run([sys.executable, "-m", "venv", toml.parent / "venv"], check=True)
    python = toml.parent / "venv" / "bin" / "python"
    pip = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", f"numpy=={SMALL_NUMPY}"]
    if subprocess.run(pip, capture_output=True).returncode != 0:
        pytest.skip(f"numpy {SMALL_NUMPY} cannot be installed here")
    adapter = adapter_at(toml)
    capfd.readouterr()
    has_the_spine_of_the_style(*answer_of(adapter))
    assert np.__version__ != SMALL_NUMPY
    assert f"goes to the log; numpy {SMALL_NUMPY}" in capfd.readouterr().err
    passes(adapter)
    assert left_behind(toml.parent) == []


def test_node() -> None:
    if shutil.which("node") is None:
        pytest.skip("Node.js is not installed")
    adapter = adapter_at(EXAMPLES / "node" / "adapter.toml")
    content, _, answer = answer_of(adapter)
    leans_forward(content, answer)
    passes(adapter)


def test_no_code(tmp_path: Path) -> None:
    if shutil.which("awk") is None:
        pytest.skip("awk is not installed")
    protocol = replace(PROTOCOLS["stylebench-transfer@1"], n_samples={"smoke": 4})
    setting = prepare(tiny_dataset(), protocol, "smoke", Store(tmp_path / "store"))
    folder = tmp_path / "out"
    export_tasks(setting, folder)
    subprocess.run(["sh", EXAMPLES / "no_code" / "answer.sh", folder], check=True)
    assert [row for row in check_submission(folder, setting) if row.ok is False] == []
    submission = read_submission(folder, setting)
    assert (submission.name, submission.title) == ("lean-forward-awk", "lean forward (awk)")
    assert submission.motions.n == 4
