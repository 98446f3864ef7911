"""Kuriyama 2022 on gestures: how far tokens are matched by place alone, and the time a pose takes (section 3.5).

Weights are folders that ``stylebench run`` keeps in its store; several are compared by their matches, the first is
timed: ``python -m benchmarks.kuriyama2022 --data bandai-namco=PATH --weights FOLDER,FOLDER``
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import time
from collections import defaultdict
from collections.abc import Callable, Sequence
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from bench.adapters.kuriyama2022 import SoftSwap
from bench.datasets.split import PARTS, deal
from bench.datasets.table import load_dataset
from bench.datasets.take import Take
from bench.methods.kuriyama2022.gestures import UPPER_CHANNELS, gesture_of
from bench.methods.kuriyama2022.method import GestureTransfer, KuriyamaConfig, channels_of
from bench.methods.kuriyama2022.tokens import tokens_of
from bench.protocols.scenarios import evaluation_sequences

PAPER_US = 13.0
N_FRAMES = KuriyamaConfig().transformer_frames
BATCHES = (1, 8)
ROUNDS = 30


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", required=True, help="NAME=PATH")
    parser.add_argument("--weights", required=True, help="folders of finished trainings of soft swaps, by comma")
    parser.add_argument("--threads", default="1,2", help="by comma")
    asked = parser.parse_args()
    name, _, path = asked.data.partition("=")
    takes = load_dataset(name, Path(path) if path else None).takes
    split = deal(takes)
    sequences = evaluation_sequences({part: split.select(takes, part) for part in PARTS}, None, 0)
    networks = [_loaded(Path(folder)) for folder in asked.weights.split(",")]
    for network in networks:
        print_matches(network, sequences)
    for threads in map(int, asked.threads.split(",")):
        torch.set_num_threads(threads)
        print_times(networks[0], sequences, threads)


def _loaded(folder: Path) -> GestureTransfer:
    adapter = SoftSwap()
    adapter.load(folder)
    return adapter.network


@torch.inference_mode()
def print_matches(network: GestureTransfer, sequences: Sequence[Take]) -> None:
    """Print the share of content tokens whose most similar style token stands at their own place in its sequence."""
    tokens = [tokens_of(network.autoencoder.encoder(channels_of(gesture_of(take.clip).upper))) for take in sequences]
    places_apart: dict[str, list[Tensor]] = defaultdict(list)
    for (content, asking), (style, answering) in product(zip(sequences, tokens, strict=True), repeat=2):
        if content is style:
            pair = "with itself"
        else:
            pair = "one scenario, two styles" if content.content == style.content else "two scenarios"
        chosen = network.transformer.similarity(asking, answering).argmax(dim=-1)[0]
        places_apart[pair].append((chosen - torch.arange(len(chosen))).abs())
    codes = "with" if network.config.positions else "without"
    print(f"{codes} position codes, losses {', '.join(network.config.losses)}: the most similar style token stands")
    for pair, found in places_apart.items():
        apart = torch.cat(found)
        own, near = (100.0 * float((apart <= reach).float().mean()) for reach in (0, 2))
        print(f"  {pair:26s} at the same place in {own:5.1f} %, within two of it in {near:5.1f} %")


@torch.inference_mode()
def print_times(network: GestureTransfer, sequences: Sequence[Take], threads: int) -> None:
    """Print microseconds a pose: the networks on crops of the paper's training, and a transfer from clip to clip."""
    for batch in BATCHES:
        content, style = torch.randn(2, batch, UPPER_CHANNELS, N_FRAMES).unbind()
        seconds = _median_s(partial(_answered, network, content, style))
        _print_time(f"networks, batch {batch} of {N_FRAMES} poses", threads, seconds, batch * N_FRAMES)
    content_clip, style_clip = sequences[0].clip, sequences[1].clip
    seconds = _median_s(partial(network.transfer, content_clip, style_clip))
    _print_time(f"clip to clip, {content_clip.n_frames} poses", threads, seconds, content_clip.n_frames)


def _answered(network: GestureTransfer, content: Tensor, style: Tensor) -> tuple[Tensor, Tensor]:
    encoder = network.autoencoder.encoder
    return network.autoencoder.decode(network.swapped(encoder(content), encoder(style)))


def _median_s(call: Callable[[], object]) -> float:
    call()
    durations = []
    for _ in range(ROUNDS):
        started = time.perf_counter()
        call()
        durations.append(time.perf_counter() - started)
    return float(np.median(durations))


def _print_time(what: str, threads: int, seconds: float, n_poses: int) -> None:
    per_pose_us = 1e6 * seconds / n_poses
    print(f"{what}, threads {threads}: {per_pose_us:.1f} us a pose (paper: {PAPER_US:g} us)")


if __name__ == "__main__":
    main()
