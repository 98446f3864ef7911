"""Scenarios of gestures: sequences long enough for segments, joined from the short takes that datasets have.

Kuriyama et al. 2022 evaluate on 15 scenarios of 20 to 36 s, once ordinary and once expressive (Table 7), which are not
public. Here a scenario is a fixed list of gesture contents, and a sequence performs it in one style: takes joined with
blends of 0.3 s, at 60 fps and on the bones of one skeleton, as the paper has one actress.

Evaluation sequences come from every part but ``fit``: no judge takes part, and the test part alone has too few takes of
a gesture in a style. Training sequences perform the same scenarios in every style with takes of ``fit``. A take may
recur in several scenarios, never within one sequence.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bench.datasets.base import Dataset
from bench.datasets.joined import joined_take, moved
from bench.datasets.take import Take
from bench.errors import BadData
from bench.protocols.base import neutral_style, stable_seed

N_SCENARIOS = 15
FPS = 60.0
SHORTEST_S, LONGEST_S = 20.0, 36.0
GESTURES = ("gesture-", "raise-up-", "wave-")
"""How the names of contents start that are gestures."""
TRAINING_PART = "fit"

_MOST_TIMES = 3
"""How often a scenario may ask for one content."""
_FEWEST_TAKES = 2
_PIECES = (4, 12)
_LISTS, _DRAWS = 5000, 20
"""How many lists of contents are tried for a scenario, and how many draws of takes for a list."""

Parts = Mapping[str, Sequence[Take]]
Cells = Mapping[str, Sequence[Take]]
"""Gesture content -> its takes in one style and pool, sorted by take id."""


@dataclass(frozen=True)
class Scenario:
    """What is gestured, and in which style besides the neutral one it is evaluated.

    Attributes
    ----------
    name : ``scenario-00`` .. ``scenario-14``; the content label of its sequences.
    contents : gestures in order.
    style : the style of its evaluation sequence on the style side.
    evaluation, training : style -> the takes that perform it, one for each gesture.
    """

    name: str
    contents: tuple[str, ...]
    style: str
    evaluation: Mapping[str, Sequence[Take]]
    training: Mapping[str, Sequence[Take]]


def evaluation_sequences(parts: Parts, foreign: Dataset | None, seed: int) -> list[Take]:
    """Every scenario in the neutral style and in its own, from takes of every part but ``fit``.

    A function of the takes in ``parts`` alone: all gesture protocols have the same sequences, whatever their ``seed``.

    Raises
    ------
    BadData : the dataset has no gestures, no neutral style, or too few takes for such sequences.
    """
    return _sequences(parts, [(scenario, scenario.evaluation) for scenario in scenarios(parts)])


def training_sequences(parts: Parts, foreign: Dataset | None, seed: int) -> list[Take]:
    """Every scenario in every style, from takes of ``fit``; otherwise as :func:`evaluation_sequences`.

    Raises
    ------
    BadData : as there.
    """
    return _sequences(parts, [(scenario, scenario.training) for scenario in scenarios(parts)])


def scenarios(parts: Parts) -> list[Scenario]:
    """The scenarios of a dataset under a split.

    Lists of contents are drawn until takes exist with which every sequence lasts 20 to 36 s. Styles other than the
    neutral one are dealt round robin.

    Raises
    ------
    BadData : the dataset has no gestures, no neutral style, or too few takes for such sequences.
    """
    training = _cells_by_style(parts[TRAINING_PART])
    evaluation = _cells_by_style(take for part, takes in parts.items() if part != TRAINING_PART for take in takes)
    styles = sorted(evaluation)
    contents = _shared_contents((*training.values(), *evaluation.values()))
    if len(styles) < 2 or len(contents) < 2 or sorted(training) != styles:
        raise BadData(
            f"scenarios need 2 gestures with {_FEWEST_TAKES} takes in each of 2 styles, inside the fit part and "
            f"outside it; got {len(contents)} in {len(styles)} styles",
            cause=f"gestures are contents whose names start with {', '.join(GESTURES)}",
            remedy="leave the gesture track out for this dataset",
        )
    neutral = neutral_style(styles)
    others = [style for style in styles if style != neutral]
    found: list[Scenario] = []
    for index in range(N_SCENARIOS):
        style = others[index % len(others)]
        wanted = {"evaluation": {s: evaluation[s] for s in (neutral, style)}, "training": training}
        found.append(_draw_scenario(f"scenario-{index:02d}", style, contents, wanted, found))
    return found


def seconds(take: Take) -> float:
    """How long a take lasts inside a sequence."""
    return (take.clip.n_frames - 1) / take.clip.fps + 1.0 / FPS


def _draw_scenario(
    name: str, style: str, contents: Sequence[str], wanted: Mapping[str, Mapping[str, Cells]], found: Sequence[Scenario]
) -> Scenario:
    rng = np.random.default_rng(stable_seed("scenario", name))
    for _ in range(_LISTS):
        listed = _draw_contents(contents, rng)
        if not listed or any(listed == other.contents for other in found):
            continue
        drawn = {pool: _draw_performances(listed, cells, rng) for pool, cells in wanted.items()}
        if all(drawn.values()):
            return Scenario(name, listed, style, drawn["evaluation"], drawn["training"])
    raise BadData(
        f"no further list of gestures lasts {SHORTEST_S:g} to {LONGEST_S:g} s in every style",
        where=name,
        cause="too few gestures, or too few or too short takes of them",
        remedy="leave the gesture track out for this dataset",
    )


def _draw_contents(contents: Sequence[str], rng: np.random.Generator) -> tuple[str, ...]:
    """At least half of the contents in some order, none twice in a row; empty where the draw broke that rule."""
    kinds = rng.permutation(np.array(contents))[: rng.integers(-(-len(contents) // 2), len(contents) + 1)]
    n_pieces = int(rng.integers(_PIECES[0], _PIECES[1] + 1))
    listed = tuple(str(content) for content in rng.permutation(np.repeat(kinds, _MOST_TIMES))[:n_pieces])
    in_a_row = any(left == right for left, right in pairwise(listed))
    return () if in_a_row or len(listed) < n_pieces else listed


def _draw_performances(
    listed: Sequence[str], cells_by_style: Mapping[str, Cells], rng: np.random.Generator
) -> dict[str, list[Take]]:
    """Style -> takes of a sequence that lasts as long as it should; empty where one style has none."""
    found: dict[str, list[Take]] = {}
    for style, cells in cells_by_style.items():
        pieces = _draw_pieces(listed, cells, rng)
        if not pieces:
            return {}
        found[style] = pieces
    return found


def _draw_pieces(listed: Sequence[str], cells: Cells, rng: np.random.Generator) -> list[Take]:
    if any(listed.count(content) > len(cells[content]) for content in listed):
        return []
    for _ in range(_DRAWS):
        orders = {content: iter(rng.permutation(len(cells[content])).tolist()) for content in sorted(set(listed))}
        pieces = [cells[content][next(orders[content])] for content in listed]
        if SHORTEST_S <= sum(map(seconds, pieces)) <= LONGEST_S:
            return pieces
    return []


def _sequences(parts: Parts, performances: Iterable[tuple[Scenario, Mapping[str, Sequence[Take]]]]) -> list[Take]:
    """Joined takes on the bones of the dataset's first gesture, so that errors compare gestures and not statures."""
    gestures = sorted((take for takes in parts.values() for take in takes if is_gesture(take)), key=lambda t: t.take_id)
    skeleton = gestures[0].clip.skeleton
    ready: dict[str, Take] = {}

    def piece(take: Take) -> Take:
        if take.take_id not in ready:
            ready[take.take_id] = take.with_clip(moved(take.clip, skeleton, FPS))
        return ready[take.take_id]

    return [
        joined_take(f"{scenario.name}/{style}", [piece(t) for t in takes], skeleton, FPS, content=scenario.name)
        for scenario, by_style in performances
        for style, takes in by_style.items()
    ]


def is_gesture(take: Take) -> bool:
    """True for takes whose native content is a gesture of the hands."""
    return str(take.content).startswith(GESTURES)


def _cells_by_style(takes: Iterable[Take]) -> dict[str, dict[str, list[Take]]]:
    cells: dict[str, dict[str, list[Take]]] = defaultdict(lambda: defaultdict(list))
    for take in sorted((take for take in takes if is_gesture(take)), key=lambda take: take.take_id):
        cells[str(take.style)][str(take.content)].append(take)
    return cells


def _shared_contents(cells: Sequence[Cells]) -> list[str]:
    """Gestures of which every style has enough takes."""
    everywhere = {content for by_content in cells for content in by_content}
    return sorted(c for c in everywhere if all(len(by_content.get(c, ())) >= _FEWEST_TAKES for by_content in cells))
