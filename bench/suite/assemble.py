"""From a cell's scores to its record and samples file."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.suite.plan import Cell
from bench.suite.score import CellScores
from bench.suite.setting import Setting
from bench.suite.workers import Outcome
from reports.records import (
    JudgeFacts,
    Measurement,
    Provenance,
    Record,
    digest_of,
    digest_of_arrays,
    samples_path,
    write_bytes_atomically,
    write_record,
)

COPIES_PERCENT = 50.0
"""A row with a copied share above this is marked ``copies`` and carries no rank."""


def record_of(
    setting: Setting,
    cell: Cell,
    outcome: Outcome,
    made: Provenance,
    *,
    measurements: tuple[Measurement, ...] = (),
    arrays: Mapping[str, NDArray[Any]] | None = None,
    motions_digest: str = "",
    judges: tuple[JudgeFacts, ...] = (),
) -> Record:
    """The record of one cell; a failed one carries the outcome's reason and no numbers."""
    copied = next((m.value for m in measurements if (m.name, m.slice) == ("copied_share", "all")), None)
    return Record(
        key=record_key(setting, cell),
        method=cell.facts,
        protocol=setting.protocol.name,
        protocol_version=setting.protocol.version,
        dataset=setting.dataset.dataset_id,
        dataset_digest=setting.dataset.digest,
        split=setting.split.kind,
        split_seed=setting.split.seed,
        track=setting.protocol.track,
        condition=setting.protocol.condition,
        profile=setting.profile,
        seed=cell.seed,
        status=outcome.status,
        reason=outcome.reason,
        log=outcome.log,
        copies=copied is not None and copied > COPIES_PERCENT,
        measurements=measurements,
        judges=judges,
        protocol_facts=protocol_facts(setting),
        motions_digest=motions_digest,
        samples_digest=digest_of_arrays(arrays) if arrays else "",
        provenance=made,
    )


def record_key(setting: Setting, cell: Cell) -> str:
    """Key of a cell's record: what was generated, and by which protocol it is scored."""
    return digest_of({"motions": cell.motions_key, "protocol": setting.protocol.label,
                      "profile": setting.profile, "method": cell.facts.name, "seed": cell.seed})  # fmt: skip


def protocol_facts(setting: Setting) -> dict[str, str]:
    """What a reader needs beside the numbers to rebuild them."""
    return {
        **setting.protocol.facts,
        "tasks": str(len(setting.tasks)),
        "tasks digest": setting.tasks_digest,
        "split digest": setting.split.digest,
        "fit digest": setting.fit_digest,
        "real digest": setting.part_digest(*setting.protocol.real_parts),
        "licence": setting.dataset.licence,
        "citation": setting.dataset.citation,
    }


def sample_arrays(scores: CellScores) -> dict[str, NDArray[Any]]:
    """The arrays of a samples file; see ``reports.records.read_samples`` for the names."""
    arrays: dict[str, NDArray[Any]] = {
        "sample_id": np.array([task.sample_id for task in scores.samples]),
        "cluster": np.array([task.content_take_id for task in scores.samples]),
    }
    arrays |= {f"slice/{name}": mask for name, mask in scores.slices.items()}
    if scores.embedding is not None:
        for seed in range(scores.embedding.n_seeds):
            arrays[f"judge/stgcn-content/{seed}"] = scores.embedding.content_predicted[seed].astype(np.int8)
            arrays[f"judge/stgcn-style/{seed}"] = scores.embedding.style_predicted[seed].astype(np.int8)
    for scored in scores.scored.values():
        arrays |= {f"per_sample/{name}": values.astype(np.float32) for name, values in scored.per_sample.items()}
        arrays |= {f"replicates/{name}": values.astype(np.float32) for name, values in scored.replicates.items()}
    return arrays


def write(folder: Path, record: Record, arrays: Mapping[str, NDArray[Any]] | None = None) -> Path:
    """Store a record and its samples file; the samples first, so that a record never lacks its file."""
    path = folder / f"{record.key}.json"
    if arrays:
        buffer = io.BytesIO()
        np.savez_compressed(buffer, **arrays)  # type: ignore[arg-type]
        write_bytes_atomically(samples_path(path), buffer.getvalue())
    write_record(path, record)
    return path
