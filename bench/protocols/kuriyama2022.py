"""``kuriyama2022@1``: Tables 1 to 4 of Kuriyama et al. 2022, on scenarios of this benchmark's datasets.

The paper's recordings are not public. What it leaves open and what was chosen stands in ``facts``.
"""

from __future__ import annotations

from dataclasses import replace

from bench.protocols.base import MakeTasks, Protocol
from bench.protocols.gesture import (
    CONTENT_ERRORS,
    FACTS,
    GESTURE,
    N_INTER,
    STYLE_ERRORS,
    THETAS,
    inter_tasks,
    intra_tasks,
    make_tasks,
)
from bench.protocols.scenarios import N_SCENARIOS


def _table(
    condition: str, summary: str, tasks: MakeTasks, n_samples: dict[str, int], facts: dict[str, str]
) -> Protocol:
    slice_name = {"table3": "inter", "table4": "all"}.get(condition, "intra")
    return replace(
        GESTURE,
        name="kuriyama2022",
        version=1,
        condition=condition,
        summary=summary,
        n_samples=n_samples,
        metrics=("content_error[fastdtw]", *CONTENT_ERRORS, *STYLE_ERRORS, *THETAS),
        truth_metrics=(),
        primary=("style_error", slice_name),
        make_tasks=tasks,
        facts={
            **FACTS,
            "hand frame": "root: relative to the hips, facing forward (the paper does not say)",
            "dtw": "[fastdtw]: radius 1 (the paper names FastDTW and no radius), its worst and worst_quarter in the "
            "details; without brackets: exact",
            "output segments": "hop theta / 2, tail covered (the paper does not speak of it)",
            **facts,
        },
    )


_INTRA = {"smoke": 3, "quick": N_SCENARIOS, "standard": N_SCENARIOS}

TABLE_1 = _table(
    "table1",
    "Table 1: a performed imitation, and both copies, against the content and the style sample",
    intra_tasks,
    _INTRA,
    {
        "imitation": "another synthetic actor performs the scenario in the style, procedural data only; the paper's "
        "actor imitates a transfer",
        "samples": "content errors against the style sample and style errors against the content sample are in the "
        "details",
    },
)
TABLE_2 = _table("table2", "Table 2: both sides perform one scenario", intra_tasks, _INTRA, {})
TABLE_3 = _table(
    "table3",
    "Table 3: the style side performs another scenario",
    inter_tasks,
    {"smoke": 3, "quick": 30, "standard": N_INTER},
    {"pairs": f"{FACTS['pairs']}; 15 x 14 of them (the paper does not give their number)"},
)
TABLE_4 = _table(
    "table4",
    "Table 4: all pairs of scenarios, intra and inter",
    make_tasks,
    {"smoke": 3, "quick": 45, "standard": N_SCENARIOS + N_INTER},
    {"pairs": f"{FACTS['pairs']}; 15 x 15 of them (the paper does not give their number)"},
)
