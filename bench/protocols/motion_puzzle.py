"""``motion_puzzle@1``: Tables 1 and 2 of Jang et al. 2022 (Motion Puzzle)."""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.park2021 import M_CLS, M_GEN, POOLS, TRIALS
from bench.protocols.parts import PARTS_PROTOCOL
from bench.protocols.transfer import TRANSFER

TABLE_1 = replace(
    PARTS_PROTOCOL,
    name="motion_puzzle",
    condition="table1",
    summary="Table 1: joints that move when one body part is transferred, 200 pairs instead of one",
    source_parts=M_GEN,
)

TABLE_2 = replace(
    TRANSFER,
    name="motion_puzzle",
    condition="table2",
    summary="Table 2: FMD, CRA and SRA, trials of 2500 samples",
    n_samples=POOLS,
    metrics=("fmd[stgcn]", "cra", "sra", "cra_balanced", "sra_balanced"),
    truth_metrics=(),
    primary=("fmd[stgcn]", "all"),
    source_parts=M_GEN,
    real_parts=M_GEN,
    floor_parts=M_CLS,
    trials=TRIALS,
    facts={
        "halves": "M_cls = judge part (40 %), M_gen = fit, test and real parts (60 %), stylised and Frechet reference",
        "classifier features": "positions and rotations, corrected graph partition",
        "same-style pairs": "dropped",
        "source filter": "all styles",
        "post-processing": "none (the paper removes foot skate)",
        "window": TRANSFER.facts["window"],
    },
)
