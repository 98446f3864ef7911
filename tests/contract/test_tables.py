"""Contract tests: every row of every table keeps the promises of its kind."""

from __future__ import annotations

from pathlib import Path

import pytest

from bench.adapters import ADAPTERS
from bench.adapters.base import CAPABILITIES, Adapter
from bench.adapters.oracles import Oracle
from bench.datasets.table import DATASETS
from bench.metrics import METRICS
from bench.metrics.catalogue import Metric
from bench.protocols import PROTOCOLS
from bench.protocols.base import Protocol
from bench.suite.answering import ANSWERS
from bench.suite.request import OWN_PROTOCOLS
from bench.suite.scores import SCORES
from reports.columns import columns_of

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda metric: metric.name)
def test_metric_is_documented(metric: Metric) -> None:
    assert metric.version >= 1
    assert metric.unit and metric.summary and metric.source and metric.misleads
    page = (DOCS / "metrics" / f"{metric.docs}.md").read_text(encoding="utf-8")
    assert f"`{metric.name}`" in page


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=lambda protocol: protocol.label)
def test_protocol_names_only_known_metrics(protocol: Protocol) -> None:
    named = (*protocol.metrics, *protocol.truth_metrics)
    assert set(named) <= set(METRICS)
    assert protocol.primary[0] in protocol.metrics
    assert {"smoke", "quick", "standard"} <= set(protocol.n_samples)
    assert protocol.summary and protocol.facts
    assert protocol.needs in CAPABILITIES
    if protocol.track != "runtime":
        assert set(named) <= set(SCORES)
        assert protocol.track in ANSWERS


@pytest.mark.parametrize("metric", METRICS)
def test_every_metric_is_computed_somewhere(metric: str) -> None:
    assert any(metric in (*protocol.metrics, *protocol.truth_metrics) for protocol in PROTOCOLS.values())


@pytest.mark.parametrize("protocol", PROTOCOLS.values(), ids=lambda protocol: protocol.label)
def test_every_protocol_has_columns_and_its_primary_leads(protocol: Protocol) -> None:
    columns = columns_of(protocol.track, protocol.name, protocol.condition)
    assert columns[0].metric == protocol.primary[0]
    known = {*METRICS}
    assert {column.metric for column in columns} <= known
    titles = [column.title for column in columns]
    assert len(set(titles)) == len(titles)


@pytest.mark.parametrize("track", sorted({protocol.track for protocol in PROTOCOLS.values()}))
def test_every_track_has_rows_to_read_it_against(track: str) -> None:
    protocol = OWN_PROTOCOLS[track]
    rows = [a for a in ADAPTERS.values() if protocol.needs in a.capabilities() or track in getattr(a, "tracks", ())]
    assert len(rows) >= 2


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


@pytest.mark.parametrize("label", PROTOCOLS)
def test_protocol_is_documented(label: str) -> None:
    assert f"`{label}`" in (DOCS / "protocols.md").read_text(encoding="utf-8")
