from __future__ import annotations

import ast
import shutil
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bench.adapters import worker
from bench.motion.bvh import write_bvh
from bench.motion.kinematics import world_positions
from tests.adapters.outside import COPY, content_take, rng, style_take, with_worker

SOURCE = Path(worker.__file__)
STANDARD = {
    "importlib", "inspect", "json", "os", "pathlib", "platform", "queue", "random", "shutil", "signal", "sys",
    "threading", "time", "traceback", "typing", "zipfile",
}  # fmt: skip
OLD_PYTHONS = ("3.7", "3.8", "3.9", "3.10", "3.12", "3.13", "3.14")


def python_of(version: str) -> str | None:
    """An interpreter of that version on this machine: on the path, or installed by pyenv."""
    installed = sorted(Path.home().glob(f".pyenv/versions/{version}.*/bin/python{version}"))
    return shutil.which(f"python{version}") if not installed else str(installed[-1])


def can_import_numpy(python: str) -> bool:
    return subprocess.run([python, "-c", "import numpy"], capture_output=True).returncode == 0


def test_syntax_is_that_of_python_3_7() -> None:
    ast.parse(SOURCE.read_text(), feature_version=(3, 7))


def test_nothing_newer_than_python_3_7_is_used() -> None:
    if shutil.which("vermin", path=str(Path(sys.executable).parent)) is None:
        pytest.skip("vermin is not installed")
    command = [str(Path(sys.executable).parent / "vermin"), "--no-tips", "--violations", "-t=3.7-", str(SOURCE)]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout


def test_numpy_is_its_only_library() -> None:
    tree = ast.parse(SOURCE.read_text())
    guarded = {id(inner) for node in tree.body if isinstance(node, ast.If) for inner in ast.walk(node)}
    imported = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            imported |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and id(node) not in guarded:
            imported.add(str(node.module).split(".")[0])
    assert imported - {"__future__"} == STANDARD | {"numpy"}


def test_positions_are_those_of_the_harness() -> None:
    clip = content_take().clip
    skeleton = clip.skeleton
    motion = worker.Motion(
        clip.rotations_wxyz, clip.root_xyz_m, skeleton.offsets_m, skeleton.names, skeleton.parents, clip.fps
    )
    np.testing.assert_allclose(motion.positions_m(), world_positions(clip), atol=1e-12)


def test_bvh_is_read_as_the_harness_wrote_it(tmp_path: Path) -> None:
    clip = content_take().clip
    write_bvh(tmp_path / "a.bvh", clip)
    motion = worker.read_bvh(str(tmp_path / "a.bvh"))
    assert (motion.names, motion.parents, motion.fps) == (list(clip.skeleton.names), list(clip.skeleton.parents), 30)
    np.testing.assert_allclose(motion.offsets_m, clip.skeleton.offsets_m, atol=1e-9)
    np.testing.assert_allclose(motion.positions_m(), world_positions(clip), atol=1e-6)


def test_a_file_that_is_being_written_has_another_name(tmp_path: Path) -> None:
    def write(path: str) -> None:
        assert list(tmp_path.iterdir()) == []
        Path(path).write_text("half")
        assert not (tmp_path / "a.npz").exists()

    answering = worker.Worker(None, SimpleNamespace(leave_if_forked=lambda: None))  # type: ignore[arg-type]
    answering.exchange = tmp_path
    assert answering._put("a.npz", write) == "a.npz"
    assert [path.name for path in tmp_path.iterdir()] == ["a.npz"]


@pytest.mark.parametrize("version", OLD_PYTHONS)
def test_compiles_under_other_pythons(version: str, tmp_path: Path) -> None:
    python = python_of(version)
    if python is None:
        pytest.skip(f"this machine has no Python {version}")
    copy = shutil.copyfile(SOURCE, tmp_path / "worker.py")
    subprocess.run([python, "-W", "error", "-m", "py_compile", str(copy)], check=True)


@pytest.mark.slow
@pytest.mark.parametrize("version", OLD_PYTHONS)
def test_answers_under_other_pythons(version: str, tmp_path: Path) -> None:
    """In a fresh virtual environment with whatever numpy that Python gets."""
    python = python_of(version)
    if python is None:
        pytest.skip(f"this machine has no Python {version}")
    if not can_import_numpy(python):
        subprocess.run([python, "-m", "venv", str(tmp_path / "venv")], check=True)
        python = str(tmp_path / "venv" / "bin" / "python")
        pip = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--only-binary=:all:", "numpy"]
        if subprocess.run(pip, capture_output=True).returncode != 0:
            pytest.skip(f"numpy for Python {version} cannot be installed here")
    content = content_take()
    method = with_worker(tmp_path, COPY, python=python)()
    answer = method.transfer(content, style_take(), rng=rng())
    np.testing.assert_allclose(answer.rotations_wxyz, content.clip.rotations_wxyz, atol=1e-12)
    method.close()
