"""The house rules that a reviewer should not have to check by eye: imports, sizes, prints, asserts, randomness."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("bench", "classifiers", "reports")
FILES = sorted(path for package in PACKAGES for path in (ROOT / package).rglob("*.py"))
MAX_LINES = 500

ALLOWED_IMPORTS = {
    "classifiers": ("classifiers",),
    "reports": ("reports",),
    "bench/motion": ("bench.motion", "bench.errors", "bench.arrays"),
    "bench/metrics": ("bench.metrics", "bench.errors", "bench.arrays"),
    "bench/datasets": ("bench.datasets", "bench.motion", "bench.errors", "bench.arrays"),
    "bench/adapters": (
        "bench.adapters", "bench.datasets", "bench.methods", "bench.motion", "bench.errors", "bench.arrays",
    ),
    "bench/protocols": (
        "bench.protocols", "bench.datasets", "bench.motion", "bench.metrics", "bench.errors", "bench.arrays",
    ),
    "bench/methods": (
        "bench.methods", "bench.datasets", "bench.motion", "bench.metrics.dtw", "bench.errors", "bench.arrays",
        "classifiers",
    ),
}  # fmt: skip
"""Folder -> what of ours it may import; the longest matching folder counts. What is not named may import all."""

TORCH_FOLDERS = ("classifiers", "bench/methods")
TORCH_FILES = ("bench/suite/judges.py", "bench/suite/judge_training.py")

GLOBAL_RANDOMNESS = {
    ("np", "random", name) for name in ("seed", "rand", "randn", "randint", "random", "choice", "normal", "shuffle")
} | {("torch", "manual_seed"), ("random", "seed"), ("random", "random"), ("random", "choice"), ("random", "shuffle")}


def relative(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def imported_modules(tree: ast.AST) -> Iterator[str]:
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield node.module


def parsed(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def is_under(name: str, prefixes: tuple[str, ...]) -> bool:
    return any(name == prefix or name.startswith(f"{prefix}.") for prefix in prefixes)


def dotted(node: ast.expr) -> tuple[str, ...]:
    if isinstance(node, ast.Attribute):
        return (*dotted(node.value), node.attr)
    return (node.id,) if isinstance(node, ast.Name) else ()


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_imports_go_one_way(path: Path) -> None:
    folders = [folder for folder in ALLOWED_IMPORTS if relative(path).startswith(f"{folder}/")]
    if not folders:
        return
    allowed = ALLOWED_IMPORTS[max(folders, key=len)]
    own = [name for name in imported_modules(parsed(path)) if is_under(name, PACKAGES)]
    assert [name for name in own if not is_under(name, allowed)] == []


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_torch_lives_with_networks_only(path: Path) -> None:
    if relative(path) in TORCH_FILES or relative(path).startswith(TORCH_FOLDERS):
        return
    assert [name for name in imported_modules(parsed(path)) if is_under(name, ("torch",))] == []


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_modules_stay_small(path: Path) -> None:
    assert len(path.read_text(encoding="utf-8").splitlines()) <= MAX_LINES


@pytest.mark.parametrize("path", FILES, ids=relative)
def test_no_print_no_assert_no_global_randomness(path: Path) -> None:
    found = []
    for node in ast.walk(parsed(path)):
        if isinstance(node, ast.Assert):
            found.append(f"assert in line {node.lineno}")
        if isinstance(node, ast.Call):
            name = dotted(node.func)
            if (isinstance(node.func, ast.Name) and name == ("print",)) or name in GLOBAL_RANDOMNESS:
                found.append(f"{'.'.join(name)} in line {node.lineno}")
    assert found == []


@pytest.mark.parametrize("path", [path for path in FILES if path.name != "__main__.py"], ids=relative)
def test_every_module_says_what_it_is(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    assert not text.strip() or ast.get_docstring(parsed(path))
