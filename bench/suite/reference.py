"""Building, storing and restoring what all rows of a setting are scored against."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bench.adapters.oracles import random_window
from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.metrics.frechet import PrincipalComponents
from bench.metrics.memorisation import copy_threshold, pose_descriptors
from bench.metrics.physics import jerk_per_sample
from bench.motion.edit import windows
from bench.protocols.base import Task, stable_seed
from bench.suite.copying import DescriptorBank
from bench.suite.embedding import Embedding
from bench.suite.motions import Motions
from bench.suite.scores.base import Labelled, Reference
from bench.suite.scores.distances import floors
from bench.suite.setting import Setting
from reports.bootstrap import cluster_counts
from reports.records import digest_of

REFERENCE_VERSION = 2
REAL_STRIDE_FRAMES = 16
JUDGE_STRIDE_FRAMES = 32
CONDITIONAL_COMPONENTS = 16

Embed = Callable[[Motions], Embedding]


def reference_key(setting: Setting, judges_digest: str) -> str:
    """Key of a stored reference."""
    return digest_of(
        {
            "version": REFERENCE_VERSION,
            "dataset": setting.dataset.digest,
            "split": setting.split.digest,
            "tasks": setting.tasks_digest,
            "judges": judges_digest,
        }
    )


def build_reference(setting: Setting, embed: Embed, folder: Path) -> dict[str, Any]:
    """Compute a reference and store its arrays into an empty folder."""
    real = windows_of(setting.part("real"), REAL_STRIDE_FRAMES)
    floor = _floor_windows(setting)
    judge_part = embed(windows_of(setting.part("judge"), JUDGE_STRIDE_FRAMES))
    fit_bank = DescriptorBank.of(setting.part("fit"), 1)
    test_bank = DescriptorBank.of(setting.part("test"), 1)
    test_windows = windows_of(setting.part("test"), JUDGE_STRIDE_FRAMES).window_features()[..., :3]
    threshold = copy_threshold(fit_bank.nearest(pose_descriptors(test_windows)))
    jerk = jerk_per_sample(floor.world_positions(), floor.fps, joints=_real_joints(floor))
    for name, motions in (("real", real), ("floor", floor)):
        (folder / name).mkdir()
        embed(motions).save(folder / name)
        contents = label_indices(motions.contents, setting.dataset.content_labels)
        styles = label_indices(motions.styles, setting.dataset.style_labels)
        np.savez(folder / name / "labels.npz", contents=contents, styles=styles)
    components = {
        f"{kind}{seed}": PrincipalComponents.fit(features[seed].astype(np.float64), CONDITIONAL_COMPONENTS)
        for kind, features in (("style", judge_part.style_features), ("content", judge_part.content_features))
        for seed in range(judge_part.n_seeds)
    }
    np.savez(folder / "components.npz", **_component_arrays(components))  # type: ignore[arg-type]
    for name, bank in (("fit_bank", fit_bank), ("test_bank", test_bank)):
        np.savez(folder / f"{name}.npz", descriptors=bank.descriptors, take_index=bank.take_index,
                 take_ids=np.array(bank.take_ids))  # fmt: skip
    np.save(folder / "floor_jerk.npy", jerk)
    facts: dict[str, Any] = {"copy_threshold": threshold, "n_seeds": judge_part.n_seeds, "floors": {}}
    whole = load_reference(
        folder,
        facts,
        tasks=setting.tasks,
        content_labels=setting.dataset.content_labels,
        style_labels=setting.dataset.style_labels,
        protocol_id=setting.protocol.protocol_id,
    )
    return facts | {"floors": floors(whole)}


def load_reference(
    folder: Path,
    facts: dict[str, Any],
    *,
    tasks: Sequence[Task],
    content_labels: tuple[str, ...],
    style_labels: tuple[str, ...],
    protocol_id: str,
) -> Reference:
    """Restore a stored reference; the facts are those :func:`build_reference` returned."""
    with np.load(folder / "components.npz", allow_pickle=False) as stored:
        components = {
            name: PrincipalComponents(
                stored[f"{name}.mean"], stored[f"{name}.directions"], float(stored[f"{name}.share"])
            )
            for name in {key.split(".")[0] for key in stored.files}
        }
    seeds = range(int(facts["n_seeds"]))
    clusters = np.array([task.content_take_id for task in tasks])
    return Reference(
        tasks=tasks,
        content_labels=content_labels,
        style_labels=style_labels,
        real=_labelled(folder / "real"),
        floor=_labelled(folder / "floor"),
        style_components=tuple(components[f"style{seed}"] for seed in seeds),
        content_components=tuple(components[f"content{seed}"] for seed in seeds),
        fit_bank=_bank(folder / "fit_bank.npz"),
        test_bank=_bank(folder / "test_bank.npz"),
        copy_threshold=float(facts["copy_threshold"]),
        floor_jerk=np.load(folder / "floor_jerk.npy", allow_pickle=False),
        floors=facts["floors"],
        counts=cluster_counts(clusters, seed=stable_seed("bootstrap", protocol_id)),
    )


def windows_of(takes: Sequence[Take], stride_frames: int) -> Motions:
    """All 64-frame windows of some takes, one every ``stride_frames``."""
    return Motions.of([take.with_clip(part) for take in takes for _, part in windows(take.clip, stride=stride_frames)])


def label_indices(labels: Iterable[str], known: Sequence[str]) -> IntArray:
    """Position of each label among the known ones, ``[n]``."""
    index = {label: position for position, label in enumerate(known)}
    return np.array([index[str(label)] for label in labels], dtype=np.int64)


def _floor_windows(setting: Setting) -> Motions:
    fit = setting.part("fit")
    rng = np.random.default_rng(stable_seed("floor", setting.protocol.protocol_id, setting.dataset.digest))
    n_frames = setting.protocol.window_frames
    return Motions.of([random_window(fit, n_frames, rng) for _ in setting.tasks])


def _real_joints(motions: Motions) -> tuple[int, ...]:
    return tuple(np.flatnonzero(~motions.virtual.any(axis=0)).tolist())


def _component_arrays(components: dict[str, PrincipalComponents]) -> dict[str, FloatArray]:
    arrays: dict[str, FloatArray] = {}
    for name, component in components.items():
        arrays[f"{name}.mean"] = component.mean
        arrays[f"{name}.directions"] = component.directions
        arrays[f"{name}.share"] = np.array(component.explained_share)
    return arrays


def _labelled(folder: Path) -> Labelled:
    with np.load(folder / "labels.npz", allow_pickle=False) as stored:
        return Labelled(Embedding.load(folder), stored["contents"], stored["styles"])


def _bank(path: Path) -> DescriptorBank:
    with np.load(path, allow_pickle=False) as stored:
        return DescriptorBank(stored["descriptors"], stored["take_index"], tuple(str(t) for t in stored["take_ids"]))
