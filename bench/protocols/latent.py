"""``stylebench-latent@1``: the transfer track with a style label instead of a style reference."""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.transfer import TRANSFER

LATENT = replace(
    TRANSFER,
    name="stylebench-latent",
    track="latent",
    summary="content window + style label -> motion; the same tasks and scores as in the transfer track",
    needs="samples",
    facts={
        **TRANSFER.facts,
        "style": "given by its label; what a method draws from that label comes from the task's seed",
    },
)
