"""Packs and reviewers' checks: a truthful record passes, and every way of tampering is caught and named."""

from __future__ import annotations

import io
import json
import shutil
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from bench.errors import BadConfig, BadFile
from bench.suite.motions import Motions
from bench.suite.packs import fetch, pack_bytes, pack_name, pack_run, read_pack
from bench.suite.reproduce import WITHIN, reproduce
from bench.suite.store import Store
from bench.suite.verify import Claim, VerifyRequest, verify
from reports.nightly import compare_nights
from reports.records import (
    Record,
    digest_of_arrays,
    digest_of_bytes,
    read_record,
    read_samples,
    samples_path,
    write_record,
)
from tests.reports.factory import FakeMethod, FakeTasks, make_row
from tests.suite.tiny import tiny_dataset, tiny_run, tiny_tables


def silent(stage: str, what: str, done: int, total: int) -> None:
    """Progress that nobody watches."""


def some_motions(seed: int = 0) -> Motions:
    takes = tiny_dataset().takes[seed : seed + 3]
    return Motions.of(takes)


def record_called(name: str) -> Record:
    record, _ = make_row(FakeMethod(name, name), FakeTasks())
    return record


def test_a_pack_gives_back_its_motions_and_the_same_bytes_each_time() -> None:
    motions, record = some_motions(), record_called("mine")
    data = pack_bytes(record, [{"sample_id": "s0000"}], motions)
    assert data == pack_bytes(record, [{"sample_id": "s0000"}], motions)
    pack = read_pack(data, "here")
    assert pack.motions.digest == motions.digest == pack.facts["motions_digest"]
    assert pack.facts["licence"] == "CC BY-NC 4.0" and pack.tasks == [{"sample_id": "s0000"}]
    assert pack_name(record) == "mine-stylebench-transfer@1-bandai-namco@1-standard-s0.zip"


@pytest.mark.parametrize("data", [b"", b"no zip", b"PK\x05\x06" + bytes(18)])
def test_what_is_no_pack_is_refused(data: bytes) -> None:
    with pytest.raises(BadFile, match="no motion pack"):
        read_pack(data, "here")


def test_a_pack_with_pickles_is_refused() -> None:
    whole = pack_bytes(record_called("mine"), [], some_motions())
    buffer, evil = io.BytesIO(), io.BytesIO()
    np.save(evil, np.array([{}], dtype=object), allow_pickle=True)
    with zipfile.ZipFile(io.BytesIO(whole)) as old, zipfile.ZipFile(buffer, "w") as new:
        for name in old.namelist():
            new.writestr(name, evil.getvalue() if name == "lengths.npy" else old.read(name))
    with pytest.raises(BadFile, match="no motion pack"):
        read_pack(buffer.getvalue(), "here")


def test_packs_come_from_paths_and_addresses(tmp_path: Path) -> None:
    path = tmp_path / "a.zip"
    path.write_bytes(b"bytes")
    assert fetch(str(path)) == fetch(path.as_uri()) == b"bytes"
    with pytest.raises(BadFile, match="cannot be read"):
        fetch(str(tmp_path / "none.zip"))


@pytest.fixture(scope="module")
def tiny_benchmark(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A packed tiny run, its store beside it; the tiny tables stay in place."""
    folder = tmp_path_factory.mktemp("verify")
    with tiny_tables():
        tiny_run(folder / "run", folder / "store", methods=("copy-content", "noise-0.1"))
        packed = pack_run(folder / "run", Store(folder / "store"))
        assert all(one.file and one.size_bytes > 1000 for one in packed)
        yield folder


@pytest.fixture
def copied(tiny_benchmark: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(tiny_benchmark / "run", tmp_path / "run"))


def check(run: Path, tiny_benchmark: Path, sample: int = 0, packs: str = "") -> list[Claim]:
    request = VerifyRequest(run, packs, {"tiny": None}, sample, run.parent / "again", tiny_benchmark / "store")
    return verify(request, silent)


def of(run: Path, name: str) -> Path:
    return next(path for path in (run / "records").glob("*.json") if read_record(path).method.name == name)


def failures(claims: list[Claim]) -> list[Claim]:
    return [claim for claim in claims if claim.verdict == "fail"]


@pytest.mark.slow
def test_a_truthful_run_passes_exactly(copied: Path, tiny_benchmark: Path) -> None:
    claims = check(copied, tiny_benchmark, sample=3)
    assert failures(claims) == []
    said = {(claim.record.split()[0], claim.claim): claim.what for claim in claims if claim.verdict == "pass"}
    for name in ("copy-content", "noise-0.1"):
        assert said[name, "numbers"].startswith("exact")
        assert said[name, "samples"].startswith("exact")
        assert said[name, "generation"].startswith("exact")


def one_digit(run: Path, path: Path) -> None:
    text = path.read_text()
    value = next(m.value for m in read_record(path).measurements if m.name == "jerk_ratio" and m.value)
    path.write_text(text.replace(json.dumps(value), json.dumps(value + 0.1), 1))


def other_motions(run: Path, path: Path) -> None:
    """The pack of another row under this row's name."""
    record = read_record(path)
    other = read_record(of(run, "copy-content"))
    shutil.copy(run / "packs" / pack_name(other), run / "packs" / pack_name(record))


def other_motions_and_pack_digest(run: Path, path: Path) -> None:
    other_motions(run, path)
    record = read_record(path)
    data = (run / "packs" / pack_name(record)).read_bytes()
    write_record(path, record.model_copy(update={"pack_digest": digest_of_bytes(data)}))


def other_motions_and_all_digests(run: Path, path: Path) -> None:
    other_motions_and_pack_digest(run, path)
    record = read_record(path)
    write_record(
        path, record.model_copy(update={"motions_digest": read_record(of(run, "copy-content")).motions_digest})
    )


def another_judge(run: Path, path: Path) -> None:
    record = read_record(path)
    judges = (record.judges[0].model_copy(update={"digest": "0" * 32}), *record.judges[1:])
    write_record(path, record.model_copy(update={"judges": judges}))


def edited_samples(run: Path, path: Path) -> None:
    record = read_record(path)
    arrays = read_samples(path, record)
    arrays["per_sample/joint_recognition"] = np.full_like(arrays["per_sample/joint_recognition"], 100.0)
    np.savez(samples_path(path), **arrays)  # type: ignore[arg-type]


def edited_samples_and_digest(run: Path, path: Path) -> None:
    edited_samples(run, path)
    with np.load(samples_path(path)) as stored:
        arrays = {name: stored[name] for name in stored.files}
    write_record(path, read_record(path).model_copy(update={"samples_digest": digest_of_arrays(arrays)}))


def other_tasks(run: Path, path: Path) -> None:
    record = read_record(path)
    facts = {**record.protocol_facts, "tasks digest": "0" * 32}
    write_record(path, record.model_copy(update={"protocol_facts": facts}))


def no_longer_copies(run: Path, path: Path) -> None:
    record = read_record(path)
    write_record(path, record.model_copy(update={"copies": not record.copies}))


def no_json(run: Path, path: Path) -> None:
    path.write_text("{")


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tamper", "claim"),
    [
        (one_digit, "jerk_ratio on"),
        (other_motions, "motions"),
        (other_motions_and_pack_digest, "motions"),
        (other_motions_and_all_digests, "samples"),
        (another_judge, "judges"),
        (edited_samples, "samples file"),
        (edited_samples_and_digest, "samples"),
        (other_tasks, "data and tasks"),
        (no_longer_copies, "copies"),
        (no_json, "record"),
    ],
)
def test_tampering_is_caught_and_named(
    tamper: Callable[[Path, Path], None], claim: str, copied: Path, tiny_benchmark: Path
) -> None:
    path = of(copied, "noise-0.1")
    tamper(copied, path)
    found = failures(check(copied, tiny_benchmark))
    assert found and all(path.name in failure.record for failure in found)
    assert any(failure.claim.startswith(claim) for failure in found)


@pytest.mark.slow
def test_a_submission_names_where_its_packs_lie(copied: Path, tiny_benchmark: Path, tmp_path: Path) -> None:
    lines = []
    for pack in sorted((copied / "packs").iterdir()):
        moved = tmp_path / f"elsewhere-{pack.name}"
        shutil.move(pack, moved)
        lines.append(f'[[pack]]\nfile = "{pack.name}"\naddress = "{moved.as_uri()}"\n')
    assert {claim.verdict for claim in check(copied, tiny_benchmark) if claim.claim == "motions"} == {"cannot check"}
    (copied / "submission.toml").write_text("\n".join(lines))
    claims = check(copied, tiny_benchmark)
    assert failures(claims) == [] and sum(claim.claim == "numbers" for claim in claims) == 2
    (copied / "submission.toml").write_text("[[pack]]\nfile = 1\n")
    with pytest.raises(BadFile, match=r"\[\[pack\]\]"):
        check(copied, tiny_benchmark)


@pytest.mark.slow
def test_a_record_is_reproduced_and_runs_compare_equal(copied: Path, tiny_benchmark: Path, tmp_path: Path) -> None:
    path = of(copied, "noise-0.1")
    _, again, found = reproduce(path, {"tiny": None}, tmp_path / "again", tmp_path / "store", silent)
    assert again.method.name == "noise-0.1"
    assert {item.outcome for item in found} == {"same"} and set(WITHIN) > {"same"}
    assert compare_nights(copied, copied).regressions == ()
    with pytest.raises(BadConfig, match="tiny"):
        reproduce(path, {"procedural": None}, tmp_path / "again", tmp_path / "store", silent)
