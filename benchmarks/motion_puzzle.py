"""Motion Puzzle's attention maps (Figure 9) on real motion, from trained weights.

``stylebench fit --methods motion-puzzle --data bandai-namco=PATH`` keeps weights in its store; give their folder:
``python -m benchmarks.motion_puzzle --data bandai-namco=PATH --weights FOLDER --out docs/methods/motion_puzzle``
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path

from bench.adapters.motion_puzzle import Puzzle
from bench.datasets.split import deal
from bench.datasets.table import load_dataset
from bench.datasets.take import Take
from bench.methods.motion_puzzle.attention_maps import attention_maps
from bench.methods.windows import FPS
from bench.motion.clip import Clip
from bench.motion.edit import crop
from reports.attention_figure import attention_figure

SECONDS = 4.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="NAME=PATH")
    parser.add_argument("--weights", required=True, type=Path, help="folder of a finished training")
    parser.add_argument("--contents", default="walk:normal,run:active", help="CONTENT:STYLE of test takes, by comma")
    parser.add_argument("--styles", default="walk:elderly,walk:youthful", help="one for each content")
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
    print(f"wrote {asked.out / 'attention.png'}")


def _longest(takes: Sequence[Take], wanted: str) -> Take:
    content, _, style = wanted.partition(":")
    return max((t for t in takes if t.content == content and t.style == style), key=lambda t: t.clip.n_frames)


def _piece(take: Take) -> Clip:
    return crop(take.clip, 0, min(take.clip.n_frames, round(SECONDS * take.clip.fps)))


if __name__ == "__main__":
    main()
