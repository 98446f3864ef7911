"""Building, storing and restoring what all rows of a setting are scored against."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import fields
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bench.adapters.oracles import random_window
from bench.arrays import FloatArray, IntArray
from bench.datasets.take import Take
from bench.metrics.frechet import PrincipalComponents
from bench.metrics.memorisation import copy_threshold, pose_descriptors
from bench.metrics.physics import jerk_per_sample
from bench.motion.edit import windows
from bench.protocols.base import Protocol, stable_seed
from bench.protocols.transfer import WINDOW_FRAMES
from bench.suite.copying import DescriptorBank
from bench.suite.embedding import Embedding
from bench.suite.judges import JudgeSet
from bench.suite.motions import Motions
from bench.suite.scores import papers
from bench.suite.scores.base import Basis, Labelled, Reference
from bench.suite.scores.distances import floors
from bench.suite.setting import Setting
from reports.bootstrap import cluster_counts
from reports.records import digest_of

REFERENCE_VERSION = 3
REAL_STRIDE_FRAMES = 16
JUDGE_STRIDE_FRAMES = 32
LABELS_FILE, JERK_FILE, COMPONENTS_FILE = "labels.npz", "floor_jerk.npy", "components.npz"
FIT_BANK_FILE, TEST_BANK_FILE, ACTIVATIONS_FILE = "fit_bank.npz", "test_bank.npz", "activations.npz"
CONDITIONAL_COMPONENTS = 16

Embed = Callable[[Motions], Embedding]


def reference_key(setting: Setting, judges_digest: str) -> str:
    """Key of a stored reference; ``judges_digest`` is empty where no judge takes part."""
    return digest_of(
        {
            "version": REFERENCE_VERSION,
            "protocol": setting.protocol.label,
            "profile": setting.profile,
            "dataset": setting.dataset.digest,
            "split": setting.split.digest,
            "tasks": setting.tasks_digest,
            "judges": judges_digest,
        }
    )


def build_reference(setting: Setting, judges: JudgeSet, embed: Embed, basis: Basis, folder: Path) -> dict[str, Any]:
    """Compute what a judged protocol is scored against and store it into an empty folder."""
    protocol = setting.protocol
    real = windows_of(setting.part(*protocol.real_parts), REAL_STRIDE_FRAMES)
    floor = floor_windows(setting, len(basis.tasks))
    for name, motions in (("real", real), ("floor", floor)):
        (folder / name).mkdir()
        embed(motions).save(folder / name)
        contents = label_indices(motions.contents, setting.dataset.content_labels)
        styles = label_indices(motions.styles, setting.dataset.style_labels)
        np.savez(folder / name / LABELS_FILE, contents=contents, styles=styles)
    jerk = jerk_per_sample(floor.world_positions(), floor.fps, joints=floor.real_joints)
    np.save(folder / JERK_FILE, jerk)
    facts: dict[str, Any] = {"floors": {}, "copy_threshold": 0.0}
    if "conditional_fmd" in protocol.metrics:
        _store_components(setting, embed, folder)
    if "copied_share" in protocol.metrics:
        facts["copy_threshold"] = _store_banks(setting, folder)
    whole = load_reference(folder, facts, basis, judges)
    facts["floors"] = floors(whole, protocol.metrics)
    if any(name in papers.CUT_OF for name in protocol.metrics):
        activations = _activations(judges, real)
        np.savez(folder / ACTIVATIONS_FILE, **activations)  # type: ignore[arg-type]
        facts["floors"] |= papers.activation_floors(activations, _activations(judges, floor))
    return facts


def _store_components(setting: Setting, embed: Embed, folder: Path) -> None:
    judge_part = embed(windows_of(setting.part("judge"), JUDGE_STRIDE_FRAMES))
    components = {
        f"{kind}{seed}": PrincipalComponents.fit(features[seed].astype(np.float64), CONDITIONAL_COMPONENTS)
        for kind, features in (("style", judge_part.style_features), ("content", judge_part.content_features))
        for seed in range(judge_part.n_seeds)
    }
    np.savez(folder / COMPONENTS_FILE, **_component_arrays(components))  # type: ignore[arg-type]


def _store_banks(setting: Setting, folder: Path) -> float:
    """Descriptors of the motion that methods were given; returns the distance below which an output is a copy."""
    fit_bank = DescriptorBank.of(setting.part("fit"), 1)
    test_bank = DescriptorBank.of(setting.part("test"), 1)
    for name, bank in ((FIT_BANK_FILE, fit_bank), (TEST_BANK_FILE, test_bank)):
        np.savez(folder / name, descriptors=bank.descriptors, take_index=bank.take_index,
                 take_ids=np.array(bank.take_ids))  # fmt: skip
    test_windows = windows_of(setting.part("test"), JUDGE_STRIDE_FRAMES).window_positions
    return copy_threshold(fit_bank.nearest(pose_descriptors(test_windows)))


def _activations(judges: JudgeSet, motions: Motions) -> dict[str, NDArray[np.float32]]:
    """Clip cut -> auto-encoder activations ``[S, m, 512]``."""
    return {cut: papers.activations(judges, motions, cut) for cut in papers.CUTS}


def load_reference(folder: Path, facts: dict[str, Any], basis: Basis, judges: JudgeSet | None) -> Reference:
    """Restore a stored reference; the facts are those :func:`build_reference` returned."""
    components = _components(folder / COMPONENTS_FILE)
    shared = {field.name: getattr(basis, field.name) for field in fields(basis)}
    return Reference(
        **shared,
        real=_labelled(folder / "real"),
        floor=_labelled(folder / "floor"),
        style_components=components["style"],
        content_components=components["content"],
        activations=_arrays(folder / ACTIVATIONS_FILE),
        fit_bank=_bank(folder / FIT_BANK_FILE),
        test_bank=_bank(folder / TEST_BANK_FILE),
        copy_threshold=float(facts["copy_threshold"]),
        floor_jerk=np.load(folder / JERK_FILE, allow_pickle=False),
        floors=facts["floors"],
        judges=judges,
    )


def trials_of(protocol: Protocol, profile: str, clusters: NDArray[np.str_]) -> tuple[IntArray, ...]:
    """The protocol's trials as sample indices: drawn without repeats from a larger pool, else whole clusters with."""
    if profile not in protocol.trials:
        return ()
    trials, n = protocol.trials[profile], len(clusters)
    rng = np.random.default_rng(stable_seed("trials", protocol.label))
    if trials.samples < n:
        return tuple(np.sort(rng.permutation(n)[: trials.samples]) for _ in range(trials.n))
    counts = cluster_counts(clusters, trials.n, seed=stable_seed("trials", protocol.label))
    return tuple(np.repeat(np.arange(n), row) for row in counts)


def windows_of(takes: Sequence[Take], stride_frames: int) -> Motions:
    """All 64-frame windows of some takes, one every ``stride_frames``."""
    return Motions.of([take.with_clip(part) for take in takes for _, part in windows(take.clip, stride=stride_frames)])


def label_indices(labels: Iterable[str], known: Sequence[str]) -> IntArray:
    """Position of each label among the known ones, ``[n]``; -1 for a label of another dataset."""
    index = {label: position for position, label in enumerate(known)}
    return np.array([index.get(str(label), -1) for label in labels], dtype=np.int64)


def floor_windows(setting: Setting, n: int) -> Motions:
    """``n`` windows of other real motion, drawn as sources are."""
    takes = setting.part(*setting.protocol.floor_parts)
    rng = np.random.default_rng(stable_seed("floor", setting.protocol.label, setting.dataset.digest))
    return Motions.of([random_window(takes, WINDOW_FRAMES, rng) for _ in range(n)])


def _component_arrays(components: dict[str, PrincipalComponents]) -> dict[str, FloatArray]:
    arrays: dict[str, FloatArray] = {}
    for name, component in components.items():
        arrays[f"{name}.mean"] = component.mean
        arrays[f"{name}.directions"] = component.directions
        arrays[f"{name}.share"] = np.array(component.explained_share)
    return arrays


def _components(path: Path) -> dict[str, tuple[PrincipalComponents, ...]]:
    """Kind -> components by judge seed; empty where none were stored."""
    stored = _arrays(path)
    found: dict[str, tuple[PrincipalComponents, ...]] = {}
    for kind in ("style", "content"):
        names = sorted({key.split(".")[0] for key in stored if key.startswith(kind)})
        found[kind] = tuple(
            PrincipalComponents(stored[f"{n}.mean"], stored[f"{n}.directions"], float(stored[f"{n}.share"]))
            for n in names
        )
    return found


def _labelled(folder: Path) -> Labelled:
    stored = _arrays(folder / LABELS_FILE)
    return Labelled(Embedding.load(folder), stored["contents"], stored["styles"])


def _bank(path: Path) -> DescriptorBank | None:
    stored = _arrays(path)
    if not stored:
        return None
    return DescriptorBank(stored["descriptors"], stored["take_index"], tuple(str(t) for t in stored["take_ids"]))


def _arrays(path: Path) -> dict[str, NDArray[Any]]:
    """Arrays of a file; none where this protocol's metrics did not need it."""
    if not path.is_file():
        return {}
    with np.load(path, allow_pickle=False) as stored:
        return {name: stored[name] for name in stored.files}
