"""Adapters: the thin objects through which the suite talks to methods. ADAPTERS is the table of those that ship."""

from __future__ import annotations

from bench.adapters.aberman2020 import Aberman2020, Aberman2020Content
from bench.adapters.anchors import (
    CoinFlip,
    ConcatenatedHalves,
    CopyContent,
    CopyStyle,
    FrozenFrame,
    LinearBlend,
    NoiseHigh,
    NoiseLow,
    NoiseMiddle,
    PoseAdain,
    RepeatLast,
    Splice,
)
from bench.adapters.base import Adapter
from bench.adapters.conv1d_adain import Conv1dAdain
from bench.adapters.fitted_anchors import ClassifyAndRetrieve, MeanPose, NearestPose, StyleMeanShift
from bench.adapters.gesture_oracles import GESTURE_ORACLES
from bench.adapters.holden2016 import Holden2016
from bench.adapters.kuriyama2022 import KURIYAMA
from bench.adapters.mason2022 import MASON_2022
from bench.adapters.motion_puzzle import MOTION_PUZZLE
from bench.adapters.oracles import LabelOracle, ProceduralTruth, RealDisjoint, RealTest
from bench.adapters.park2021 import PARK_2021
from bench.adapters.style_erd import STYLE_ERD
from bench.adapters.xia2015 import Xia2015

_TABLE: tuple[type[Adapter], ...] = (
    RealTest,
    RealDisjoint,
    LabelOracle,
    ProceduralTruth,
    CopyContent,
    CopyStyle,
    CoinFlip,
    ConcatenatedHalves,
    Splice,
    LinearBlend,
    RepeatLast,
    MeanPose,
    FrozenFrame,
    NoiseLow,
    NoiseMiddle,
    NoiseHigh,
    StyleMeanShift,
    PoseAdain,
    NearestPose,
    ClassifyAndRetrieve,
    *GESTURE_ORACLES,
    Holden2016,
    Aberman2020,
    Aberman2020Content,
    Conv1dAdain,
    *PARK_2021,
    *MOTION_PUZZLE,
    *STYLE_ERD,
    Xia2015,
    *KURIYAMA,
    *MASON_2022,
)
ADAPTERS: dict[str, type[Adapter]] = {adapter.name: adapter for adapter in _TABLE}
"""Name -> adapter class. The order is the order of rows that tie."""
