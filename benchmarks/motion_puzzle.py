"""Motion Puzzle on real motion: attention maps (Figure 9), and which parts change when one is given a style (Table 1).

Changes are counted from the method's own reconstruction, the content in its own style: what training left out of that
is not counted as a leak here, as it is on the parts track. Weights are folders that ``stylebench fit`` keeps in its
store: ``python -m benchmarks.motion_puzzle --data bandai-namco=PATH --weights FOLDER --whole-body FOLDER --out FOLDER``
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bench.adapters.motion_puzzle import Puzzle, PuzzleWholeBody
from bench.datasets.split import deal
from bench.datasets.table import load_dataset
from bench.datasets.take import Take
from bench.methods.motion_puzzle.attention_maps import attention_maps
from bench.methods.windows import FPS
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.skeleton import N_JOINTS, PARTS
from reports.puzzle_figures import attention_figure, part_change_figure

SECONDS = 4.0
GROUPS = ("legs", "spine", "arms")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="NAME=PATH")
    parser.add_argument("--weights", required=True, type=Path, help="folder of a finished training")
    parser.add_argument("--whole-body", required=True, type=Path, help="the same of motion-puzzle-stgcn-adain")
    parser.add_argument("--pairs", type=int, default=60, help="of test motions, for the changes by part")
    parser.add_argument("--contents", default="walk:normal,run:active", help="CONTENT:STYLE of test takes, by comma")
    parser.add_argument("--styles", default="walk:youthful,run:exhausted", help="one for each content")
    parser.add_argument("--out", type=Path, required=True)
    asked = parser.parse_args()
    name, _, path = asked.data.partition("=")
    takes = load_dataset(name, Path(path)).takes
    test = deal(takes).select(takes, "test")
    adapter = Puzzle()
    adapter.load(asked.weights)
    pairs = {}
    for content_name, style_name in zip(asked.contents.split(","), asked.styles.split(","), strict=True):
        content, style = _longest(test, content_name), _longest(test, style_name)
        pairs[f"{content_name} as {style_name}"] = attention_maps(adapter.network, _piece(content), _piece(style))
    asked.out.mkdir(parents=True, exist_ok=True)
    attention_figure(pairs, FPS).savefig(asked.out / "attention.png", dpi=110)
    whole_body = PuzzleWholeBody()
    whole_body.load(asked.whole_body)
    rng = np.random.default_rng(0)
    drawn = [rng.choice(len(test), size=2, replace=False) for _ in range(asked.pairs)]
    motions = [(test[content], test[style]) for content, style in drawn]
    changes = {method.title: part_changes(method, motions) for method in (adapter, whole_body)}
    part_change_figure(changes).savefig(asked.out / "parts.png", dpi=110)
    for title, rows in changes.items():
        for part, row in rows.items():
            print(f"{title}, {part}: " + ", ".join(f"{name} {degrees:.2f}" for name, degrees in row.items()))


def part_changes(method: Puzzle, motions: Sequence[tuple[Take, Take]]) -> dict[str, dict[str, float]]:
    """Restyled part -> observed part -> mean angle in degrees between joint rotations with and without that style."""
    found = {part: np.zeros(N_JOINTS) for part in GROUPS}
    rng = np.random.default_rng(0)
    for content, style in motions:
        own = method.transfer(content, content, rng=rng)
        for part in GROUPS:
            answer = method.transfer_parts(content, {part: style}, rng=rng)
            angles = quat.angle_between(own.rotations_wxyz, answer.rotations_wxyz)
            found[part] += np.degrees(angles.mean(axis=0)) / len(motions)
    return {part: {name: float(angles[list(PARTS[name])].mean()) for name in GROUPS} for part, angles in found.items()}


def _longest(takes: Sequence[Take], wanted: str) -> Take:
    content, _, style = wanted.partition(":")
    found = [take for take in takes if (take.content, take.style) == (content, style)]
    if not found:
        cells = sorted({f"{take.content}:{take.style}" for take in takes})
        raise SystemExit(f"no test take of {wanted}; there are {', '.join(cells)}")
    return max(found, key=lambda take: take.clip.n_frames)


def _piece(take: Take) -> Clip:
    return crop(take.clip, 0, min(take.clip.n_frames, round(SECONDS * take.clip.fps)))


if __name__ == "__main__":
    main()
