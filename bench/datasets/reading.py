"""How motion files are read: joints, unit, up axis, frame rate; what is known of them, assumed, or given."""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.errors import BadConfig
from bench.motion.bvh import BvhMotion
from bench.motion.clip import Clip
from bench.motion.recognise import unit_metres
from bench.motion.retarget import to_canonical
from bench.motion.skeleton_maps import SkeletonMap

UP_AXES = ("y", "z")
FPS_RANGE = (1.0, 1000.0)


@dataclass(frozen=True)
class Overrides:
    """What is given of a dataset's files, instead of what they say or look like; None where nothing is given.

    Attributes
    ----------
    unit : m, cm, mm, inch, cmu, or metres per file unit.
    up : ``"y"`` or ``"z"``.
    fps : frames per second, instead of the frame times.

    Raises
    ------
    BadConfig : a value that cannot be.
    """

    unit: str | float | None = None
    up: str | None = None
    fps: float | None = None

    def __post_init__(self) -> None:
        if self.unit is not None:
            metres = unit_metres(self.unit)
            if not (math.isfinite(metres) and metres > 0.0):
                raise BadConfig(f"unit must be positive, got {self.unit}", remedy="for example cm, or 0.01")
        if self.up is not None and self.up not in UP_AXES:
            raise BadConfig(f"up must be y or z, got {self.up!r}")
        if self.fps is not None and not FPS_RANGE[0] <= self.fps <= FPS_RANGE[1]:
            raise BadConfig(f"fps must be {FPS_RANGE[0]:g} to {FPS_RANGE[1]:g}, got {self.fps:g}")

    @property
    def given(self) -> dict[str, str | float]:
        """Those that are given, by name."""
        named = {"unit": self.unit, "up": self.up, "fps": self.fps}
        return {name: value for name, value in named.items() if value is not None}

    @property
    def notes(self) -> tuple[str, ...]:
        return tuple(f"{name} {value}, as given" for name, value in self.given.items())


@dataclass(frozen=True, eq=False)
class Reading:
    """How the files of a folder are read.

    Attributes
    ----------
    skeleton_map : joints.
    unit_m : metres per file unit.
    up : ``"y"`` or ``"z"``.
    fps : None where the files' frame times hold.
    notes : what was assumed and what was given, one sentence each.
    """

    skeleton_map: SkeletonMap
    unit_m: float
    up: str
    fps: float | None
    notes: tuple[str, ...]

    def to_clip(self, bvh: BvhMotion) -> Clip:
        return to_canonical(bvh, self.skeleton_map, unit_m=self.unit_m, fps=self.fps, up=self.up)


def known_reading(skeleton_map: SkeletonMap, unit: str, overrides: Overrides, *, why: str = "as published") -> Reading:
    """Reading of files whose skeleton and unit are known, Y up, at their own frame times; but for what is given.

    Parameters
    ----------
    unit : name of the unit.
    why : how the unit is known, for the notes.
    """
    notes = [] if overrides.unit is not None else [f"unit {unit} {why}"]
    notes += [] if overrides.up is not None else ["Y up, as published"]
    unit_m = unit_metres(unit if overrides.unit is None else overrides.unit)
    return Reading(skeleton_map, unit_m, overrides.up or "y", overrides.fps, (*notes, *overrides.notes))


def facts_of(reading: Reading, overrides: Overrides) -> dict[str, str | float]:
    """What decides the takes of a dataset with a known skeleton; goes into its digest."""
    return {"skeleton": reading.skeleton_map.name, "unit_m": reading.unit_m, **overrides.given}
