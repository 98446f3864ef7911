"""Splits: four parts by take, never by window.

judge trains the judges, fit trains the methods, test gives sources and style references, real is what Frechet and
kernel distances are taken against; 40 / 30 / 15 / 15.
"""

from __future__ import annotations

import hashlib
from collections import Counter, defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bench.datasets.take import Take
from bench.errors import BadConfig, BadData
from bench.motion.representation import window_frame

PARTS = ("judge", "fit", "test", "real")
KINDS = ("default", "contiguous", "interleaved")
BLOCK_TAKES = 3
SHOWN_LABELS = 5

SEQUENCE = tuple({"J": "judge", "F": "fit", "T": "test", "R": "real"}[letter] for letter in "JFJTJFRJFJTJFRJFJTFR")
"""Dealing order of blocks: 8 judge, 6 fit, 3 test, 3 real, so spread that any four neighbours hold judge and fit."""


@dataclass(frozen=True, eq=False)
class Split:
    """Which part each take is in.

    Attributes
    ----------
    kind : ``default``, ``contiguous`` or ``interleaved``.
    seed : the split seed.
    part_of : take id -> part.
    """

    kind: str
    seed: int
    part_of: Mapping[str, str]

    @property
    def digest(self) -> str:
        lines = "\n".join(f"{take_id} {part}" for take_id, part in sorted(self.part_of.items()))
        return hashlib.blake2b(lines.encode(), digest_size=16).hexdigest()

    def select(self, takes: Sequence[Take], *parts: str) -> list[Take]:
        """The takes of the named parts, in the order given."""
        unknown = set(parts) - set(PARTS)
        if unknown:
            raise BadConfig(f"unknown part {sorted(unknown)}, there are {', '.join(PARTS)}")
        return [take for take in takes if self.part_of[take.take_id] in parts]


def deal(takes: Sequence[Take], *, kind: str = "default", seed: int = 0) -> Split:
    """Deal labelled takes into the four parts, cell by cell (a cell is one content in one style).

    ``default``: a block is ``BLOCK_TAKES`` consecutive takes of a cell; block k gets the part at place
    ``(k + hash(cell, seed)) mod 20`` of ``SEQUENCE``, so takes added later at the end of a cell move nothing.
    ``interleaved``: the same with blocks of one take. ``contiguous``: each cell is cut into four runs.

    Raises
    ------
    BadConfig : unknown kind.
    BadData : a take without labels, or a content or style that some part lacks.
    """
    if kind not in KINDS:
        raise BadConfig(f"unknown split kind {kind!r}, there are {', '.join(KINDS)}")
    split = Split(kind, seed, _parts_by_cell(takes, kind, seed))
    _check_every_label_in_every_part(takes, split)
    return split


def _parts_by_cell(takes: Sequence[Take], kind: str, seed: int) -> dict[str, str]:
    cells: dict[tuple[str, str], list[str]] = defaultdict(list)
    for take in takes:
        if take.content is None or take.style is None:
            raise BadData(f"a split needs content and style labels, take {take.take_id!r} lacks one")
        cells[take.content, take.style].append(take.take_id)
    part_of: dict[str, str] = {}
    for cell, take_ids in sorted(cells.items()):
        start = _cell_hash(cell, seed) % len(SEQUENCE)
        part_of.update(zip(sorted(take_ids), _deal_cell(len(take_ids), kind, start), strict=True))
    return part_of


def _deal_cell(n_takes: int, kind: str, start: int) -> list[str]:
    if kind == "contiguous":
        shares = {part: SEQUENCE.count(part) for part in PARTS}
        order = [PARTS[(start + i) % len(PARTS)] for i in range(len(PARTS))]
        bounds = np.cumsum([shares[part] for part in order]) / len(SEQUENCE)
        return [order[int(np.searchsorted(bounds, (k + 0.5) / n_takes))] for k in range(n_takes)]
    block = BLOCK_TAKES if kind == "default" else 1
    return [SEQUENCE[(k // block + start) % len(SEQUENCE)] for k in range(n_takes)]


def _cell_hash(cell: tuple[str, str], seed: int) -> int:
    data = f"{cell[0]}|{cell[1]}|{seed}".encode()
    return int.from_bytes(hashlib.blake2b(data, digest_size=8).digest(), "big")


def _check_every_label_in_every_part(takes: Sequence[Take], split: Split) -> None:
    lacking: list[str] = []
    for label in ("content", "style"):
        counts = Counter(str(getattr(take, label)) for take in takes)
        for part in PARTS:
            missing = sorted(set(counts) - {str(getattr(take, label)) for take in split.select(takes, part)})
            if missing:
                named = ", ".join(f"{name} ({counts[name]} takes)" for name in missing[:SHOWN_LABELS])
                more = f" and {len(missing) - SHOWN_LABELS} more" if len(missing) > SHOWN_LABELS else ""
                lacking.append(f"the {part} part has no take of {label} {named}{more}")
    if lacking:
        needed = ", ".join(f"{takes_that_suffice(kind)} takes with {kind} dealing" for kind in KINDS)
        raise BadData(
            "; ".join(lacking),
            cause="too few takes of a content in one style; all four parts are always reached by " + needed,
            remedy=f"{_kinds_that_work(takes, split)}add takes, or merge labels",
        )


def _kinds_that_work(takes: Sequence[Take], failed: Split) -> str:
    """Advice to take another kind of dealing, where one puts every label into every part."""
    for kind in KINDS[::-1]:
        part_of = _parts_by_cell(takes, kind, failed.seed)
        reached = {(part_of[take.take_id], "content", take.content) for take in takes}
        reached |= {(part_of[take.take_id], "style", take.style) for take in takes}
        if len(reached) == len(PARTS) * len({label[1:] for label in reached}):
            return f"take {kind} dealing (--split {kind}), or "
    return ""


def takes_that_suffice(kind: str) -> int:
    """How many takes of one cell reach all four parts, wherever dealing starts.

    Raises
    ------
    BadConfig : unknown kind.
    """
    if kind not in KINDS:
        raise BadConfig(f"unknown split kind {kind!r}, there are {', '.join(KINDS)}")
    starts = range(len(SEQUENCE))
    n_takes = len(PARTS)
    while any(set(_deal_cell(n_takes, kind, start)) != set(PARTS) for start in starts):
        n_takes += 1
    return n_takes


@dataclass(frozen=True)
class Leak:
    """How much takes leak between parts.

    Attributes
    ----------
    share : share of test takes whose nearest neighbour of the same content and style lies in judge or fit.
    chance : what that share would be if neighbours were drawn at random from the cell.
    n : test takes it is taken over (those whose cell has another take).
    """

    share: float
    chance: float
    n: int


def leak(takes: Sequence[Take], split: Split) -> Leak:
    """Leak of a split; nearness is the distance of mean and deviation of the joint positions in the window frame."""
    summaries = {take.take_id: _pose_summary(take) for take in takes}
    cells: dict[tuple[str | None, str | None], list[Take]] = defaultdict(list)
    for take in takes:
        cells[take.content, take.style].append(take)
    hits: list[bool] = []
    chances: list[float] = []
    for take in split.select(takes, "test"):
        others = [other for other in cells[take.content, take.style] if other.take_id != take.take_id]
        if not others:
            continue
        seen = [split.part_of[other.take_id] in ("judge", "fit") for other in others]
        own = summaries[take.take_id]
        distances = [float(np.linalg.norm(summaries[other.take_id] - own)) for other in others]
        hits.append(seen[int(np.argmin(distances))])
        chances.append(float(np.mean(seen)))
    if not hits:
        return Leak(float("nan"), float("nan"), 0)
    return Leak(float(np.mean(hits)), float(np.mean(chances)), len(hits))


def _pose_summary(take: Take) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    clip = take.clip
    positions, _ = window_frame(clip.rotations_wxyz, clip.root_xyz_m, clip.skeleton)
    flat = positions.reshape(len(positions), -1)
    return np.concatenate([flat.mean(axis=0), flat.std(axis=0)])
