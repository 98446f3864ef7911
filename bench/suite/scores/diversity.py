"""Diversity scores: how outputs fill the space of real motion, and how they differ from each other."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from bench.arrays import BoolArray, FloatArray
from bench.metrics import diversity as metric
from bench.suite.embedding import Embedding
from bench.suite.scores.base import Labelled, Reference, Row, Scored, measure
from reports.bootstrap import mean_replicates

FEATURES = {"stgcn-content": "content_features", "stgcn-style": "style_features"}
"""Family in a metric's name -> the features it is taken on, as a field of ``Embedding``."""
TOO_FEW_REAL = f"fewer than {metric.NEAREST_K + 1} real windows"
ONE_EACH = "no content was asked for twice"


def density(family: str, row: Row, reference: Reference) -> Scored:
    """Density of outputs in the balls of real motion, mean over judge seeds."""
    name = f"density[{family}]"
    if not _enough(reference):
        return _undefined(name, row, TOO_FEW_REAL)
    per_judge = np.stack([metric.density(balls) for balls in _balls(row.embedding, reference, family)])
    per_sample = per_judge.mean(axis=0)
    floor = float(np.mean([metric.density(balls).mean() for balls in _floor_balls(reference, family)]))
    draws = mean_replicates(per_sample, reference.counts)
    found = measure(
        name, "all", float(per_sample.mean()), len(per_sample), replicates=draws, floor=floor,
        judge_values=per_judge.mean(axis=1).tolist(), details=_facts(row, reference),
    )  # fmt: skip
    return Scored((found,), {name: per_sample}, {f"{name}|all": draws})


def coverage(family: str, row: Row, reference: Reference) -> Scored:
    """Share of real motion whose ball holds an output, mean over judge seeds."""
    name = f"coverage[{family}]"
    if not _enough(reference):
        return _undefined(name, row, TOO_FEW_REAL)
    balls = _balls(row.embedding, reference, family)
    values = [metric.coverage(inside) for inside in balls]
    floor = float(np.mean([metric.coverage(inside) for inside in _floor_balls(reference, family)]))
    draws = np.mean([metric.coverage_replicates(inside, reference.counts) for inside in balls], axis=0)
    facts = _facts(row, reference)
    facts["expected_percent"] = metric.expected_coverage(int(facts["n_real"]), row.motions.n)
    found = measure(
        name, "all", float(np.mean(values)), row.motions.n, replicates=draws, judge_values=values, floor=floor,
        details=facts,
    )  # fmt: skip
    return Scored((found,), {}, {f"{name}|all": draws})


def diversity(row: Row, reference: Reference) -> Scored:
    """Distance between outputs in content features, mean over judge seeds."""
    features = _content_features(row.embedding)
    n = features.shape[1]
    values = [metric.diversity(f) for f in features]
    draws = np.mean([metric.diversity_replicates(f, reference.counts) for f in features], axis=0)
    floor = float(np.mean([metric.diversity(f) for f in _content_features(reference.floor.embedding)]))
    found = measure(
        "diversity", "all", float(np.mean(values)), n, replicates=draws, judge_values=values, floor=floor,
        details={"pairs": n * (n - 1) / 2.0},
    )  # fmt: skip
    return Scored((found,), {}, {"diversity|all": draws})


def multimodality(row: Row, reference: Reference) -> Scored:
    """Distance between outputs for one content in content features, mean over contents and judge seeds."""
    name, sizes = "multimodality", np.unique(row.contents, return_counts=True)[1]
    features = _content_features(row.embedding)
    values = [metric.multimodality(f, row.contents) for f in features]
    if np.isnan(values).all():
        return _undefined(name, row, ONE_EACH)
    draws = np.mean([metric.multimodality_replicates(f, row.contents, reference.counts) for f in features], axis=0)
    found = measure(
        name, "all", float(np.mean(values)), row.motions.n, replicates=draws, judge_values=values,
        floor=_floor_multimodality(reference.floor),
        details={"pairs": float((sizes * (sizes - 1) // 2).sum()), "contents": float((sizes > 1).sum())},
    )  # fmt: skip
    return Scored((found,), {}, {f"{name}|all": draws})


def _floor_multimodality(floor: Labelled) -> float | None:
    value = float(np.mean([metric.multimodality(f, floor.contents) for f in _content_features(floor.embedding)]))
    return value if np.isfinite(value) else None


def _content_features(embedding: Embedding) -> FloatArray:
    """``[S, n, d]`` float64."""
    return embedding.content_features.astype(np.float64)


def _enough(reference: Reference) -> bool:
    return len(reference.real.contents) > metric.NEAREST_K


def _undefined(name: str, row: Row, reason: str) -> Scored:
    return Scored((measure(name, "all", float("nan"), row.motions.n, reason=reason),))


def _facts(row: Row, reference: Reference) -> dict[str, float]:
    return {"n_real": float(len(reference.real.contents)), "n": float(row.motions.n), "k": float(metric.NEAREST_K)}


@lru_cache(maxsize=2)
def _balls(embedding: Embedding, reference: Reference, family: str) -> tuple[BoolArray, ...]:
    """Which output lies in which real ball, by judge seed; density and coverage share it."""
    real, generated = (getattr(side, FEATURES[family]) for side in (reference.real.embedding, embedding))
    return tuple(metric.real_balls(a, b) for a, b in zip(real, generated, strict=True))


@lru_cache(maxsize=2)
def _floor_balls(reference: Reference, family: str) -> tuple[BoolArray, ...]:
    return _balls(reference.floor.embedding, reference, family)
