"""Takes as training windows: float32 tensors with labels, their normalisation, and draws by label."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor, nn

from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion.clip import Clip
from bench.motion.edit import mirror, resample, windows

FPS = 30.0
"""At which methods see motion."""

Encode = Callable[[Clip], FloatArray]
"""A window as an array ``[T, ...]`` of features."""


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of labelled takes.

    Attributes
    ----------
    features : ``[n, T, ...]`` float32.
    offsets_m : ``[n, 21, 3]`` float32, the bones of each window.
    styles, contents, takes : ``[n]`` int64, indices into the labels, and of the take that a window was cut from.
    style_labels, content_labels : sorted.
    """

    features: Tensor
    offsets_m: Tensor
    styles: Tensor
    contents: Tensor
    takes: Tensor
    style_labels: tuple[str, ...]
    content_labels: tuple[str, ...]

    def __len__(self) -> int:
        return len(self.features)

    def to(self, device: str) -> Windows:
        """The same windows on another device."""
        return Windows(
            self.features.to(device),
            self.offsets_m.to(device),
            self.styles.to(device),
            self.contents.to(device),
            self.takes.to(device),
            self.style_labels,
            self.content_labels,
        )


def cut_windows(
    takes: Sequence[Take], encode: Encode, *, n_frames: int, stride: int, mirrored: bool = False
) -> Windows:
    """Cut takes at 30 fps into windows of ``n_frames`` every ``stride`` frames; short takes hold their end poses.

    Parameters
    ----------
    takes : with content and style labels.
    encode : called once a window.
    mirrored : also take every take with left and right exchanged.

    Raises
    ------
    BadData : no takes, or a take without labels.
    """
    if not takes or any(take.style is None or take.content is None for take in takes):
        raise BadData("training windows need takes with content and style labels", where="takes")
    styles = tuple(sorted({str(take.style) for take in takes}))
    contents = tuple(sorted({str(take.content) for take in takes}))
    features, bones, rows = [], [], []
    for number, take in enumerate(takes):
        clip = resample(take.clip, FPS)
        for whole in (clip, mirror(clip)) if mirrored else (clip,):
            for _, part in windows(whole, n_frames, stride):
                features.append(encode(part).astype(np.float32))
                bones.append(whole.skeleton.offsets_m.astype(np.float32))
                rows.append((styles.index(str(take.style)), contents.index(str(take.content)), number))
    indices = torch.tensor(rows, dtype=torch.int64)
    return Windows(
        torch.from_numpy(np.stack(features)),
        torch.from_numpy(np.stack(bones)),
        indices[:, 0].contiguous(),
        indices[:, 1].contiguous(),
        indices[:, 2].contiguous(),
        styles,
        contents,
    )


class Standardise(nn.Module):
    """Channels with zero mean and unit deviation; the numbers travel with the weights, as buffers.

    Statistics are taken over all axes of ``[n, T, *shape]`` but the last ``len(shape)``.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, *shape: int) -> None:
        super().__init__()
        self.register_buffer("mean", torch.zeros(*shape))
        self.register_buffer("deviation", torch.ones(*shape))

    @torch.no_grad()
    def fit(self, features: Tensor, floor: float = 1e-4) -> None:
        """Take mean and deviation from ``[n, T, *shape]``; no deviation is smaller than ``floor``."""
        flat = features.double().flatten(0, features.dim() - self.mean.dim() - 1)
        self.mean.copy_(flat.mean(dim=0))
        self.deviation.copy_(flat.std(dim=0, correction=0).clamp_min(floor))

    def forward(self, features: Tensor) -> Tensor:
        return (features - self.mean) / self.deviation

    def inverse(self, standard: Tensor) -> Tensor:
        """From standardised features back to features."""
        return standard * self.deviation + self.mean


class Draws:
    """Rows of windows drawn by label, with a generator given at each draw.

    ``balance`` 0 draws windows alike, 1 draws (content, style) cells alike; between them cells count with their size
    to the power ``1 - balance``.
    """

    def __init__(self, windows: Windows, balance: float = 0.0) -> None:
        self.n_styles, n_contents = len(windows.style_labels), len(windows.content_labels)
        self.styles, self.contents = windows.styles.cpu(), windows.contents.cpu()
        cells = self.contents * self.n_styles + self.styles
        sizes = torch.bincount(cells, minlength=self.n_styles * n_contents)
        self.weights = sizes[cells].double().pow(-balance)
        self.of_style = _Groups(self.styles, self.n_styles)
        self.of_cell = _Groups(cells, self.n_styles * n_contents)

    def rows(self, n: int, generator: torch.Generator) -> Tensor:
        """``[n]`` rows of any label."""
        return torch.multinomial(self.weights, n, replacement=True, generator=generator)

    def with_styles(self, styles: Tensor, generator: torch.Generator) -> Tensor:
        """A row of each style in ``[n]``."""
        return self.of_style.draw(styles.cpu(), generator)

    def with_cells(self, contents: Tensor, styles: Tensor, generator: torch.Generator) -> Tensor:
        """A row of each (content, style) in ``[n]``; of the style alone where the cell has no window."""
        contents, styles = contents.cpu(), styles.cpu()
        cells = contents * self.n_styles + styles
        known = self.of_cell.sizes[cells] > 0
        rows = self.of_style.draw(styles, generator)
        rows[known] = self.of_cell.draw(cells[known], generator)
        return rows


class _Groups:
    """Rows by group, laid end to end."""

    def __init__(self, groups: Tensor, n_groups: int) -> None:
        self.sizes = torch.bincount(groups, minlength=n_groups)
        self.starts = torch.cumsum(self.sizes, 0) - self.sizes
        self.order = torch.argsort(groups, stable=True)

    def draw(self, wanted: Tensor, generator: torch.Generator) -> Tensor:
        share = torch.rand(len(wanted), generator=generator, dtype=torch.float64)
        places = self.starts[wanted] + (share * self.sizes[wanted]).long()
        return self.order[places]


def at_training_rate(clip: Clip, answer: Callable[[Clip], Clip], fps: float = FPS) -> Clip:
    """The answer to a clip given at a network's frame rate, brought back to the clip's own fps and number of frames."""
    if clip.fps == fps:
        return answer(clip)
    back = resample(answer(resample(clip, fps)), clip.fps)
    frames = np.minimum(np.arange(clip.n_frames), back.n_frames - 1)
    return back.with_motion(back.rotations_wxyz[frames], back.root_xyz_m[frames])


def hold(clip: Clip, n_frames: int) -> Clip:
    """The clip with its last pose held up to ``n_frames``; a longer one as it is."""
    if clip.n_frames >= n_frames:
        return clip
    frames = np.minimum(np.arange(n_frames), clip.n_frames - 1)
    return clip.with_motion(clip.rotations_wxyz[frames], clip.root_xyz_m[frames])


def padded_frames(n_frames: int, multiple: int, least: int) -> int:
    """The smallest multiple of ``multiple`` that is at least ``n_frames`` and ``least``."""
    return -(-max(n_frames, least) // multiple) * multiple


def to_tensor(features: FloatArray) -> Tensor:
    """Features of one clip as a float32 batch of one, ``[T, ...] -> [1, T, ...]``."""
    return torch.from_numpy(np.array(features, dtype=np.float32)[None])
