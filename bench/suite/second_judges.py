"""The second judge family: convolutions over time on joint positions, a check on the first and no part of any number.

Its files lie beside the canonical judges' and are named on their card, but no digest of the judges covers them: records
that rest on the first family stay what they are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.datasets.base import Dataset, ProgressCallback
from bench.datasets.split import Split
from bench.datasets.take import Take
from bench.errors import JudgeRefused
from bench.suite.embedding import Embedding
from bench.suite.judge_card import ClassifierFacts, refuse_poor, to_markdown
from bench.suite.judge_training import JudgeRecipe, joint_positions, train_second
from bench.suite.judges import CANONICAL_RECIPE, CARD_FILE, SEEDS, load_checked, read_card
from bench.suite.judging import stored_answers
from bench.suite.motions import Motions
from bench.suite.store import Store
from classifiers.checkpoint import checkpoint_of, load_temporal, write_checkpoint
from classifiers.embed import Classified, classify
from classifiers.temporal import Temporal
from reports.records import digest_of, write_text_atomically


@dataclass(frozen=True, eq=False)
class SecondJudges:
    """The second family of one dataset and split.

    Attributes
    ----------
    content, style : classifiers by seed, over the labels of the first family's card.
    facts : what is known about them, contents first.
    """

    content: tuple[Temporal, ...]
    style: tuple[Temporal, ...]
    facts: tuple[ClassifierFacts, ...]

    @property
    def digest(self) -> str:
        """Digest of all of them, through their own digests."""
        return digest_of({judge.id: judge.digest for judge in self.facts})

    def evaluate(self, features: NDArray[np.floating]) -> Embedding:
        """Ask every judge about windows ``[n, 64, 21, 7]``; this family has no auto-encoder, so no components.

        Raises
        ------
        BadArray : windows that do not fit the networks.
        """
        positions = joint_positions(features)
        content, style = ([classify(model, positions) for model in nets] for nets in (self.content, self.style))
        return Embedding(
            content_features=_stacked(content, "features"),
            style_features=_stacked(style, "features"),
            content_log_probabilities=_stacked(content, "log_probabilities"),
            style_log_probabilities=_stacked(style, "log_probabilities"),
            autoencoder_components=np.zeros((len(content), len(positions), 0), dtype=np.float32),
        )

    def stored_embedding(self, motions: Motions, store: Store) -> Embedding:
        """What they say about a set of motions, asked once."""
        return stored_answers(self.digest, lambda: self.evaluate(motions.window_features()), motions, store)


def train_second_judges(
    dataset: Dataset,
    split: Split,
    *,
    seeds: Sequence[int] = SEEDS,
    recipe: JudgeRecipe = CANONICAL_RECIPE,
    unseen: Sequence[Take] = (),
    progress: ProgressCallback | None = None,
) -> SecondJudges:
    """Train the second family on the split's judge part, as ``judges.train_judges`` trains the first.

    Raises
    ------
    JudgeRefused : one is too poor, see ``judge_card.check_gate``.
    """
    nets, facts = train_second(dataset, split, seeds, recipe, unseen=unseen, progress=progress)
    refuse_poor(facts, f"second family, {dataset.dataset_id}, {split.kind} split")
    return SecondJudges(nets["content"], nets["style"], facts)


def save_second_judges(folder: Path, judges: SecondJudges) -> None:
    """Store them in the folder of a first family, whose card then names them.

    Raises
    ------
    JudgeRefused : no card of a first family lies there.
    """
    card = read_card(folder)
    for fact, model in zip(judges.facts, (*judges.content, *judges.style), strict=True):
        write_checkpoint(folder / fact.file, checkpoint_of(model, fact.id))
    card = card.model_copy(update={"second": judges.facts})
    write_text_atomically(folder / "card.md", to_markdown(card))
    write_text_atomically(folder / CARD_FILE, card.model_dump_json(indent=1) + "\n")


def load_second_judges(folder: Path) -> SecondJudges:
    """Read what :func:`save_second_judges` stored.

    Raises
    ------
    JudgeRefused : the card names none, a file is missing, damaged or another one, or a judge is below its gate.
    """
    card = read_card(folder)
    if not card.second:
        raise JudgeRefused(
            "there is no second judge family",
            where=str(folder),
            cause="judges trained on this machine have none",
            remedy="use data and split of canonical judges",
        )
    refuse_poor(card.second, f"second family, {card.dataset_id}, {card.split_kind} split")
    content, style = (
        tuple(
            load_checked(folder / fact.file, fact.digest, load_temporal)
            for fact in card.second
            if fact.target == target
        )
        for target in ("content", "style")
    )
    return SecondJudges(content, style, card.second)


def _stacked(judged: Sequence[Classified], name: str) -> NDArray[np.float32]:
    return np.stack([getattr(out, name) for out in judged]).astype(np.float32)
