"""``park2021@1``: Tables 1 and 2 of Park et al. 2021.

The paper halves its data into M_cls, which trains the classifier, and M_gen, which trains the generator and is the
Frechet reference. Here M_cls is the judge part and M_gen the other three parts. Which half is stylised is open: the
paper's words point to M_gen, its author (issue 4 of the repository) to the classifier's half; both are conditions.
"""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.base import Protocol, Task, TaskPool, Trials, neutral_style
from bench.protocols.latent import LATENT
from bench.protocols.transfer import TRANSFER, draw_tasks

M_CLS = ("judge",)
M_GEN = ("fit", "test", "real")
TRIALS = {"smoke": Trials(2, 60), "quick": Trials(3, 1000), "standard": Trials(10, 2500)}
POOLS = {"smoke": 60, "quick": 1000, "standard": 5000}
_METRICS = ("fmd[stgcn]", "cra", "cra_balanced")
_FACTS = {
    "halves": "M_cls = judge part (40 %), M_gen = fit, test and real parts (60 %)",
    "classifier features": "positions and rotations, corrected graph partition",
    "same-style pairs": "dropped",
    "source filter": "all styles",
    "post-processing": "none (the paper removes foot skate)",
    "window": TRANSFER.facts["window"],
}


def neutral_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Tasks whose sources are neutral, the pairs of Park's script for its Aberman baseline."""
    neutral = neutral_style(str(take.style) for take in pool.takes)
    return draw_tasks([take for take in pool.takes if take.style == neutral], pool.takes, n, seed)


def _table(base: Protocol, condition: str, parts: tuple[str, ...], half: str, summary: str) -> Protocol:
    return replace(
        base,
        name="park2021",
        version=1,
        condition=condition,
        summary=summary,
        n_samples=POOLS,
        metrics=_METRICS,
        truth_metrics=(),
        primary=("fmd[stgcn]", "all"),
        source_parts=parts,
        real_parts=M_GEN,
        floor_parts=M_CLS,
        trials=TRIALS,
        facts={**_FACTS, "half stylised": half, "generation": "latent" if base is LATENT else "reference"},
    )


TABLE_1 = _table(LATENT, "table1", M_GEN, "gen", "Table 1: styles by label, the generator's half stylised")
TABLE_1_CLS = _table(LATENT, "table1-cls", M_CLS, "cls", "Table 1 with the classifier's half stylised")
TABLE_2 = _table(TRANSFER, "table2", M_GEN, "gen", "Table 2: styles by reference, the generator's half stylised")
TABLE_2_CLS = _table(TRANSFER, "table2-cls", M_CLS, "cls", "Table 2 with the classifier's half stylised")
TABLE_2_NEUTRAL = replace(
    TABLE_2,
    condition="table2-neutral",
    summary="Table 2 with neutral sources only",
    make_tasks=neutral_tasks,
    facts={**TABLE_2.facts, "source filter": "neutral only"},
)
