"""``stylebench-gesture@1``: gesture sequences of 20 to 36 s, scored on the hands' trajectories without judges."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import Protocol, Task, TaskPool, neutral_style
from bench.protocols.scenarios import FPS, N_SCENARIOS, evaluation_sequences, training_sequences

N_INTER = N_SCENARIOS * (N_SCENARIOS - 1)


def make_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """The first ``n`` tasks: 15 intra (one scenario, both sides), then the 210 inter pairs in a fixed shuffled order.

    Raises
    ------
    BadData : there are not 15 sequences on each side.
    """
    return [*intra_tasks(pool, n, seed), *inter_tasks(pool, N_INTER, seed)][:n]


def intra_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Scenario i in the neutral style, in the style of the sequence that performs scenario i too.

    Raises
    ------
    BadData : there are not 15 sequences on each side.
    """
    contents, styles = _sides(pool)
    rng = np.random.default_rng([seed, 0])
    return [_task(name, name, contents, styles, rng) for name in sorted(contents)][:n]


def inter_tasks(pool: TaskPool, n: int, seed: int) -> list[Task]:
    """Scenario i in the neutral style, in the style of the sequence that performs another scenario j.

    Raises
    ------
    BadData : there are not 15 sequences on each side.
    """
    contents, styles = _sides(pool)
    rng = np.random.default_rng([seed, 1])
    names = sorted(contents)
    pairs = [(name, other) for name in names for other in names if other != name]
    shuffled = [pairs[place] for place in rng.permutation(len(pairs))]
    return [_task(name, other, contents, styles, rng) for name, other in shuffled][:n]


def _sides(pool: TaskPool) -> tuple[dict[str, Take], dict[str, Take]]:
    """Scenario -> sequence, on the content side (neutral) and on the style side."""
    neutral = neutral_style([str(take.style) for take in pool.extra])
    contents = {str(take.content): take for take in pool.extra if take.style == neutral}
    styles = {str(take.content): take for take in pool.extra if take.style != neutral}
    if not len(contents) == len(styles) == N_SCENARIOS or set(contents) != set(styles):
        raise BadData(
            f"expected {N_SCENARIOS} scenarios on both sides, got {len(contents)} contents and {len(styles)} styles",
            where="extra",
        )
    return contents, styles


def _task(
    name: str, other: str, contents: Mapping[str, Take], styles: Mapping[str, Take], rng: np.random.Generator
) -> Task:
    content, style = contents[name], styles[other]
    return Task(
        sample_id=f"{name.removeprefix('scenario-')}-{other.removeprefix('scenario-')}",
        content_take_id=content.take_id,
        start_frame=0,
        style_take_id=style.take_id,
        content=name,
        source_style=str(content.style),
        target_style=str(style.style),
        reference_content=other,
        seed=int(rng.integers(2**31)),
        n_frames=0,
        group="slice:intra" if name == other else "slice:inter",
    )


CONTENT_ERRORS = ("content_error", "content_error_worst", "content_error_worst_quarter")
STYLE_ERRORS = ("style_error", "style_error_worst", "style_error_worst_quarter")
THETAS = ("style_error[1.07s]", "style_error[4.27s]")

FACTS = {
    "sequences": "15 scenarios of 20 to 36 s at 60 fps, takes of one style joined with blends of 0.3 s, one skeleton",
    "parts": "evaluation from every part but fit, since no judge takes part; training from fit, in every style",
    "pairs": "content side neutral, style side one other style per scenario, dealt round robin",
    "theta": "2.13 s, half overlapping; 1.07 s and 4.27 s beside it",
    "tail": "frames after the last full segment are covered by one more full segment that ends with the last frame",
    "style": "mirrored copy added",
    "intra": "the style reference performs the source's scenario: it is itself a right answer",
    "post-processing": "none: outputs are scored as they come",
}

GESTURE = Protocol(
    name="stylebench-gesture",
    version=1,
    track="gesture",
    summary="gesture sequence + style sequence -> motion; content and style errors of the hands' trajectories",
    needs="transfers",
    judged=False,
    fps=FPS,
    n_samples={"smoke": 3, "quick": 45, "standard": N_SCENARIOS + N_INTER},
    metrics=(
        "gesture_error",
        *CONTENT_ERRORS,
        "content_error[world]",
        *STYLE_ERRORS,
        *THETAS,
        "style_error[world]",
        "foot_skate",
        "penetration",
        "joint_range",
    ),
    truth_metrics=("gesture_error[truth]",),
    primary=("gesture_error", "intra"),
    make_tasks=make_tasks,
    extra_takes=evaluation_sequences,
    extra_fit=training_sequences,
    source_parts=("judge", "test", "real"),
    facts={**FACTS, "hand frame": "root: relative to the hips, facing forward; world beside it", "dtw": "exact"},
)
