"""Protocols. PROTOCOLS is the table of all."""

from __future__ import annotations

from bench.protocols import kuriyama2022, mason2022, motion_puzzle, park2021, style_erd
from bench.protocols.base import Protocol
from bench.protocols.conditions import FOREIGN, LONG, SELF, SHORT
from bench.protocols.gesture import GESTURE
from bench.protocols.interpolation import INTERPOLATION, INTERPOLATION_PARTS
from bench.protocols.latent import LATENT
from bench.protocols.parts import PARTS_PROTOCOL
from bench.protocols.prediction import PREDICTION
from bench.protocols.runtime import RUNTIME
from bench.protocols.transfer import TRANSFER

PROTOCOLS: dict[str, Protocol] = {
    protocol.label: protocol
    for protocol in (
        TRANSFER,
        SELF,
        LONG,
        SHORT,
        FOREIGN,
        LATENT,
        INTERPOLATION,
        INTERPOLATION_PARTS,
        PARTS_PROTOCOL,
        GESTURE,
        RUNTIME,
        PREDICTION,
        park2021.TABLE_1,
        park2021.TABLE_1_CLS,
        park2021.TABLE_2,
        park2021.TABLE_2_CLS,
        park2021.TABLE_2_NEUTRAL,
        motion_puzzle.TABLE_1,
        motion_puzzle.TABLE_2,
        style_erd.TABLE_1,
        style_erd.TABLE_1_NEUTRAL,
        style_erd.TABLE_2,
        kuriyama2022.TABLE_1,
        kuriyama2022.TABLE_2,
        kuriyama2022.TABLE_3,
        kuriyama2022.TABLE_4,
        mason2022.TABLE_2,
        mason2022.FIG_10,
        mason2022.ROLLOUT,
    )
}
"""``name@version`` or ``name@version/condition`` -> protocol."""
