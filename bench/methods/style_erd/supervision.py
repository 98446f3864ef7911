"""What ``style_erd-content`` adds, which is not in the paper: classifiers of our own that the output has to satisfy.

Two small classifiers, of content and of style, are trained on the fit part alone and share nothing with the judges but
the kind of network.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from bench.arrays import FloatArray
from bench.methods.aberman2020.content import CLASSIFIER_WIDTHS, encode, in_statures, seen
from bench.methods.style_erd.frames import Frames
from bench.methods.training import FitRequest
from bench.methods.windows import Windows
from bench.motion.clip import Clip
from bench.motion.skeleton import CANONICAL_PARENTS, N_JOINTS
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.train import TrainingConfig, train_classifier


def seen_columns(clip: Clip) -> FloatArray:
    """Height in statures and heading about its mean, ``[T, 2]``: what :func:`seen` needs besides rotations."""
    return encode(clip)[:, -2:]


class Supervision:
    """Cross entropies of the transferred motion against its source's content and its target style.

    Parameters
    ----------
    frames : of all windows; their rotations are on the mean bones of the fit part.
    columns : where the windows' features have what :func:`seen_columns` gave.
    """

    def __init__(
        self, frames: Frames, windows: Windows, columns: slice, classifier_steps: int, request: FitRequest
    ) -> None:
        self.columns = windows.features[..., columns].to(request.device)
        self.contents, self.styles = windows.contents.to(request.device), windows.styles
        offsets = windows.offsets_m.mean(dim=0)
        self.offsets = in_statures(offsets[None]).to(request.device)
        n_rotations = 4 * N_JOINTS
        view = self._view(frames.motion[..., :n_rotations], torch.arange(len(windows)))
        self.of_content = _classifier(view, windows.contents, classifier_steps, request.seed).to(request.device)
        self.of_style = _classifier(view, windows.styles, classifier_steps, request.seed + 1).to(request.device)

    def __call__(self, made: Tensor, rows: Tensor, target: Tensor) -> dict[str, Tensor]:
        """Losses of rotations ``[B, T, 84]`` made of the windows ``rows`` ``[B]`` in the styles ``target`` ``[B]``."""
        view = self._view(made, rows)
        return {
            "content_class": functional.cross_entropy(self.of_content(view), self.contents[rows]),
            "style_class": functional.cross_entropy(self.of_style(view), target.to(view.device)),
        }

    def _view(self, unit: Tensor, rows: Tensor) -> Tensor:
        columns = self.columns[rows]
        wxyz = unit.reshape(*unit.shape[:2], N_JOINTS, 4)
        return seen(wxyz, columns[..., :1], columns[..., 1:], self.offsets.expand(len(wxyz), -1, -1))


def _classifier(view: Tensor, labels: Tensor, n_steps: int, seed: int) -> Stgcn:
    network = StgcnConfig(CANONICAL_PARENTS, int(labels.max()) + 1, n_frames=view.shape[1], widths=CLASSIFIER_WIDTHS)
    model, _ = train_classifier(
        view.numpy(), labels.numpy(), network, TrainingConfig(n_steps=n_steps, batch_size=64), seed=seed
    )
    return model.requires_grad_(False)
