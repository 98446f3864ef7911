"""A new adapter as files: what ``new-adapter`` writes, ready to be checked and to be changed."""

from __future__ import annotations

import keyword
import re
import sys
from pathlib import Path

from bench.adapters import worker
from bench.errors import BadConfig

NAME = re.compile(r"[a-z][a-z0-9_]{0,40}")

TEMPLATE = '''"""{title}: my method for the benchmark. Try it with ``stylebench check {name}.py``."""

from __future__ import annotations

import numpy as np

from bench.adapters.base import Adapter, Traits
from bench.datasets.take import Take
from bench.motion.clip import Clip


class {class_name}(Adapter):
    """What the suite calls. Only ``name`` and one call are required."""

    name = "{name}"
    title = "{title}"
    description = "one line for the table"

    # Labels on takes are None unless they are asked for here: Traits(needs_style_label=True).
    traits = Traits()

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        """The content's motion in the style's style, as many frames, on the content's bones."""
        rotations_wxyz = content.clip.rotations_wxyz  # [T, 21, 4] local unit quaternions, w first
        root_xyz_m = content.clip.root_xyz_m  # [T, 3] metres, Y up
        # style.clip has the same arrays for the style reference, which may be longer or shorter.
        # Your method goes here; randomness comes from rng, so that a seed gives the same answer.
        return content.clip.with_motion(rotations_wxyz, root_xyz_m)

    # A method that learns also has
    #     def fit(self, takes, *, seed, budget, progress): ...
    #     def save(self, folder): ...
    #     def load(self, folder): ...
    # More calls, and what they mean: bench/adapters/base.py.
'''

PROGRAM_TOML = """\
# How the benchmark starts this program and what it may ask of it. Every key: docs/adding-a-method.md
name = "{name}"
title = "{title}"
description = "one line for the table"

# The interpreter of your own environment: Python 3.7 or newer with numpy.
command = ["{python}", "worker.py", "my_code.py"]
capabilities = ["transfers"]

[traits]
# Labels are None unless they are asked for here.
needs_style_label = false
"""

PROGRAM_CODE = '''"""Your method in its own environment. What it prints goes to the log; all calls: top of worker.py."""


def transfer(content, style):
    rotations_wxyz = content.rotations_wxyz  # [T, 21, 4] local unit quaternions, w first
    root_xyz_m = content.root_xyz_m  # [T, 3] metres, Y up
    # style has the same arrays for the style reference, which may be longer or shorter.
    return rotations_wxyz, root_xyz_m
'''


def new_adapter_text(name: str) -> str:
    """The text of ``NAME.py``: one adapter class that passes the check as it is.

    Raises
    ------
    BadConfig : a name that cannot name a Python file.
    """
    if not NAME.fullmatch(name) or keyword.iskeyword(name):
        raise BadConfig(
            f"{name[:60]!r} cannot name an adapter file",
            where="NAME",
            remedy="use lower-case letters, digits and underscores, a letter first: my_method",
        )
    words = name.split("_")
    class_name = "".join(word.capitalize() for word in words if word)
    return TEMPLATE.format(name=name, title=" ".join(word for word in words if word), class_name=class_name)


def write_new_adapter(name: str, folder: Path) -> Path:
    """Write ``NAME.py`` into a folder; the path.

    Raises
    ------
    BadConfig : a name that does not fit, a file that is already there, or a folder that cannot be written.
    """
    text = new_adapter_text(name)
    path = folder / f"{name}.py"
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError:
        raise BadConfig(f"{path} is already there", remedy="choose another name, or remove it") from None
    except OSError as error:
        raise BadConfig(f"cannot be written ({error.strerror})", where=str(path)) from None
    return path


def write_new_program(name: str, folder: Path) -> Path:
    """Write a folder ``NAME`` with ``adapter.toml``, ``my_code.py`` and a copy of ``worker.py``; the path of the TOML.

    Raises
    ------
    BadConfig : as :func:`write_new_adapter`.
    """
    new_adapter_text(name)
    home = folder / name
    toml = PROGRAM_TOML.format(name=name, title=name.replace("_", " "), python=sys.executable)
    try:
        home.mkdir()
        (home / "adapter.toml").write_text(toml, encoding="utf-8")
        (home / "my_code.py").write_text(PROGRAM_CODE, encoding="utf-8")
        (home / "worker.py").write_bytes(Path(worker.__file__).read_bytes())
    except FileExistsError:
        raise BadConfig(f"{home} is already there", remedy="choose another name, or remove it") from None
    except OSError as error:
        raise BadConfig(f"cannot be written ({error.strerror})", where=str(home)) from None
    return home / "adapter.toml"
