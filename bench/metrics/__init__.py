"""Metrics: pure functions, arrays in, numbers out. METRICS is the table of all."""

from __future__ import annotations

from bench.metrics.catalogue import ALL_METRICS, Metric

METRICS: dict[str, Metric] = {metric.name: metric for metric in ALL_METRICS}
"""Name -> what the number is. One function, one row here and one docs section make a metric."""
