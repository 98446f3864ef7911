"""What all judges say about a set of windows, as arrays with a leading judge-seed axis."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.errors import BadFile

EMBEDDING_FILE = "embedding.npz"


@dataclass(frozen=True, eq=False)
class Embedding:
    """Judge outputs of n windows under S judge seeds. Features are stored in float32, as the judges compute them.

    Attributes
    ----------
    content_features, style_features : ``[S, n, 64]``.
    content_log_probabilities, style_log_probabilities : ``[S, n, K]`` over the dataset's sorted judged labels.
    autoencoder_components : ``[S, n, 32]`` leading principal components of the auto-encoder features.
    """

    content_features: NDArray[np.float32]
    style_features: NDArray[np.float32]
    content_log_probabilities: NDArray[np.float32]
    style_log_probabilities: NDArray[np.float32]
    autoencoder_components: NDArray[np.float32]

    @property
    def n_seeds(self) -> int:
        return int(self.content_features.shape[0])

    @property
    def content_predicted(self) -> NDArray[np.int16]:
        """``[S, n]`` index of the likeliest content."""
        return np.asarray(self.content_log_probabilities.argmax(axis=-1), dtype=np.int16)

    @property
    def style_predicted(self) -> NDArray[np.int16]:
        """``[S, n]`` index of the likeliest style."""
        return np.asarray(self.style_log_probabilities.argmax(axis=-1), dtype=np.int16)

    def take(self, rows: NDArray[np.bool_] | NDArray[np.intp]) -> Embedding:
        """The embedding of some of the windows."""
        return Embedding(**{field.name: getattr(self, field.name)[:, rows] for field in fields(self)})

    def save(self, folder: Path) -> None:
        """Store without pickles."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        np.savez(folder / EMBEDDING_FILE, **arrays)

    @classmethod
    def load(cls, folder: Path) -> Embedding:
        """Read what :meth:`save` stored.

        Raises
        ------
        BadFile : missing or damaged.
        """
        path = folder / EMBEDDING_FILE
        try:
            with np.load(path, allow_pickle=False) as stored:
                return cls(**{name: stored[name] for name in stored.files})
        except (OSError, ValueError, TypeError) as error:
            raise BadFile(f"stored judge outputs cannot be read: {error}", where=str(path)) from error
