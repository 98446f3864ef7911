"""Contract tests: every row of every table keeps the promises of its kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.adapters import ADAPTERS
from bench.adapters.base import Adapter
from bench.adapters.oracles import Oracle
from bench.datasets.table import DATASETS
from bench.metrics import METRICS
from bench.metrics.catalogue import Metric
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol
from bench.suite.scores import SCORES

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda metric: metric.name)
def test_metric_is_documented(metric: Metric) -> None:
    assert metric.version >= 1
    assert metric.unit and metric.summary and metric.source and metric.misleads
    page = (DOCS / "metrics" / f"{metric.docs}.md").read_text(encoding="utf-8")
    assert f"`{metric.name}`" in page


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=lambda protocol: protocol.protocol_id)
def test_protocol_names_only_known_metrics(protocol: Protocol) -> None:
    assert set(protocol.metrics) <= set(METRICS)
    assert protocol.primary[0] in protocol.metrics
    assert {"quick", "standard"} <= set(protocol.n_samples)


@pytest.mark.parametrize("name", [m for p in PROTOCOLS.values() if p.track == "transfer" for m in p.metrics])
def test_transfer_metric_has_a_score(name: str) -> None:
    assert name in SCORES


@pytest.mark.parametrize("adapter", ADAPTERS.values(), ids=lambda adapter: adapter.name)
def test_adapter_says_what_it_is(adapter: type[Adapter]) -> None:
    assert adapter.name and adapter.title and adapter.description and adapter.__doc__
    assert adapter.kind in ("anchor", "method")
    assert adapter.capabilities() or issubclass(adapter, Oracle)
    if adapter.fits():
        assert adapter.save is not Adapter.save and adapter.load is not Adapter.load


@pytest.mark.parametrize("name", DATASETS)
def test_dataset_names_its_licence_and_source(name: str) -> None:
    entry = DATASETS[name]
    assert entry.licence and entry.citation and entry.summary
    assert entry.how_to_get or not entry.needs_path
