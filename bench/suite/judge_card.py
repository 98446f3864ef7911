"""Judge cards: how good each judge is on real motion it was not trained on, printed beside every table.

A card is JSON (read back when the judges are loaded) and Markdown (for people). Accuracies are percent of 64-frame
windows, every 32 frames, of the test and real parts pooled, unless a field says otherwise.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict

from bench.arrays import FloatArray, IntArray
from bench.errors import JudgeRefused
from reports.records import digest_of

CLASSIFIER_HEADER = (
    "judge", "accuracy", "test", "real", "balanced", "majority", "chance", "n", "within session", "unseen actors",
    "rank agreement", "parameters", "CPU s", "digest",
)  # fmt: skip
GATES_PERCENT = {"content": 93.0, "style": 95.0}
"""Real accuracy below which a judge is refused; native contents are reported without a gate."""


class _Facts(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class Recognition(_Facts):
    """How a classifier does on real windows."""

    n: int
    accuracy: float
    balanced_accuracy: float
    """mean over classes of the accuracy on that class"""
    majority_rate: float
    """percent of the commonest class in these windows: what a constant answer reaches"""
    chance: float
    """100 / number of classes"""
    confusion: tuple[tuple[int, ...], ...]
    """rows: true class, columns: predicted"""


class ClassifierFacts(_Facts):
    """One classifier, of either family."""

    id: str
    """``stgcn-content/0``: family, target and seed"""
    target: str
    """``content``, ``style`` or ``native``"""
    seed: int
    file: str
    digest: str
    parameters: int
    training_seconds: float
    """CPU seconds on one thread"""
    pooled: Recognition
    """test and real parts together"""
    test_accuracy: float
    real_accuracy: float
    within_session_accuracy: float | None = None
    """style judges: choosing only among the styles recorded in the window's own session; None where unknown"""
    within_session_chance: float | None = None
    unseen_actor_accuracy: float | None = None
    """on actors that no part holds; None where the dataset has none to spare"""
    rank_agreement: float | None = None
    """Kendall's tau between the order in which this judge and the mean of the other family put the rows of a run, by
    recognition of the judge's target; None where it was not measured"""


class AutoencoderFacts(_Facts):
    """One denoising auto-encoder."""

    id: str
    seed: int
    file: str
    digest: str
    parameters: int
    """of the encoder, which alone is kept"""
    training_seconds: float
    angle_deg: float
    """root mean square rotation between clean input and output, test and real parts"""
    components_share: float
    """percent of the variance of the 512 activations in the 32 components, judge part"""


class OtherSplit(_Facts):
    """Accuracy of a judge trained in the same way on another kind of split."""

    kind: str
    target: str
    seed: int
    accuracy: float
    balanced_accuracy: float
    leak_share: float | None
    leak_chance: float | None


class Repeat(_Facts):
    """What training the first content judge again gave."""

    condition: str
    same_bytes: bool
    same_predictions: float
    """percent of test and real windows"""
    accuracy: float


class JudgeCard(_Facts):
    """Everything worth knowing about the judges of one dataset and split."""

    dataset_id: str
    dataset_digest: str
    licence: str
    citation: str
    split_kind: str
    split_seed: int
    split_digest: str
    leak_share: float | None
    """share of test takes whose nearest neighbour of the same labels is in judge or fit"""
    leak_chance: float | None
    n_training_windows: int
    content_labels: tuple[str, ...]
    style_labels: tuple[str, ...]
    native_labels: tuple[str, ...]
    """empty where the native contents are the judged ones"""
    classifiers: tuple[ClassifierFacts, ...]
    autoencoders: tuple[AutoencoderFacts, ...]
    second: tuple[ClassifierFacts, ...] = ()
    """the second family: a check on the first, no part of any number and of no digest of the judges"""
    other_splits: tuple[OtherSplit, ...] = ()
    repeats: tuple[Repeat, ...] = ()
    versions: dict[str, str]

    @property
    def digest(self) -> str:
        """Digest of all judges that numbers rest on, through their own digests."""
        pairs = [(judge.id, judge.digest) for judge in self.classifiers]
        return digest_of(dict(pairs + [(judge.id, judge.digest) for judge in self.autoencoders]))

    def labels(self, target: str) -> tuple[str, ...]:
        """Class names of a target, in index order."""
        return {"content": self.content_labels, "style": self.style_labels, "native": self.native_labels}[target]

    def of(self, target: str) -> tuple[ClassifierFacts, ...]:
        """The classifiers of one target, by seed."""
        return tuple(judge for judge in self.classifiers if judge.target == target)


def check_gate(card: JudgeCard) -> None:
    """Refuse judges that cannot tell real motions apart.

    Raises
    ------
    JudgeRefused : a content or style judge is below its gate on the test and real parts.
    """
    refuse_poor(card.classifiers, f"{card.dataset_id}, {card.split_kind} split")


def refuse_poor(judges: Sequence[ClassifierFacts], where: str) -> None:
    """:func:`check_gate` for some judges.

    Raises
    ------
    JudgeRefused : one is below its gate.
    """
    poor = [
        f"{judge.id} {judge.pooled.accuracy:.1f} % (gate {GATES_PERCENT[judge.target]:.0f} %)"
        for judge in judges
        if judge.target in GATES_PERCENT and judge.pooled.accuracy < GATES_PERCENT[judge.target]
    ]
    if poor:
        raise JudgeRefused(
            f"judges get too few real windows right to score anything: {', '.join(poor)}",
            where=where,
            cause="too little data for each label, labels that windows of 64 frames cannot tell apart, or a hard split",
            remedy="merge labels that look alike, add takes, or use the default split",
        )


def recognition(true: IntArray, predicted: IntArray, n_classes: int) -> Recognition:
    """Accuracy, balanced accuracy, majority rate and confusion from class indices ``[n]``."""
    confusion = np.zeros((n_classes, n_classes), dtype=np.int64)
    np.add.at(confusion, (true, predicted), 1)
    sizes = confusion.sum(axis=1)
    present = sizes > 0
    return Recognition(
        n=len(true),
        accuracy=100.0 * float(np.mean(true == predicted)),
        balanced_accuracy=100.0 * float(np.mean(np.diag(confusion)[present] / sizes[present])),
        majority_rate=100.0 * float(sizes.max() / sizes.sum()),
        chance=100.0 / n_classes,
        confusion=tuple(tuple(int(count) for count in row) for row in confusion),
    )


def within_session(
    true: IntArray, log_probabilities: FloatArray, sessions: Sequence[str | None]
) -> tuple[float, float] | None:
    """Accuracy and chance, percent, when choosing only among the classes seen in the sample's own session.

    Styles recorded in different sessions can be told apart by the session; within one they cannot. Samples without a
    session, or whose session has one class only, are left out; ``None`` where no sample is left.
    """
    names: NDArray[np.str_] = np.array([session or "" for session in sessions])
    hits: list[bool] = []
    chances: list[float] = []
    for session in sorted(set(names.tolist()) - {""}):
        rows = np.flatnonzero(names == session)
        choices = np.unique(true[rows])
        if len(choices) > 1:
            chosen = choices[log_probabilities[np.ix_(rows, choices)].argmax(axis=1)]
            hits.extend((chosen == true[rows]).tolist())
            chances.extend([1.0 / len(choices)] * len(rows))
    return (100.0 * float(np.mean(hits)), 100.0 * float(np.mean(chances))) if hits else None


def to_markdown(card: JudgeCard) -> str:
    """The card for people."""
    leak = "unknown"
    if card.leak_share is not None and card.leak_chance is not None:
        leak = f"{100 * card.leak_share:.0f} % of test takes have their nearest neighbour in judge or fit "
        leak += f"(chance {100 * card.leak_chance:.0f} %)"
    parts = [
        f"# Judges of {card.dataset_id}",
        f"Data: {card.licence}. {card.citation}",
        f"Split: {card.split_kind}, seed {card.split_seed}, digest `{card.split_digest}`; leak: {leak}.",
        f"Trained on {card.n_training_windows} windows of the judge part. Dataset digest `{card.dataset_digest}`, "
        f"judges `{card.digest}`, made with {', '.join(f'{k} {v}' for k, v in sorted(card.versions.items()))}.",
        "## Classifiers",
        "Percent of real windows (test and real parts pooled) recognised.",
        _table(CLASSIFIER_HEADER, [_classifier_row(judge) for judge in card.classifiers]),
        "## Auto-encoders",
        _table(
            ("judge", "angle (deg)", "32 components hold", "parameters", "CPU s", "digest"),
            [(a.id, f"{a.angle_deg:.2f}", f"{a.components_share:.1f} %", str(a.parameters),
              f"{a.training_seconds:.1f}", f"`{a.digest[:12]}`") for a in card.autoencoders],
        ),
    ]  # fmt: skip
    if card.second:
        parts += [
            "## Second family",
            "Convolutions over time on joint positions, trained on the same windows: a check on the first family, "
            "never averaged in. *Rank agreement* is Kendall's tau between the order in which one judge and the mean of "
            "the other family put the rows of a run, by recognition of the judge's target; see docs/trust.md.",
            _table(CLASSIFIER_HEADER, [_classifier_row(judge) for judge in card.second]),
        ]
    if card.other_splits:
        header = ("split", "target", "seed", "accuracy", "balanced", "leak", "leak by chance")
        parts += ["## Other splits", _table(header, [_other_split_row(row) for row in card.other_splits])]
    if card.repeats:
        header_again = ("condition", "same bytes", "same predictions", "accuracy")
        parts += [
            "## Training again",
            "The first content judge, trained once more.",
            _table(header_again, [_repeat_row(row) for row in card.repeats]),
        ]
    for target in ("content", "style", "native"):
        if card.of(target):
            parts += [f"## Confusion, {target}, first seed", _confusion(card, target)]
    return "\n\n".join(parts) + "\n"


def _classifier_row(judge: ClassifierFacts) -> tuple[str, ...]:
    pooled = judge.pooled
    session = "" if judge.within_session_accuracy is None else (
        f"{judge.within_session_accuracy:.1f} (chance {judge.within_session_chance:.0f})"
    )  # fmt: skip
    unseen = "" if judge.unseen_actor_accuracy is None else f"{judge.unseen_actor_accuracy:.1f}"
    agreement = "" if judge.rank_agreement is None else f"{judge.rank_agreement:.2f}"
    return (
        judge.id, f"{pooled.accuracy:.2f}", f"{judge.test_accuracy:.1f}", f"{judge.real_accuracy:.1f}",
        f"{pooled.balanced_accuracy:.1f}", f"{pooled.majority_rate:.1f}", f"{pooled.chance:.1f}", str(pooled.n),
        session, unseen, agreement, str(judge.parameters), f"{judge.training_seconds:.1f}", f"`{judge.digest[:12]}`",
    )  # fmt: skip


def _other_split_row(row: OtherSplit) -> tuple[str, ...]:
    leaks = (_percent(row.leak_share), _percent(row.leak_chance))
    return (row.kind, row.target, str(row.seed), f"{row.accuracy:.1f}", f"{row.balanced_accuracy:.1f}", *leaks)


def _repeat_row(row: Repeat) -> tuple[str, ...]:
    return (row.condition, "yes" if row.same_bytes else "no", f"{row.same_predictions:.2f} %", f"{row.accuracy:.2f}")


def _confusion(card: JudgeCard, target: str) -> str:
    labels = card.labels(target)
    rows = card.of(target)[0].pooled.confusion
    body = [(label, *(str(n) if n else "" for n in row)) for label, row in zip(labels, rows, strict=True)]
    return _table(("true \\ predicted", *labels), body)


def _percent(share: float | None) -> str:
    return "" if share is None else f"{100 * share:.0f} %"


def _table(header: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [header, ["---"] * len(header), *rows]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines)
