"""The leaderboard in the repository is what its published records say."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.metrics import METRICS
from bench.protocols import PROTOCOLS
from bench.suite.judges import PRETRAINED, read_card
from reports.leaderboard import check
from reports.records import samples_path
from reports.rows import StoredRecord, load_run

ROOT = Path(__file__).resolve().parents[1]
PUBLISHED = ROOT / "reports" / "published"
STORED = load_run(PUBLISHED)


def test_leaderboard_is_current() -> None:
    assert check(ROOT / "leaderboard.md", PUBLISHED) == ""


def test_both_datasets_are_there() -> None:
    assert {stored.record.dataset for stored in STORED} >= {"procedural@1", "bandai-namco@1"}


@pytest.mark.parametrize("stored", STORED, ids=lambda stored: f"{stored.record.dataset}-{stored.record.method.name}")
def test_published_record_belongs_to_this_version(stored: StoredRecord) -> None:
    record, path = stored
    protocol = PROTOCOLS[record.protocol_label]
    assert {m.name for m in record.measurements} <= {*protocol.metrics, *protocol.truth_metrics}
    assert all(m.version == METRICS[m.name].version for m in record.measurements)
    assert not record.provenance.dirty and record.provenance.commit
    # Durations have no samples: every other number does.
    assert bool(record.samples_digest) == (record.track != "runtime")
    if record.samples_digest:
        assert samples_path(path).stat().st_size <= 400_000
    known = {judge.digest for judge in read_card(PRETRAINED / record.dataset).classifiers}
    assert {judge.digest for judge in record.judges if judge.id.startswith("stgcn")} <= known
