"""The judges of a dataset: the one place where they are trained, stored, loaded and asked.

Three seeds each of a content and a style ST-GCN, of a second content ST-GCN on the native labels where these were
merged for judging, and of the denoising auto-encoder. *Canonical* judges come with this package and answer for one
dataset digest and one split; all others are *local*.

Maintainers make canonical judges with :mod:`bench.suite.make_judges`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

import classifiers
from bench.arrays import finite_array
from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.split import Split
from bench.datasets.take import Take
from bench.errors import JudgeRefused
from bench.motion.skeleton import N_JOINTS
from bench.suite.embedding import Embedding
from bench.suite.judge_card import JudgeCard, check_gate, to_markdown
from bench.suite.judge_training import (
    WINDOW_FRAMES,
    JudgeRecipe,
    Trained,
    centre_rotations,
    train_all,
)
from classifiers.autoencoder import Encoder
from classifiers.checkpoint import BadCheckpoint, checkpoint_of, load_classifier, load_encoder, write_checkpoint
from classifiers.embed import Classified, Encoded, classify, encode
from classifiers.stgcn import Stgcn
from reports.records import JudgeFacts, write_text_atomically

SEEDS = (0, 1, 2)
PRETRAINED = Path(classifiers.__file__).parent / "pretrained"
CARD_FILE = "card.json"
CANONICAL_RECIPE = JudgeRecipe()

Origin = Literal["canonical", "local"]
Model = TypeVar("Model")


@dataclass(frozen=True, eq=False)
class JudgeOutputs:
    """What every judge says about n windows; one entry a seed in each tuple."""

    content: tuple[Classified, ...]
    style: tuple[Classified, ...]
    native: tuple[Classified, ...]
    encoded: tuple[Encoded, ...]

    @property
    def embedding(self) -> Embedding:
        """The same as stacked arrays, as they are stored."""
        return Embedding(
            content_features=np.stack([out.features for out in self.content]).astype(np.float32),
            style_features=np.stack([out.features for out in self.style]).astype(np.float32),
            content_log_probabilities=np.stack([out.log_probabilities for out in self.content]).astype(np.float32),
            style_log_probabilities=np.stack([out.log_probabilities for out in self.style]).astype(np.float32),
            autoencoder_components=np.stack([out.components for out in self.encoded]).astype(np.float32),
        )


@dataclass(frozen=True, eq=False)
class JudgeSet:
    """All judges of one dataset and split.

    Attributes
    ----------
    content, style : classifiers by seed, over ``Dataset.content_labels`` and ``style_labels``.
    native : classifiers over the native contents; empty where these are the judged ones.
    encoders : auto-encoders by seed.
    card : what is known about them.
    origin : ``canonical`` or ``local``.
    """

    content: tuple[Stgcn, ...]
    style: tuple[Stgcn, ...]
    native: tuple[Stgcn, ...]
    encoders: tuple[Encoder, ...]
    card: JudgeCard
    origin: Origin

    @property
    def digest(self) -> str:
        """Digest of all judges, through their own digests."""
        return self.card.digest

    @property
    def facts(self) -> tuple[JudgeFacts, ...]:
        """What a record says about its judges."""
        named = [
            JudgeFacts(
                id=judge.id,
                digest=judge.digest,
                origin=self.origin,
                real_accuracy=judge.pooled.accuracy,
                chance=judge.pooled.chance,
                majority_rate=judge.pooled.majority_rate,
            )
            for judge in self.card.classifiers
            if judge.target != "native"
        ]
        coders = [JudgeFacts(id=a.id, digest=a.digest, origin=self.origin) for a in self.card.autoencoders]
        return (*named, *coders)

    def evaluate(self, features: NDArray[np.floating]) -> JudgeOutputs:
        """Ask every judge about windows ``[n, 64, 21, 7]`` as ``Motions.window_features`` gives them.

        Raises
        ------
        BadInput : another shape, NaN or Inf.
        """
        checked = finite_array(features, "features", (None, WINDOW_FRAMES, N_JOINTS, 7)).astype(np.float32)
        return JudgeOutputs(
            tuple(classify(model, checked) for model in self.content),
            tuple(classify(model, checked) for model in self.style),
            tuple(classify(model, checked) for model in self.native),
            tuple(encode(model, centre_rotations(checked)) for model in self.encoders),
        )


def train_judges(
    dataset: Dataset,
    split: Split,
    *,
    seeds: Sequence[int] = SEEDS,
    recipe: JudgeRecipe = CANONICAL_RECIPE,
    unseen: Sequence[Take] = (),
    progress: ProgressCallback | None = None,
) -> JudgeSet:
    """Train all judges of a dataset on the split's judge part and measure them on its test and real parts.

    Parameters
    ----------
    dataset, split : the data; labels are the dataset's judged and native contents and its styles.
    seeds : one judge of every kind for each.
    recipe : how long and how hard; the canonical judges' unless a test wants it quicker.
    unseen : takes of actors that no part holds, measured beside the rest.
    progress : called with what is being trained and the optimiser steps done.

    Raises
    ------
    JudgeRefused : a judge is too poor, see ``judge_card.check_gate``.
    BadData : a take without labels.
    """
    trained = train_all(dataset, split, seeds, recipe, unseen=unseen, progress=progress)
    check_gate(trained.card)
    return judge_set(trained)


def judge_set(trained: Trained, origin: Origin = "local") -> JudgeSet:
    """Trained networks as something that can be asked."""
    nets = trained.classifiers
    return JudgeSet(nets["content"], nets["style"], nets.get("native", ()), trained.encoders, trained.card, origin)


def load_canonical(dataset_id: str, dataset_digest: str, split_digest: str) -> JudgeSet | None:
    """The judges that came with this package, or ``None`` where there are none for exactly this data and split.

    Raises
    ------
    JudgeRefused : their files do not fit their card.
    """
    folder = PRETRAINED / dataset_id
    if not (folder / CARD_FILE).is_file():
        return None
    card = read_card(folder)
    if (card.dataset_digest, card.split_digest) != (dataset_digest, split_digest):
        return None
    return load_judges(folder, "canonical")


def save_judges(folder: Path, judges: JudgeSet) -> None:
    """Store judges and their card (JSON and Markdown) in a folder; ``card.json`` is written last."""
    card = judges.card
    facts = (*card.of("content"), *card.of("style"), *card.of("native"))
    for fact, model in zip(facts, (*judges.content, *judges.style, *judges.native), strict=True):
        write_checkpoint(folder / fact.file, checkpoint_of(model, fact.id))
    for coder, encoder in zip(card.autoencoders, judges.encoders, strict=True):
        write_checkpoint(folder / coder.file, checkpoint_of(encoder, coder.id))
    write_text_atomically(folder / "card.md", to_markdown(card))
    write_text_atomically(folder / CARD_FILE, card.model_dump_json(indent=1) + "\n")


def load_judges(folder: Path, origin: Origin = "local") -> JudgeSet:
    """Read what :func:`save_judges` stored.

    Raises
    ------
    JudgeRefused : a file is missing, damaged, or not the one its card names, or a judge is below its gate.
    """
    card = read_card(folder)
    check_gate(card)
    nets = {
        target: tuple(load_checked(folder / fact.file, fact.digest, load_classifier) for fact in card.of(target))
        for target in ("content", "style", "native")
    }
    encoders = tuple(load_checked(folder / fact.file, fact.digest, load_encoder) for fact in card.autoencoders)
    return judge_set(Trained(nets, encoders, card), origin)


def read_card(folder: Path) -> JudgeCard:
    """The card of the judges stored in a folder.

    Raises
    ------
    JudgeRefused : missing or damaged.
    """
    path = folder / CARD_FILE
    try:
        return JudgeCard.model_validate_json(path.read_text(encoding="utf-8"))
    except (OSError, ValidationError) as error:
        raise JudgeRefused(f"judge card cannot be read: {str(error).splitlines()[0]}", where=str(path)) from error


def load_checked(path: Path, digest: str, load: Callable[[Path], tuple[Model, str]]) -> Model:
    """The network of a judge file whose digest must be the one that the card names.

    Raises
    ------
    JudgeRefused : missing, damaged, or another judge.
    """
    try:
        model, found = load(path)
    except BadCheckpoint as error:
        raise JudgeRefused(str(error), remedy="restore the file, or train local judges") from error
    if found != digest:
        raise JudgeRefused(
            f"judge has digest {found}, its card names {digest}",
            where=str(path),
            cause="a judge file was replaced without its card",
            remedy="restore both, or train local judges",
        )
    return model
