"""The committed packs: small, of an anchor and of a learned row, and verified from the repository alone."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.suite.packs import pack_name, read_pack
from bench.suite.verify import VerifyRequest, verify
from reports.records import digest_of_bytes
from reports.rows import load_run

PACKS = Path(__file__).resolve().parents[2] / "examples" / "packs"
LIMIT_BYTES = 6_000_000


def test_packs_are_those_of_their_records() -> None:
    stored = load_run(PACKS)
    assert {record.method.kind for record, _ in stored} == {"anchor", "method"}
    for record, _ in stored:
        data = (PACKS / "packs" / pack_name(record)).read_bytes()
        assert digest_of_bytes(data) == record.pack_digest
        pack = read_pack(data, pack_name(record))
        assert pack.motions.n == 100 and pack.facts["dataset"] == "procedural@1" and pack.facts["licence"]
        assert not record.provenance.dirty
    assert sum(path.stat().st_size for path in PACKS.rglob("*") if path.is_file()) <= LIMIT_BYTES


@pytest.mark.slow
def test_from_the_repository_alone_the_packs_are_verified(tmp_path: Path) -> None:
    request = VerifyRequest(PACKS, "", {"procedural": None}, 5, tmp_path / "out", tmp_path / "store")
    claims = verify(request, lambda *_: None)
    assert [claim for claim in claims if claim.verdict == "fail"] == []
    passed = [claim.claim for claim in claims if claim.verdict == "pass"]
    for claim in ("record", "samples file", "data and tasks", "motions", "judges", "samples", "numbers"):
        assert passed.count(claim) == 2, claim
    assert passed.count("generation") == 1  # of the anchor; the learned row would have to be trained
