"""A slow, independent reading of BVH: regular expressions, ``float`` and scipy rotations, one joint at a time."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from bench.arrays import FloatArray


@dataclass(frozen=True)
class ReferenceMotion:
    names: tuple[str, ...]
    positions: FloatArray
    values: FloatArray


def world_positions(
    parents: Sequence[int], offsets: FloatArray, channels: Sequence[Sequence[str]], values: FloatArray
) -> FloatArray:
    """``[F, J, 3]``: positions replace OFFSET, rotations apply in the order of their channels."""
    frames, column = values.shape[0], 0
    positions = np.zeros((frames, len(parents), 3))
    turns: list[Rotation] = []
    for joint, parent in enumerate(parents):
        moved = np.tile(offsets[joint], (frames, 1))
        order, angles = "", []
        for channel in channels[joint]:
            if channel.lower().endswith("position"):
                moved[:, "xyz".index(channel[0].lower())] = values[:, column]
            else:
                order += channel[0].upper()
                angles.append(values[:, column])
            column += 1
        turn = Rotation.identity(frames)
        if order:
            turn = Rotation.from_euler(order, np.stack(angles, axis=1), degrees=True)
        if parent < 0:
            positions[:, joint], turn = moved, turn
        else:
            positions[:, joint] = positions[:, parent] + turns[parent].apply(moved)
            turn = turns[parent] * turn
        turns.append(turn)
    return positions


def read_reference(content: bytes) -> ReferenceMotion:
    """Read a well-behaved file: one keyword a line, names without spaces."""
    header, block = re.split(r"^MOTION\s*$", content.decode(), maxsplit=1, flags=re.MULTILINE)
    names, parents, offsets, channels, stack = [], [], [], [], [-1]
    in_end_site = False
    for line in header.splitlines():
        words = line.split()
        if not words:
            continue
        if words[0] in ("ROOT", "JOINT"):
            names.append(words[1])
            parents.append(stack[-1])
        elif words[0] == "End":
            in_end_site = True
        elif words[0] == "{":
            stack.append(-2 if in_end_site else len(names) - 1)
        elif words[0] == "}":
            stack.pop()
            in_end_site = False
        elif words[0] == "OFFSET" and not in_end_site:
            offsets.append([float(word) for word in words[1:]])
        elif words[0] == "CHANNELS":
            channels.append(words[2:])
    rows = [line.split() for line in block.splitlines() if line.strip()][2:]
    values = np.array([[float(word) for word in row] for row in rows])
    return ReferenceMotion(tuple(names), world_positions(parents, np.array(offsets), channels, values), values)
