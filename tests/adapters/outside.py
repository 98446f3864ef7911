"""Outside programs made on the spot, and a look at what they leave behind."""

from __future__ import annotations

import shutil
import sys
import textwrap
from pathlib import Path

import numpy as np
import psutil

from bench.adapters import worker
from bench.adapters.external import External, external_adapter
from bench.datasets.take import Take
from tests.motion.factory import random_clip

COPY = """
def transfer(content, style):
    return content.rotations_wxyz, content.root_xyz_m
"""
BY_HAND = """
import json, sys, time
MARK = {mark!r}
def read():
    return json.loads(sys.stdin.readline())
def say(message):
    sys.stdout.write(json.dumps(message) + "\\n")
    sys.stdout.flush()
hello = read()
say({{"id": hello["id"], "ok": True, "protocol": 1, "capabilities": ["transfers"], "fits": False}})
"""
"""A program without worker.py that has said hello."""


def with_worker(
    folder: Path, code: str, toml: str = "", capabilities: str = '"transfers"', python: str = sys.executable
) -> type[External]:
    """An adapter whose program is worker.py with ``code``."""
    shutil.copyfile(worker.__file__, folder / "worker.py")
    (folder / "my_code.py").write_text(textwrap.dedent(code))
    command = [python, "worker.py", "my_code.py", str(folder)]
    return _adapter(folder, command[:3], toml, capabilities)


def by_hand(folder: Path, code: str, toml: str = "") -> type[External]:
    """An adapter whose program speaks the protocol itself; ``code`` runs once a transfer has been asked for."""
    return after_hello(folder, "request = read()\n" + textwrap.dedent(code), toml)


def after_hello(folder: Path, code: str, toml: str = "") -> type[External]:
    """As :func:`by_hand`; ``code`` runs right after hello."""
    (folder / "program.py").write_text(BY_HAND.format(mark=str(folder)) + textwrap.dedent(code))
    return _adapter(folder, [sys.executable, "program.py"], toml, '"transfers"')


def _adapter(folder: Path, command: list[str], toml: str, capabilities: str) -> type[External]:
    quoted = ", ".join(f'"{word}"' for word in command)
    text = f'name = "outside"\ncommand = [{quoted}]\ncapabilities = [{capabilities}]\n{textwrap.dedent(toml)}'
    (folder / "adapter.toml").write_text(text)
    return external_adapter(folder / "adapter.toml")


def content_take(n_frames: int = 16, seed: int = 1) -> Take:
    """A source window without labels."""
    return Take(random_clip(n_frames, seed=seed))


def style_take(seed: int = 2) -> Take:
    """A style reference with a label."""
    return Take(random_clip(40, seed=seed), style="old")


def rng(seed: int = 0) -> np.random.Generator:
    return np.random.default_rng(seed)


def left_behind(folder: Path) -> list[str]:
    """Command lines of processes that run in or were told of ``folder``."""
    found = []
    for process in psutil.process_iter(["cmdline", "cwd"]):
        words = process.info["cmdline"] or []
        if process.info["cwd"] == str(folder) or any(str(folder) in word for word in words):
            found.append(" ".join(words))
    return found
