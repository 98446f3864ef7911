"""A user's own joint map as TOML.

::

    name = "my rig"

    [joints]            # canonical name = joint in the file
    Hips = "pelvis"
    LeftUpLeg = "thigh_l"

    [virtual]           # joints the rig lacks: T-pose offset from the canonical parent, metres
    LeftToeBase = [0.0, -0.05, 0.12]

    [t_pose]            # only for rigs that do not stand in their zero pose: where a joint's own x and y axes
    thigh_l = { x = "down", y = "forward" }    # point in a T-pose that faces forward

Fingers that are not listed are virtual. Without ``[t_pose]`` the zero pose of each file is taken as a standing pose.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from bench.arrays import FloatArray
from bench.errors import BadConfig
from bench.motion.known_skeletons import FINGERS_M
from bench.motion.skeleton_maps import BACK, DOWN, FORWARD, LEFT, RIGHT, UP, SkeletonMap, axes

DIRECTIONS = {"up": UP, "down": DOWN, "left": LEFT, "right": RIGHT, "forward": FORWARD, "back": BACK}


def read_skeleton_map(path: Path) -> SkeletonMap:
    """The map in a TOML file.

    Raises
    ------
    BadConfig : not readable, not TOML, unknown keys, or not a map of the canonical joints.
    """
    content = read_toml(path, ("name", "joints", "virtual", "t_pose"))
    joints = _table(content, "joints", path)
    if not joints or not all(isinstance(joint, str) for joint in joints.values()):
        raise BadConfig('needs a table [joints] with lines such as Hips = "pelvis"', where=str(path))
    virtual = {name: _offset(value, name, path) for name, value in _table(content, "virtual", path).items()}
    for finger, offset in FINGERS_M.items():
        if finger not in joints:
            virtual.setdefault(finger, offset)
    t_pose = {name: _rotation(value, name, path) for name, value in _table(content, "t_pose", path).items()}
    try:
        return SkeletonMap(str(content.get("name", path.stem)), joints, t_pose, virtual, zero_pose=not t_pose)
    except BadConfig as error:
        raise BadConfig(error.problem, where=str(path), remedy="see docs/skeletons.md") from error


def read_toml(path: Path, keys: tuple[str, ...]) -> dict[str, Any]:
    """A TOML file that may hold ``keys`` only.

    Raises
    ------
    BadConfig : not readable, not TOML, or another key.
    """
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise BadConfig(f"cannot be read as TOML ({error})", where=str(path)) from error
    unknown = sorted(set(content) - set(keys))
    if unknown:
        raise BadConfig(f"unknown {', '.join(unknown)}", where=str(path), remedy=f"there are {', '.join(keys)}")
    return content


def _table(content: Mapping[str, Any], key: str, path: Path) -> dict[str, Any]:
    table = content.get(key, {})
    if not isinstance(table, dict):
        raise BadConfig(f"{key} must be a table", where=str(path))
    return table


def _offset(value: object, name: str, path: Path) -> tuple[float, float, float]:
    if isinstance(value, list) and len(value) == 3 and all(isinstance(number, int | float) for number in value):
        return (float(value[0]), float(value[1]), float(value[2]))
    raise BadConfig(f"virtual.{name} must be three metres, got {value!r}", where=str(path))


def _rotation(value: object, name: str, path: Path) -> FloatArray:
    found = value if isinstance(value, dict) else {}
    x, y = (DIRECTIONS.get(str(found.get(axis))) for axis in ("x", "y"))
    if set(found) != {"x", "y"} or x is None or y is None or sum(a * b for a, b in zip(x, y, strict=True)) != 0.0:
        raise BadConfig(
            f"t_pose.{name} must say where x and y point, across each other, got {value!r}",
            where=str(path),
            remedy=f'{name} = {{ x = "down", y = "forward" }}; directions are {", ".join(DIRECTIONS)}',
        )
    return axes(x, y)
