"""Distances between sets of features: Frechet and kernel, whole and conditioned on the labels asked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.arrays import BoolArray, FloatArray
from bench.metrics import frechet, kernel
from bench.metrics.conditional import MIN_REAL
from bench.suite.scores.base import PRIMARY_SLICE, Labelled, Reference, Row, Scored, measure

SIDES = ("style", "content")


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
    for slice_name in reference.present((PRIMARY_SLICE, "all")):
        mask = reference.slices[slice_name]
        counts = reference.counts[:, mask]
        sides = {kind: _sides(kind, generated, reference, form, mask, counts) for kind in SIDES}
        unscorable = sides["style"][2] or sides["content"][2]
        if unscorable:
            measurements.append(measure(name, slice_name, float("nan"), int(mask.sum()), reason=unscorable))
            continue
        values = np.maximum(sides["style"][0], sides["content"][0])
        draws = np.maximum(sides["style"][1], sides["content"][1]).mean(axis=0)
        replicates[f"{name}|{slice_name}"] = draws
        measurements.append(
            measure(
                name, slice_name, float(values.mean()), int(mask.sum()), replicates=draws,
                judge_values=values.tolist(), floor=reference.floors[name],
                details={"style": float(sides["style"][0].mean()), "content": float(sides["content"][0].mean())},
                reason=_left_out(reference),
            )
        )  # fmt: skip
    return Scored(tuple(measurements), {}, replicates)


def _sides(
    kind: str, generated: Labelled, reference: Reference, form: _Kid | _Fmd, mask: BoolArray | None,
    counts: NDArray[np.int32] | None,
) -> tuple[FloatArray, FloatArray, str]:  # fmt: skip
    """Values ``[S]`` and replicates ``[S, B]`` conditioned on style or content, and why they are undefined if so."""
    rows = slice(None) if mask is None else mask
    real, values, draws, reason = reference.real, [], [], ""
    labels = (real.styles, generated.styles) if kind == "style" else (real.contents, generated.contents)
    for seed in range(real.embedding.n_seeds):
        of_real, of_generated = (
            form.features(kind, seed, getattr(side.embedding, f"{kind}_features")[seed]) for side in (real, generated)
        )
        result = form.distance(of_real, labels[0], of_generated[rows], labels[1][rows])
        values.append(result.value)
        reason = result.reason
        if counts is not None:
            draws.append(form.replicates(of_real, labels[0], of_generated[rows], labels[1][rows], counts))
    return np.array(values), np.array(draws), reason


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
    exact = frechet_value if name.startswith("fmd") else kernel.kernel_distance
    resample = frechet.frechet_replicates if name.startswith("fmd") else kernel.kernel_replicates
    real, generated = (
        getattr(embedding, features).astype(np.float64) for embedding in (reference.real.embedding, row.embedding)
    )
    seeds = range(len(real))
    details = {"n_real": float(real.shape[1]), "d": float(real.shape[2])}
    fewest, needed = min(real.shape[1], generated.shape[1]), 2 * real.shape[2]
    if name.startswith("fmd") and fewest < needed:
        reason = f"n = {fewest} is below 2 d = {needed}: the number would be mostly bias"
        return Scored((measure(name, "all", float("nan"), generated.shape[1], details=details, reason=reason),))
    values = [exact(real[s], generated[s]) for s in seeds]
    draws = np.mean([resample(real[s], generated[s], reference.counts) for s in seeds], axis=0)
    found = measure(name, "all", float(np.mean(values)), generated.shape[1], replicates=draws, judge_values=values,
                    floor=reference.floors[name], details=details)  # fmt: skip
    return Scored((found,), {}, {f"{name}|all": draws})


SET_FEATURES = {
    "fmd[stgcn-content]": "content_features",
    "fmd[stgcn-style]": "style_features",
    "fmd[dae]": "autoencoder_components",
    "kid[stgcn-content]": "content_features",
    "kid[stgcn-style]": "style_features",
}
"""Set distance -> the features it is taken on, as a field of ``Embedding``."""


def floors(reference: Reference, names: Sequence[str]) -> dict[str, float]:
    """Distances among ``names`` between other real motion and the real part, at the tasks' n, mean over judge seeds."""
    found = {}
    for name in names:
        if name in SET_FEATURES or name == "fmd[stgcn]":
            features = SET_FEATURES.get(name, "content_features")
            exact = frechet_value if name.startswith("fmd") else kernel.kernel_distance
            real, floor = (
                getattr(side.embedding, features).astype(np.float64) for side in (reference.real, reference.floor)
            )
            found[name] = float(np.mean([exact(a, b) for a, b in zip(real, floor, strict=True)]))
        elif name in ("conditional_kid", "conditional_fmd"):
            form = _Kid() if name == "conditional_kid" else _Fmd(reference)
            style, content = (_sides(kind, reference.floor, reference, form, None, None)[0] for kind in SIDES)
            found[name] = float(np.maximum(style, content).mean())
    return found


def frechet_value(real: NDArray[np.floating], generated: NDArray[np.floating]) -> float:
    """Frechet distance of two sets of features ``[n, d]``, in double precision."""
    return frechet.frechet_distance(real.astype(np.float64), generated.astype(np.float64)).value
