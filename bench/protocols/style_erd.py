"""``style_erd@1``: Tables 1 and 2 of Tao et al. 2022 (Style-ERD)."""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.base import Trials
from bench.protocols.park2021 import M_CLS, M_GEN, POOLS, TRIALS, neutral_tasks
from bench.protocols.runtime import RUNTIME
from bench.protocols.transfer import TRANSFER

# 512 features need 1024 samples on both sides, so quick draws a little more than elsewhere, and all parts but the
# judges' are the reference.
N_QUICK = 1200

_FACTS = {
    "features": "512 activations of the denoising auto-encoder on 24 frames of yaw-aligned local quaternions",
    "clip cut": "centre 24 frames; first 24 and every 24 beside it",
    "stylised": "fit, test and real parts, which are the Frechet reference too (the paper does not say)",
    "same-style pairs": "dropped",
    "post-processing": "none",
    "window": TRANSFER.facts["window"],
}

TABLE_1 = replace(
    TRANSFER,
    name="style_erd",
    condition="table1",
    summary="Table 1: Frechet distance in auto-encoder features",
    n_samples=POOLS | {"quick": N_QUICK},
    metrics=("fmd[dae-512]", "fmd[dae-512-first]", "fmd[dae-512-every]"),
    truth_metrics=(),
    primary=("fmd[dae-512]", "all"),
    source_parts=M_GEN,
    real_parts=M_GEN,
    floor_parts=M_CLS,
    trials=TRIALS | {"quick": Trials(3, N_QUICK)},
    facts={**_FACTS, "source filter": "all styles"},
)

TABLE_1_NEUTRAL = replace(
    TABLE_1,
    condition="table1-neutral",
    summary="Table 1 with neutral sources only, the pairs that the method is trained on",
    make_tasks=neutral_tasks,
    facts={**_FACTS, "source filter": "neutral only"},
)

TABLE_2 = replace(
    RUNTIME,
    name="style_erd",
    condition="table2",
    summary="Table 2: duration online and of whole clips, designed input length",
)
