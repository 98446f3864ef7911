"""Training and measuring the judges of one dataset and split; :mod:`bench.suite.judges` is the door to it."""

from __future__ import annotations

import platform
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.metadata import version

import numpy as np
from numpy.typing import NDArray

from bench.arrays import IntArray
from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.split import Split, leak
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.edit import mirror, windows
from bench.motion.representation import JUDGE_SLICES, window_frame
from bench.motion.skeleton import CANONICAL_PARENTS, N_JOINTS
from bench.suite.judge_card import (
    AutoencoderFacts,
    ClassifierFacts,
    JudgeCard,
    OtherSplit,
    Repeat,
    recognition,
    within_session,
)
from classifiers.autoencoder import Autoencoder, AutoencoderConfig, Encoder
from classifiers.checkpoint import checkpoint_of
from classifiers.embed import Classified, classify, encode, reconstruction_angle_deg
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.temporal import Temporal, TemporalConfig
from classifiers.train import History, TrainingConfig, train_autoencoder, train_classifier, train_temporal

WINDOW_FRAMES = 64
STRIDE_FRAMES = 32
CENTRE = slice(20, 44)
"""The 24 frames of a window that the auto-encoder reads."""


CLASSIFIER_TRAINING = TrainingConfig(n_steps=200)
AUTOENCODER_TRAINING = TrainingConfig(n_steps=1000, batch_size=32, peak_rate=4e-3)


@dataclass(frozen=True)
class JudgeRecipe:
    """How judges are trained: the defaults are the canonical judges'."""

    classifier: TrainingConfig = CLASSIFIER_TRAINING
    autoencoder: TrainingConfig = AUTOENCODER_TRAINING


@dataclass(frozen=True, eq=False)
class Trained:
    """Networks by seed, for each target, and the card that describes them."""

    classifiers: dict[str, tuple[Stgcn, ...]]
    encoders: tuple[Encoder, ...]
    card: JudgeCard


def centre_rotations(features: NDArray[np.floating]) -> NDArray[np.floating]:
    """The auto-encoder's input ``[n, 24, 21, 4]`` out of judge features ``[n, 64, 21, 7]``."""
    return features[:, CENTRE, :, JUDGE_SLICES["rotation_wxyz"]]


def joint_positions(features: NDArray[np.floating]) -> NDArray[np.floating]:
    """The second family's input ``[n, 64, 21, 3]`` out of judge features ``[n, 64, 21, 7]``."""
    return features[..., JUDGE_SLICES["position_statures"]]


def train_all(
    dataset: Dataset,
    split: Split,
    seeds: Sequence[int],
    recipe: JudgeRecipe,
    *,
    unseen: Sequence[Take] = (),
    progress: ProgressCallback | None = None,
) -> Trained:
    """Train every judge on the split's judge part, measure it on the test and real parts; no gate."""
    parts = _Parts.of(dataset, split, unseen)
    classifiers: dict[str, tuple[Stgcn, ...]] = {}
    facts: list[ClassifierFacts] = []
    for target in _targets(dataset):
        runs = [_train_classifier(parts, dataset, target, seed, recipe, progress) for seed in seeds]
        classifiers[target] = tuple(model for model, _ in runs)
        facts += [_classifier_facts(*run, parts, target, seed) for run, seed in zip(runs, seeds, strict=True)]
    coded = [_train_autoencoder(parts, seed, recipe, progress) for seed in seeds]
    coder_facts = [_autoencoder_facts(*run, parts, seed) for run, seed in zip(coded, seeds, strict=True)]
    found = leak(dataset.takes, split)
    card = JudgeCard(
        dataset_id=dataset.dataset_id, dataset_digest=dataset.digest, licence=dataset.licence,
        citation=dataset.citation, split_kind=split.kind, split_seed=split.seed, split_digest=split.digest,
        leak_share=_finite(found.share), leak_chance=_finite(found.chance),
        n_training_windows=len(parts.judge.features), content_labels=dataset.content_labels,
        style_labels=dataset.style_labels,
        native_labels=dataset.native_content_labels if "native" in classifiers else (),
        classifiers=tuple(facts), autoencoders=tuple(coder_facts), versions=_versions(),
    )  # fmt: skip
    return Trained(classifiers, tuple(model.encoder for model, _ in coded), card)


def train_second(
    dataset: Dataset,
    split: Split,
    seeds: Sequence[int],
    recipe: JudgeRecipe,
    *,
    unseen: Sequence[Take] = (),
    progress: ProgressCallback | None = None,
) -> tuple[dict[str, tuple[Temporal, ...]], tuple[ClassifierFacts, ...]]:
    """Train the second family on the same windows and in the same way; its networks by target, and its facts."""
    parts = _Parts.of(dataset, split, unseen)
    nets: dict[str, tuple[Temporal, ...]] = {}
    facts: list[ClassifierFacts] = []
    for target in ("content", "style"):
        runs = []
        for seed in seeds:
            windows, labels = _training_set(parts, dataset, target)
            network = TemporalConfig(N_JOINTS, len(_targets(dataset)[target]))
            step = _step_callback(progress, f"second {target} judge {seed}")
            runs.append(train_temporal(joint_positions(windows), labels, network, recipe.classifier, seed=seed,
                                       progress=step))  # fmt: skip
        nets[target] = tuple(model for model, _ in runs)
        facts += [_classifier_facts(*run, parts, target, seed) for run, seed in zip(runs, seeds, strict=True)]
    return nets, tuple(facts)


def measure_split(
    dataset: Dataset,
    split: Split,
    seeds: Sequence[int],
    recipe: JudgeRecipe,
    *,
    progress: ProgressCallback | None = None,
) -> tuple[OtherSplit, ...]:
    """Accuracy of classifiers trained in the same way on another split; the networks are thrown away."""
    parts = _Parts.of(dataset, split, ())
    found = leak(dataset.takes, split)
    rows = []
    for target in _targets(dataset):
        for seed in seeds:
            model, history = _train_classifier(parts, dataset, target, seed, recipe, progress)
            facts = _classifier_facts(model, history, parts, target, seed)
            rows.append(OtherSplit(
                kind=split.kind, target=target, seed=seed, accuracy=facts.pooled.accuracy,
                balanced_accuracy=facts.pooled.balanced_accuracy, leak_share=_finite(found.share),
                leak_chance=_finite(found.chance),
            ))  # fmt: skip
    return tuple(rows)


def train_again(
    dataset: Dataset, split: Split, known: ClassifierFacts, model: Stgcn, recipe: JudgeRecipe, condition: str
) -> Repeat:
    """Train one classifier once more and compare it with the first result."""
    parts = _Parts.of(dataset, split, ())
    other, history = _train_classifier(parts, dataset, known.target, known.seed, recipe, None)
    facts = _classifier_facts(other, history, parts, known.target, known.seed)
    same = classify(other, parts.held_out).predicted == classify(model, parts.held_out).predicted
    return Repeat(
        condition=condition, same_bytes=facts.digest == known.digest, same_predictions=100.0 * float(np.mean(same)),
        accuracy=facts.pooled.accuracy,
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Windows:
    """Windows of some takes ``[n, 64, 21, 7]`` with the class indices of each target."""

    features: NDArray[np.float32]
    index: dict[str, IntArray]
    sessions: list[str | None]

    @classmethod
    def of(cls, dataset: Dataset, takes: Sequence[Take]) -> _Windows:
        by_take = [_window_features(take) for take in takes]
        owners = [take for take, own in zip(takes, by_take, strict=True) for _ in own]
        judged = [dataset.judged_content.get(str(take.content)) for take in owners]
        index = {
            "content": _indices(dataset.content_labels, judged),
            "style": _indices(dataset.style_labels, [take.style for take in owners]),
            "native": _indices(dataset.native_content_labels, [take.content for take in owners]),
        }
        return cls(np.concatenate(by_take), index, [take.session for take in owners])


@dataclass(frozen=True, eq=False)
class _Parts:
    """What training and measuring need of a split; ``mirrored`` is the judge part with left and right exchanged."""

    judge: _Windows
    mirrored: _Windows
    test: _Windows
    real: _Windows
    unseen: _Windows | None

    @classmethod
    def of(cls, dataset: Dataset, split: Split, unseen: Sequence[Take]) -> _Parts:
        judge, test, real = (
            _Windows.of(dataset, split.select(dataset.takes, part)) for part in ("judge", "test", "real")
        )
        mirrored = _Windows.of(
            dataset, [take.with_clip(mirror(take.clip)) for take in split.select(dataset.takes, "judge")]
        )
        return cls(judge, mirrored, test, real, _Windows.of(dataset, unseen) if unseen else None)

    @property
    def held_out(self) -> NDArray[np.float32]:
        return np.concatenate([self.test.features, self.real.features])


def _window_features(take: Take) -> NDArray[np.float32]:
    parts = [part for _, part in windows(take.clip, WINDOW_FRAMES, STRIDE_FRAMES)]
    rotations, roots = (np.stack([getattr(part, name) for part in parts]) for name in ("rotations_wxyz", "root_xyz_m"))
    return np.concatenate(window_frame(rotations, roots, take.clip.skeleton), axis=-1).astype(np.float32)


def _indices(labels: tuple[str, ...], found: Sequence[str | None]) -> IntArray:
    place = {label: index for index, label in enumerate(labels)}
    unknown = sorted({str(label) for label in found if label not in place})
    if unknown:
        raise BadData(f"judges need every take labelled with one of {', '.join(labels)}; got {', '.join(unknown)}")
    return np.array([place[str(label)] for label in found], dtype=np.int64)


def _targets(dataset: Dataset) -> dict[str, tuple[str, ...]]:
    merged = len(dataset.native_content_labels) != len(dataset.content_labels)
    targets = {"content": dataset.content_labels, "style": dataset.style_labels}
    return targets | ({"native": dataset.native_content_labels} if merged else {})


def _train_classifier(
    parts: _Parts, dataset: Dataset, target: str, seed: int, recipe: JudgeRecipe, progress: ProgressCallback | None
) -> tuple[Stgcn, History]:
    network = StgcnConfig(CANONICAL_PARENTS, len(_targets(dataset)[target]))
    step = _step_callback(progress, f"{target} judge {seed}")
    return train_classifier(
        *_training_set(parts, dataset, target), network, recipe.classifier, seed=seed, progress=step
    )


def _training_set(parts: _Parts, dataset: Dataset, target: str) -> tuple[NDArray[np.float32], IntArray]:
    """Windows and class indices of the judge part, mirrored too unless a label names a side."""
    sources = (parts.judge,) if _name_a_side(_targets(dataset)[target]) else (parts.judge, parts.mirrored)
    features = np.concatenate([source.features for source in sources])
    return features, np.concatenate([source.index[target] for source in sources])


def _name_a_side(labels: Sequence[str]) -> bool:
    """True where a label would be wrong on a mirrored motion."""
    return any(side in label.lower() for label in labels for side in ("left", "right"))


def _train_autoencoder(
    parts: _Parts, seed: int, recipe: JudgeRecipe, progress: ProgressCallback | None
) -> tuple[Autoencoder, History]:
    rotations = centre_rotations(parts.judge.features)
    step = _step_callback(progress, f"auto-encoder {seed}")
    return train_autoencoder(rotations, AutoencoderConfig(N_JOINTS), recipe.autoencoder, seed=seed, progress=step)


def _classifier_facts(
    model: Stgcn | Temporal, history: History, parts: _Parts, target: str, seed: int
) -> ClassifierFacts:
    judged = _judged(model, parts.held_out)
    true = np.concatenate([parts.test.index[target], parts.real.index[target]])
    right = judged.predicted == true
    n_test = len(parts.test.features)
    session = None
    if target == "style":
        session = within_session(true, judged.log_probabilities, [*parts.test.sessions, *parts.real.sessions])
    unseen = None
    if parts.unseen is not None:
        unseen = _percent(_judged(model, parts.unseen.features).predicted == parts.unseen.index[target])
    family, prefix = ("temporal", "temporal-") if isinstance(model, Temporal) else ("stgcn", "")
    judge_id = f"{family}-{target}/{seed}"
    return ClassifierFacts(
        id=judge_id, target=target, seed=seed, file=f"{prefix}{target}-{seed}.safetensors",
        digest=checkpoint_of(model, judge_id).digest, parameters=model.n_parameters,
        training_seconds=history.seconds, pooled=recognition(true, judged.predicted, model.config.n_classes),
        test_accuracy=_percent(right[:n_test]), real_accuracy=_percent(right[n_test:]),
        within_session_accuracy=session[0] if session else None,
        within_session_chance=session[1] if session else None, unseen_actor_accuracy=unseen,
    )  # fmt: skip


def _judged(model: Stgcn | Temporal, features: NDArray[np.float32]) -> Classified:
    return classify(model, joint_positions(features) if isinstance(model, Temporal) else features)


def _autoencoder_facts(model: Autoencoder, history: History, parts: _Parts, seed: int) -> AutoencoderFacts:
    encoded = encode(model.encoder, centre_rotations(parts.judge.features))
    share = encoded.components.var(axis=0).sum() / encoded.activations.var(axis=0).sum()
    judge_id = f"autoencoder/{seed}"
    return AutoencoderFacts(
        id=judge_id, seed=seed, file=f"autoencoder-{seed}.safetensors",
        digest=checkpoint_of(model.encoder, judge_id).digest, parameters=model.encoder.n_parameters,
        training_seconds=history.seconds,
        angle_deg=reconstruction_angle_deg(model, centre_rotations(parts.held_out)),
        components_share=100.0 * float(share),
    )  # fmt: skip


def _percent(right: NDArray[np.bool_]) -> float:
    return 100.0 * float(np.mean(right))


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), "torch": version("torch"), "numpy": version("numpy")}


def _step_callback(progress: ProgressCallback | None, what: str) -> Callable[[int, int], None] | None:
    if progress is None:
        return None
    report = progress
    return lambda done, total: report(what, done, total)
