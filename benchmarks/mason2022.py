"""Mason 2022 on real locomotion: how phases behave (Figure 4), and what fine-tuning does to a new style (Figure 11).

``python -m benchmarks.mason2022 --data bandai-namco=PATH --new masculine --out docs/methods/mason2022``
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import torch
from sklearn.manifold import TSNE
from sklearn.neighbors import NearestNeighbors

from bench.arrays import FloatArray
from bench.datasets.split import deal
from bench.datasets.table import load_dataset
from bench.datasets.take import Take
from bench.methods.mason2022 import phases
from bench.methods.mason2022.examples import (
    N_HANDS,
    axes_of,
    effector_positions,
    examples_of,
    local_phases,
    locomotion,
    sources,
)
from bench.methods.mason2022.features import END_EFFECTORS, FPS, body_of
from bench.methods.mason2022.mason2022 import MasonNetwork, config_of, fine_tune, train_mason
from bench.methods.training import FitRequest
from reports.mason_figures import LimbPhase, phase_figure, style_space_figure

LIMBS = ("left hand", "right hand", "left foot", "right foot")
CLIPS_PER_STYLE = 50
FINE_TUNING_STEPS = 1500


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="NAME=PATH")
    parser.add_argument("--new", default="masculine", help="the style that training does not see")
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--budget", default="small")
    parser.add_argument("--phases-only", action="store_true")
    asked = parser.parse_args()
    name, _, path = asked.data.partition("=")
    takes = load_dataset(name, Path(path)).takes
    asked.out.mkdir(parents=True, exist_ok=True)
    walks = locomotion(takes)
    measure_phases(walks, asked.out)
    if not asked.phases_only:
        learn_new_style(walks, asked.new, asked.budget, asked.out)


def measure_phases(takes: Sequence[Take], out: Path) -> None:
    """Print how phases advance and how left and right differ, by style and gait; draw three takes."""
    gaits: dict[tuple[str, str], list[Take]] = defaultdict(list)
    for take in takes:
        gaits[str(take.content), str(take.style)].append(take)
    print(
        "gait, style: share of frames in which the phase advances, left hand, right hand, left foot, right foot; "
        "left minus right foot"
    )
    for (gait, style), group in sorted(gaits.items()):
        bodies = [body_of(take.clip) for take in group]
        axes = axes_of(bodies)
        advances, differences = [], []
        for body in bodies:
            positions = effector_positions(body)
            found = [
                phases.fit_sinusoids(
                    phases.source_function(phases.contact_free_source(positions[:, place], axes[place]), FPS), FPS
                ).phase
                for place in range(len(END_EFFECTORS))
            ]
            advances.append([phases.phase_advance(phase) > 0.0 for phase in found])
            differences.append(found[2] - found[3])
        shares = np.concatenate(advances, axis=1).mean(axis=1)
        turned = np.concatenate(differences)
        print(f"{gait}, {style}: {' '.join(f'{100 * s:.1f}' for s in shares)} %; {phases.circular_mean(turned):.3f}")
    shown = {}
    for gait, style in (("walk", "normal"), ("walk", "elderly"), ("run", "active")):
        there = gaits.get((gait, style), [])
        if there:
            axes = axes_of([body_of(take.clip) for take in there])
            longest = max(there, key=lambda take: take.clip.n_frames)
            shown[f"{gait}, {style}"] = _limbs(longest, axes)
    phase_figure(shown, FPS).savefig(out / "phases.png", dpi=110)


def _limbs(take: Take, axes: tuple[phases.Axis, phases.Axis, phases.Axis, phases.Axis]) -> Mapping[str, LimbPhase]:
    body = body_of(take.clip)
    features = local_phases(body, axes).reshape(body.n_frames, len(LIMBS), 2)
    return {
        name: LimbPhase(
            source,
            phases.phase_of(features[:, place]),
            np.linalg.norm(features[:, place], axis=-1),
            body.contacts[:, place - N_HANDS] if place >= N_HANDS else None,
        )
        for place, (name, source) in enumerate(zip(LIMBS, sources(body, axes), strict=True))
    }


def learn_new_style(takes: Sequence[Take], new: str, budget: str, out: Path) -> None:
    """Train LPN-FiLM without one style, fine-tune its FiLM generator on it, and draw the styles before and after."""
    split = deal(takes)
    fit = [take for take in takes if split.part_of[take.take_id] == "fit"]
    request = FitRequest([take for take in fit if take.style != new], 0, budget, "cpu", None, _progress)
    _, network, _ = train_mason(config_of("lpn-film", budget), request)
    held_out, _ = examples_of(takes, "lpn")
    before, styles = _codes(network, {style: found.clips for style, found in held_out.items()})
    fresh, _ = examples_of([take for take in fit if take.style == new], "lpn")
    fine_tune(network, fresh, FINE_TUNING_STEPS, request)
    # Styles that were known keep the parameters that were saved before (section 4.4): they answer as they did.
    after = before.copy()
    after[np.array(styles) == new] = _codes(network, {new: held_out[new].clips})[0]
    shares = _own_share(before, styles, new), _own_share(after, styles, new)
    print(f"clips of {new} nearest to a clip of {new}: {shares[0]:.2f} before, {shares[1]:.2f} after")
    print(f"distance of {new} from the nearest other style over the spread of styles: "
          f"{_gap(before, styles, new):.2f} before, {_gap(after, styles, new):.2f} after")  # fmt: skip
    placed = [TSNE(perplexity=30, random_state=0, init="pca").fit_transform(codes) for codes in (before, after)]
    figure = style_space_figure(placed[0], placed[1], styles, [new], shares)
    figure.savefig(out / "new-style.png", dpi=110)


@torch.no_grad()
def _codes(network: MasonNetwork, clips: Mapping[str, FloatArray]) -> tuple[FloatArray, list[str]]:
    """FiLM parameters ``[N, 4 hidden]`` of clips of every style."""
    network.eval()
    n_frames = network.config.clip_frames
    rng = np.random.default_rng(0)
    codes, styles = [], []
    for style, frames in sorted(clips.items()):
        starts = rng.integers(0, len(frames) - n_frames, CLIPS_PER_STYLE)
        batch = np.stack([frames[start : start + n_frames] for start in starts]).astype(np.float32)
        codes.append(network.code(torch.from_numpy(batch), None).numpy().astype(np.float64))
        styles += [style] * CLIPS_PER_STYLE
    return np.concatenate(codes), styles


def _own_share(codes: FloatArray, styles: Sequence[str], new: str) -> float:
    """Share of the clips of a style whose nearest other clip is of that style."""
    nearest = NearestNeighbors(n_neighbors=2).fit(codes).kneighbors(codes, return_distance=False)[:, 1]
    own = np.array(styles) == new
    return float(own[nearest[own]].mean())


def _gap(codes: FloatArray, styles: Sequence[str], new: str) -> float:
    """Distance of a style's mean code from the nearest other style's, over the mean distance within styles."""
    labels = np.array(styles)
    means = {style: codes[labels == style].mean(axis=0) for style in set(styles)}
    within = np.mean([np.linalg.norm(codes[labels == style] - mean, axis=1).mean() for style, mean in means.items()])
    return float(min(np.linalg.norm(means[new] - mean) for style, mean in means.items() if style != new) / within)


def _progress(what: str, done: int, total: int) -> None:
    if done % 500 == 0 or done == total:
        print(f"{what} {done}/{total}", flush=True)


if __name__ == "__main__":
    main()
