"""Distances between sets of features: Frechet and kernel, whole and conditioned on the labels asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray
from bench.metrics import frechet, kernel
from bench.metrics.conditional import MIN_REAL
from bench.suite.scores.base import PRIMARY_SLICE, Labelled, Reference, Row, Scored, measure
from reports.records import Measurement


def conditional_kid(row: Row, reference: Reference) -> Scored:
    """The larger of the style-conditional and the content-conditional kernel distance, mean over judge seeds."""
    return _conditional("conditional_kid", row, reference, _Kid())


def conditional_fmd(row: Row, reference: Reference) -> Scored:
    """The same with Frechet distance in 16 principal components."""
    return _conditional("conditional_fmd", row, reference, _Fmd(reference))


class _Kid:
    """Kernel distance on the features as they are."""

    def features(self, kind: str, seed: int, features: NDArray[np.float32]) -> FloatArray:
        return features.astype(np.float64)

    distance = staticmethod(kernel.conditional_kernel)
    replicates = staticmethod(kernel.conditional_kernel_replicates)


class _Fmd:
    """Frechet distance in the judge's leading principal components."""

    def __init__(self, reference: Reference) -> None:
        self.components = {"style": reference.style_components, "content": reference.content_components}

    def features(self, kind: str, seed: int, features: NDArray[np.float32]) -> FloatArray:
        return self.components[kind][seed].apply(features.astype(np.float64))

    distance = staticmethod(frechet.conditional_frechet)
    replicates = staticmethod(frechet.conditional_frechet_replicates)


def _conditional(name: str, row: Row, reference: Reference, form: _Kid | _Fmd) -> Scored:
    generated = Labelled(row.embedding, row.contents, row.styles)
    measurements, replicates = [], {}
    for slice_name in (PRIMARY_SLICE, "all"):
        mask = reference.slices[slice_name]
        counts = reference.counts[:, mask]
        sides = {kind: _sides(kind, generated, reference, form, mask, counts) for kind in ("style", "content")}
        values = np.maximum(sides["style"][0], sides["content"][0])
        draws = np.maximum(sides["style"][1], sides["content"][1]).mean(axis=0)
        floors = [_sides(kind, reference.floor, reference, form, None, None)[0] for kind in ("style", "content")]
        replicates[f"{name}|{slice_name}"] = draws
        measurements.append(
            measure(
                name, slice_name, float(values.mean()), int(mask.sum()), replicates=draws,
                judge_values=values.tolist(), floor=float(np.maximum(floors[0], floors[1]).mean()),
                details={"style": float(sides["style"][0].mean()), "content": float(sides["content"][0].mean())},
                reason=_left_out(reference),
            )
        )  # fmt: skip
    return Scored(tuple(measurements), {}, replicates)


def _sides(
    kind: str, generated: Labelled, reference: Reference, form: _Kid | _Fmd, mask: BoolArray | None,
    counts: NDArray[np.int32] | None,
) -> tuple[FloatArray, FloatArray]:  # fmt: skip
    """Values ``[S]`` and replicates ``[S, B]`` conditioned on style or content."""
    rows = slice(None) if mask is None else mask
    real, values, draws = reference.real, [], []
    labels = (real.styles, generated.styles) if kind == "style" else (real.contents, generated.contents)
    for seed in range(real.embedding.n_seeds):
        of_real, of_generated = (
            form.features(kind, seed, getattr(side.embedding, f"{kind}_features")[seed]) for side in (real, generated)
        )
        result = form.distance(of_real, labels[0], of_generated[rows], labels[1][rows])
        values.append(result.value)
        if counts is not None:
            draws.append(form.replicates(of_real, labels[0], of_generated[rows], labels[1][rows], counts))
    return np.array(values), np.array(draws)


def _left_out(reference: Reference) -> str:
    """Names labels with fewer than 20 real windows, which conditional distances leave out."""
    small = [
        name
        for labels, names in (
            (reference.real.contents, reference.content_labels),
            (reference.real.styles, reference.style_labels),
        )
        for index, name in enumerate(names)
        if int((labels == index).sum()) < MIN_REAL
    ]
    return f"left out for fewer than {MIN_REAL} real windows: {', '.join(small)}" if small else ""


def set_distance(name: str, features: str, row: Row, reference: Reference) -> Scored:
    """FMD or KID of whole feature sets (a field of ``Embedding``), mean over judge seeds."""
    exact = _frechet if name.startswith("fmd") else kernel.kernel_distance
    resample = frechet.frechet_replicates if name.startswith("fmd") else kernel.kernel_replicates
    real, generated, floor = (
        getattr(embedding, features).astype(np.float64)
        for embedding in (reference.real.embedding, row.embedding, reference.floor.embedding)
    )
    seeds = range(len(real))
    floor_value = float(np.mean([exact(real[s], floor[s]) for s in seeds]))
    measurements, replicates = [], {}
    for slice_name in ("all", PRIMARY_SLICE):
        mask = reference.slices[slice_name]
        values = [exact(real[s], generated[s, mask]) for s in seeds]
        draws = np.mean([resample(real[s], generated[s, mask], reference.counts[:, mask]) for s in seeds], axis=0)
        replicates[f"{name}|{slice_name}"] = draws
        details = {"n_real": float(real.shape[1]), "d": float(real.shape[2])}
        measurements.append(_shown_set_distance(name, slice_name, values, draws, floor_value, details, int(mask.sum())))
    return Scored(tuple(measurements), {}, replicates)


def _frechet(real: FloatArray, generated: FloatArray) -> float:
    return frechet.frechet_distance(real, generated).value


def _shown_set_distance(
    name: str, slice_name: str, values: Sequence[float], draws: FloatArray, floor: float, details: dict[str, float],
    n: int,
) -> Measurement:  # fmt: skip
    fewest, needed = min(n, int(details["n_real"])), 2 * int(details["d"])
    if name.startswith("fmd") and fewest < needed:
        return measure(
            name,
            slice_name,
            float("nan"),
            n,
            details=details,
            reason=f"n = {fewest} is below 2 d = {needed}: the number would be mostly bias",
        )
    return measure(
        name, slice_name, float(np.mean(values)), n, replicates=draws, judge_values=values, floor=floor, details=details
    )
