from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from reports.bootstrap import cluster_counts, interval, mean_replicates
from reports.records import (
    BadRecord,
    Measurement,
    Record,
    digest_of,
    digest_of_arrays,
    read_record,
    read_samples,
    samples_path,
    write_bytes_atomically,
    write_record,
)
from tests.reports.factory import ANCHORS, FakeTasks, make_row, write_row


@pytest.fixture
def stored(tmp_path: Path) -> Path:
    return write_row(tmp_path, *make_row(ANCHORS[0], FakeTasks(n=40, n_clusters=10)))


def test_record_and_samples_round_trip(stored: Path, tmp_path: Path) -> None:
    record = read_record(stored)
    write_record(tmp_path / "again.json", record)
    assert (tmp_path / "again.json").read_text() == stored.read_text()
    assert read_samples(stored, record)["cluster"].shape == (40,)


def test_changed_samples_file_is_caught(stored: Path) -> None:
    record = read_record(stored)
    arrays = read_samples(stored, record)
    arrays["per_sample/joint_recognition"][0] += 1
    with samples_path(stored).open("wb") as file:
        np.savez(file, **arrays)  # type: ignore[arg-type]
    with pytest.raises(BadRecord, match=r"samples digest is .* the record says .* file was changed"):
        read_samples(stored, record)


def test_missing_samples_file_is_named(stored: Path) -> None:
    record = read_record(stored)
    samples_path(stored).unlink()
    with pytest.raises(BadRecord, match="samples file cannot be read"):
        read_samples(stored, record)


def changed(path: Path, **changes: object) -> Path:
    data = json.loads(path.read_text()) | changes
    path.write_text(json.dumps(data))
    return path


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"unknown": 1}, "unknown: Extra inputs are not permitted"),
        ({"measurements": []}, "an ok record needs measurements"),
        ({"status": "failed", "reason": ""}, "a failed record carries a reason and no numbers"),
        ({"status": "brilliant"}, "status: Input should be"),
        ({"schema_version": 2}, "schema_version"),
    ],
)
def test_malformed_records_are_refused_with_the_field(stored: Path, changes: dict[str, object], message: str) -> None:
    with pytest.raises(BadRecord, match=message):
        read_record(changed(stored, **changes))


def test_text_that_is_no_record_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.json").write_text("hello")
    with pytest.raises(BadRecord, match="not a record of schema 1"):
        read_record(tmp_path / "x.json")
    with pytest.raises(BadRecord, match="cannot be read"):
        read_record(tmp_path / "none.json")


def test_undefined_values_need_a_reason_and_nan_is_no_value() -> None:
    facts = {"name": "cra", "version": 1, "slice": "all", "unit": "%", "better": "higher", "n": 3}
    with pytest.raises(ValidationError, match="an undefined value needs a reason"):
        Measurement.model_validate({**facts, "value": None})
    with pytest.raises(ValidationError, match="must be finite"):
        Measurement.model_validate({**facts, "value": float("nan")})
    assert Measurement.model_validate({**facts, "value": None, "reason": "no samples"}).value is None


def test_digests_do_not_depend_on_order_and_depend_on_everything_else() -> None:
    assert digest_of({"a": 1, "b": 2}) == digest_of({"b": 2, "a": 1}) != digest_of({"a": 1, "b": 3})
    one, two = np.arange(3.0), np.arange(3.0) + 1
    assert digest_of_arrays({"a": one, "b": two}) == digest_of_arrays({"b": two, "a": one})
    assert digest_of_arrays({"a": one}) != digest_of_arrays({"a": one.astype(np.float32)})
    assert digest_of_arrays({"a": one}) != digest_of_arrays({"a": one.reshape(1, 3)})


def test_atomic_write_leaves_no_drafts_and_readable_files(tmp_path: Path) -> None:
    write_bytes_atomically(tmp_path / "x", b"abc")
    write_bytes_atomically(tmp_path / "x", b"def")
    assert [path.name for path in tmp_path.iterdir()] == ["x"]
    assert (tmp_path / "x").read_bytes() == b"def" and (tmp_path / "x").stat().st_mode & 0o444 == 0o444


def test_found_by_name_and_slice(stored: Path) -> None:
    record: Record = read_record(stored)
    assert record.protocol_id == "stylebench-transfer@1"
    found = record.find("joint_recognition", "different_content")
    assert found is not None and found.n == 32
    assert record.find("joint_recognition", "nope") is None


def test_clusters_are_drawn_whole_and_the_same_for_everybody() -> None:
    clusters = np.array(["a", "b", "a", "c", "b", "a"])
    counts = cluster_counts(clusters, 50, seed=1)
    assert counts.shape == (50, 6)
    np.testing.assert_array_equal(counts[:, 0], counts[:, 2])
    np.testing.assert_array_equal(counts[:, 1], counts[:, 4])
    assert (counts[:, [0, 1, 3]].sum(axis=1) == 3).all()
    np.testing.assert_array_equal(counts, cluster_counts(clusters, 50, seed=1))


def test_mean_replicates_by_hand_and_with_gaps() -> None:
    counts = np.array([[1, 1, 1], [2, 0, 1], [0, 0, 3]], dtype=np.int32)
    np.testing.assert_allclose(mean_replicates(np.array([1.0, 2.0, 6.0]), counts), [3.0, 8 / 3, 6.0])
    with_gap = mean_replicates(np.array([1.0, np.nan, np.nan]), counts)
    np.testing.assert_array_equal(np.isnan(with_gap), [False, False, True])


def test_interval_is_centred_on_the_value() -> None:
    low, high = interval(10.0, np.linspace(100.0, 104.0, 201))
    # of 201 replicates 0.02 apart, quantile 0.025 is the 5.05th from below
    assert low == pytest.approx(8.081) and high == pytest.approx(11.919)
    # Student's quantile with 4 degrees of freedom is 2.776, the normal one 1.960
    assert interval(10.0, np.linspace(100.0, 104.0, 201), degrees_of_freedom=4)[0] == pytest.approx(
        10 - 1.919 * 1.4166, rel=1e-4
    )
    assert np.isnan(interval(1.0, np.full(5, np.nan))).all()
