"""Xia et al. 2015, Realtime Style Transfer for Unlabeled Heterogeneous Human Motion: the row ``xia2015``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bench.adapters.base import Adapter, Description, ProgressCallback, Stream, Traits
from bench.datasets.take import Take
from bench.errors import BadConfig
from bench.motion.clip import Clip

if TYPE_CHECKING:
    from bench.methods.xia2015.xia2015 import Xia2015 as Method


class Xia2015(Adapter):
    """Neighbours of every frame and a mixture of autoregressive models; of the source only frames are known."""

    name = "xia2015"
    title = "Xia 2015"
    description = "nearest windows of the fit part, local mixture of autoregressive models, registered by DTW"
    traits = Traits(needs_style_label=True, designed_input_frames=5, look_ahead_frames=0)
    method: Method

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        from bench.methods.training import checked_budget
        from bench.methods.xia2015.database import CONFIGS, build_database
        from bench.methods.xia2015.xia2015 import Xia2015 as Method

        config = CONFIGS[checked_budget(budget)]
        self.method = Method(build_database(takes, config, progress), config)

    def save(self, folder: Path) -> None:
        from bench.methods.xia2015.database import save_config

        self.method.database.save(folder)
        save_config(folder, self.method.config)

    def load(self, folder: Path) -> None:
        from bench.methods.saved import read_config
        from bench.methods.xia2015.database import Database, XiaConfig
        from bench.methods.xia2015.xia2015 import Xia2015 as Method

        self.method = Method(Database.load(folder), read_config(folder, XiaConfig))

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        from bench.methods.xia2015.xia2015 import transfer

        return transfer(self.method, content.clip, style.style)

    def open_stream(self, style: Take, *, content_label: str | None, rng: np.random.Generator) -> Stream:
        from bench.methods.xia2015.xia2015 import XiaStream

        return XiaStream(self.method, style.style)

    def describe(self) -> Description:
        """Its parameters are the numbers of its database; a style costs its frames, partners and slopes."""
        if not hasattr(self, "method"):
            raise BadConfig(f"{self.name} describes itself once it has a database", remedy="call fit or load first")
        database = self.method.database
        per_frame = database.searched.shape[1] + database.poses.shape[1] + 2 * len(database.style_labels)
        numbers = len(database.poses) * per_frame
        return Description(
            parameters=numbers,
            bytes_per_style=8 * numbers // len(database.style_labels),
            designed_input_frames=self.traits.designed_input_frames,
            look_ahead_frames=self.traits.look_ahead_frames,
        )
