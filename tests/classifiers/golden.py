"""Writes the golden files of test_golden: a few procedural windows and what the canonical judges say about them.

Run ``python -m tests.classifiers.golden`` after canonical judges were trained anew; the windows stay as they are.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.motion.edit import windows
from bench.motion.representation import judge_features
from bench.suite.judges import PRETRAINED, JudgeSet, load_judges
from bench.suite.second_judges import SecondJudges, load_second_judges

FOLDER = Path(__file__).parent / "golden"
WINDOWS_FILE = FOLDER / "windows.npz"
N_WINDOWS = 4


def answers(judges: JudgeSet, features: NDArray[np.floating]) -> dict[str, NDArray[np.float32]]:
    """What is compared: features of every classifier, principal components of every auto-encoder."""
    out = judges.evaluate(features)
    stacked = {
        "content": np.stack([judged.features for judged in out.content]),
        "style": np.stack([judged.features for judged in out.style]),
        "components": np.stack([encoded.components for encoded in out.encoded]),
    }
    return {name: array.astype(np.float32) for name, array in stacked.items()}


def second_answers(judges: SecondJudges, features: NDArray[np.floating]) -> dict[str, NDArray[np.float32]]:
    """The same of the second family, which has no auto-encoder."""
    out = judges.evaluate(features)
    return {
        "content": out.content_features,
        "style": out.style_features,
        "content_log_probabilities": out.content_log_probabilities,
        "style_log_probabilities": out.style_log_probabilities,
    }


def write_windows() -> None:
    """Windows of takes spread over the procedural dataset, as judge features ``[4, 64, 21, 7]``."""
    from bench.datasets.table import load_dataset

    takes = load_dataset("procedural", None).takes
    chosen = [takes[(2 * i + 1) * len(takes) // (2 * N_WINDOWS)] for i in range(N_WINDOWS)]
    features = np.stack([judge_features(windows(take.clip)[0][1]) for take in chosen]).astype(np.float32)
    np.savez_compressed(WINDOWS_FILE, features=features)


def main() -> None:
    """Write what is missing or may have changed."""
    FOLDER.mkdir(exist_ok=True)
    if not WINDOWS_FILE.is_file():
        write_windows()
    with np.load(WINDOWS_FILE, allow_pickle=False) as stored:
        features = stored["features"]
    for folder in sorted(path.parent for path in PRETRAINED.glob("*/card.json")):
        judges = load_judges(folder)
        arrays = {"digest": np.array(judges.digest), **answers(judges, features)}
        np.savez(FOLDER / f"{folder.name}.npz", **arrays)  # type: ignore[arg-type]
        second = load_second_judges(folder)
        arrays = {"digest": np.array(second.digest), **second_answers(second, features)}
        np.savez(FOLDER / f"{folder.name}.second.npz", **arrays)  # type: ignore[arg-type]


if __name__ == "__main__":
    main()
