"""BVH reading against ``numpy.loadtxt``, kinematics against numpy: ``python benchmarks/bvh.py [--file TAKE.bvh]``.

Both readers get the same motion block; ours reads the skeleton too. The kinematics are those of clips: our kernel
against a loop over joints of whole-array quaternion products. Candidates run in turn, so a busy machine slows all
alike; medians and their ratios are printed. Without a file, a take of 22 joints and 132 channels is made up.
"""

# ruff: noqa: T201
from __future__ import annotations

import argparse
import io
import statistics
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from bench.arrays import FloatArray
from bench.motion import quat
from bench.motion.bvh import local_motion, read_bvh
from bench.motion.kinematics import forward_kinematics
from bench.motion.skeleton import Skeleton

READ_TARGET, KINEMATICS_TARGET = 2.5, 10.0


def made_up_take(n_frames: int, rng: np.random.Generator) -> bytes:
    """22 joints of six channels in a chain, six decimals: the shape of a Bandai-Namco take."""
    channels = "CHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation Yrotation"
    lines = ["HIERARCHY"]
    for joint in range(22):
        lines += [f"{'JOINT' if joint else 'ROOT'} joint{joint}", "{", "OFFSET 10.0 0.0 0.0", channels]
    lines += ["}"] * 22 + ["MOTION", f"Frames: {n_frames}", "Frame Time: 0.0333333"]
    lines += [" ".join(f"{value:.6f}" for value in row) for row in rng.uniform(-180.0, 180.0, (n_frames, 132)).tolist()]
    return "\n".join([*lines, ""]).encode()


def numpy_kinematics(
    rotations_wxyz: FloatArray, root_xyz_m: FloatArray, skeleton: Skeleton
) -> tuple[FloatArray, FloatArray]:
    """The straightforward way: one quaternion product and one rotation a joint, over all frames at once."""
    positions = np.empty((*rotations_wxyz.shape[:2], 3))
    world = np.empty_like(rotations_wxyz)
    positions[:, 0], world[:, 0] = root_xyz_m, rotations_wxyz[:, 0]
    for joint, parent in enumerate(skeleton.parents[1:], start=1):
        positions[:, joint] = positions[:, parent] + quat.rotate(world[:, parent], skeleton.offsets_m[joint])
        world[:, joint] = quat.multiply(world[:, parent], rotations_wxyz[:, joint])
    return positions, world


def median_seconds(runs: dict[str, Callable[[], object]], rounds: int) -> dict[str, float]:
    seconds: dict[str, list[float]] = {name: [] for name in runs}
    for _ in range(rounds):
        for name, run in runs.items():
            start = time.perf_counter()
            run()
            seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def report(title: str, ours: str, medians: dict[str, float], target: float) -> None:
    print(title)
    for name, seconds in medians.items():
        print(f"  {name:44s} {1e3 * seconds:9.3f} ms {seconds / medians[ours]:7.1f} x")
    print(f"  target: the others take at least {target:g} x")


def compare_reading(content: bytes, rounds: int) -> None:
    block = content[content.index(b"Frame Time") :].split(b"\n", 1)[1]
    runs: dict[str, Callable[[], object]] = {
        "stylebench read_bvh, whole file": lambda: read_bvh(content),
        "numpy.loadtxt, motion block": lambda: np.loadtxt(io.BytesIO(block)),
    }
    np.testing.assert_array_equal(read_bvh(content).channel_values, np.loadtxt(io.BytesIO(block)))
    medians = median_seconds(runs, rounds)
    ours = "stylebench read_bvh, whole file"
    report(f"reading {len(content) / 1e6:.1f} MB", ours, medians, READ_TARGET)
    print(f"  {len(content) / 1e6 / medians[ours]:.0f} MB/s whole file")


def compare_kinematics(content: bytes, rounds: int) -> None:
    motion = read_bvh(content)
    rotations, translations = local_motion(motion)
    skeleton = Skeleton(motion.names, motion.parents, motion.offsets / 100.0)
    arguments = (rotations, translations[:, 0] / 100.0, skeleton)
    for ours, theirs in zip(forward_kinematics(*arguments), numpy_kinematics(*arguments), strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-9)
    runs: dict[str, Callable[[], object]] = {
        "stylebench forward_kinematics": lambda: forward_kinematics(*arguments),
        "numpy, joint by joint": lambda: numpy_kinematics(*arguments),
    }
    title = f"forward kinematics of {motion.n_frames} frames, {len(motion.names)} joints"
    report(title, "stylebench forward_kinematics", median_seconds(runs, rounds), KINEMATICS_TARGET)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--file", type=Path, help="a BVH file; one is made up by default")
    parser.add_argument("--frames", type=int, default=2000, help="frames of the take that is made up")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    content = (
        arguments.file.read_bytes() if arguments.file else made_up_take(arguments.frames, np.random.default_rng(0))
    )
    compare_reading(content, arguments.rounds)
    compare_kinematics(content, arguments.rounds)


if __name__ == "__main__":
    main()
