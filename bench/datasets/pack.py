"""Takes as a folder of memory-mapped arrays: how takes travel to worker processes and stay in caches."""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadFile
from bench.motion.clip import Clip
from bench.motion.skeleton import Skeleton

ROTATIONS_FILE, ROOT_FILE, LABELS_FILE = "rotations_wxyz.npy", "root_xyz_m.npy", "takes.json"


def write_pack(folder: Path, takes: Sequence[Take]) -> None:
    """Store takes into an existing, empty folder: two arrays over all frames and one JSON file of labels."""
    skeletons = {take.clip.skeleton.identity: take.clip.skeleton for take in takes}
    place = {identity: index for index, identity in enumerate(skeletons)}
    rows: list[dict[str, Any]] = []
    start = 0
    for take in takes:
        rows.append(
            {
                "take_id": take.take_id,
                "dataset": take.dataset,
                "content": take.content,
                "style": take.style,
                "actor": take.actor,
                "session": take.session,
                "fps": take.clip.fps,
                "start": start,
                "n_frames": take.clip.n_frames,
                "skeleton": place[take.clip.skeleton.identity],
            }
        )
        start += take.clip.n_frames
    np.save(folder / ROTATIONS_FILE, np.concatenate([take.clip.rotations_wxyz for take in takes]))
    np.save(folder / ROOT_FILE, np.concatenate([take.clip.root_xyz_m for take in takes]))
    stored_skeletons = [
        {
            "names": s.names,
            "parents": s.parents,
            "offsets_m": s.offsets_m.tolist(),
            "virtual": sorted(s.virtual),
        }
        for s in skeletons.values()
    ]
    (folder / LABELS_FILE).write_text(json.dumps({"skeletons": stored_skeletons, "takes": rows}))


RECENT_TAKES = 256


@dataclass(frozen=True, eq=False)
class Pack:
    """Stored takes; a take's arrays are read only when it is asked for."""

    rotations_wxyz: FloatArray
    root_xyz_m: FloatArray
    rows: dict[str, dict[str, Any]]
    skeletons: tuple[Skeleton, ...]

    @classmethod
    def open(cls, folder: Path) -> Pack:
        """Map a folder written by :func:`write_pack`.

        Raises
        ------
        BadFile : a file is missing or damaged.
        """
        try:
            labels = json.loads((folder / LABELS_FILE).read_text())
            rotations = np.load(folder / ROTATIONS_FILE, mmap_mode="r", allow_pickle=False)
            root = np.load(folder / ROOT_FILE, mmap_mode="r", allow_pickle=False)
        except (OSError, ValueError) as error:
            raise BadFile(f"stored takes cannot be read: {error}", where=str(folder)) from error
        skeletons = tuple(
            Skeleton(tuple(s["names"]), tuple(s["parents"]), np.array(s["offsets_m"]), frozenset(s["virtual"]))
            for s in labels["skeletons"]
        )
        return cls(rotations, root, {row["take_id"]: row for row in labels["takes"]}, skeletons)

    def take(self, take_id: str) -> Take:
        """One take with all its labels; those asked for last are kept."""
        return self._recent(take_id)

    @cached_property
    def _recent(self) -> Callable[[str], Take]:
        return lru_cache(maxsize=RECENT_TAKES)(self._read)

    def _read(self, take_id: str) -> Take:
        row = self.rows[take_id]
        frames = slice(row["start"], row["start"] + row["n_frames"])
        skeleton = self.skeletons[row["skeleton"]]
        clip = Clip(skeleton, np.array(self.rotations_wxyz[frames]), np.array(self.root_xyz_m[frames]), row["fps"])
        return Take(
            clip,
            take_id=take_id,
            dataset=row["dataset"],
            content=row["content"],
            style=row["style"],
            actor=row["actor"],
            session=row["session"],
        )

    @property
    def by_id(self) -> Mapping[str, Take]:
        """Takes by take id, each read when it is looked up."""
        return _TakesById(self)

    def takes(self) -> tuple[Take, ...]:
        """All takes, in stored order."""
        return tuple(self.take(take_id) for take_id in self.rows)


class _TakesById(Mapping[str, Take]):
    def __init__(self, pack: Pack) -> None:
        self.pack = pack

    def __getitem__(self, take_id: str) -> Take:
        return self.pack.take(take_id)

    def __iter__(self) -> Iterator[str]:
        return iter(self.pack.rows)

    def __len__(self) -> int:
        return len(self.pack.rows)
