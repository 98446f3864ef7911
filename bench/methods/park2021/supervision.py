"""What ``park2021-content`` adds, which is not in the paper: two classifiers of our own that an output has to satisfy.

They are trained on the windows of the fit part alone, one on content and one on style labels, and share nothing with
the judges but the kind of network.
"""

from __future__ import annotations

import torch
from torch import Tensor
from torch.nn import functional

from bench.methods.aberman2020.content import CLASSIFIER_WIDTHS
from bench.methods.windows import Windows
from bench.motion.skeleton import CANONICAL_PARENTS
from classifiers.stgcn import Stgcn, StgcnConfig
from classifiers.train import TrainingConfig, train_classifier


class Supervision:
    """Losses of transferred features ``[B, T, 21, 7]`` against their sources."""

    def __init__(self, features: Tensor, windows: Windows, n_steps: int, seed: int, device: str) -> None:
        self.of_content = _classifier(features, windows.contents, n_steps, seed).to(device)
        self.of_style = _classifier(features, windows.styles, n_steps, seed + 1).to(device)

    def __call__(self, made: Tensor, source: Tensor, contents: Tensor, styles: Tensor) -> dict[str, Tensor]:
        """Content features as the source's, and cross entropies with the source's content and the target style.

        Parameters
        ----------
        made, source : ``[B, T, 21, 7]``.
        contents, styles : ``[B]`` labels that the output should have.
        """
        deep = _content_features(self.of_content, made)
        with torch.no_grad():
            wanted = _content_features(self.of_content, source)
        return {
            "perceptual": (deep - wanted).abs().mean(),
            "content_class": functional.cross_entropy(self.of_content.logits(deep.mean(dim=2)), contents),
            "style_class": functional.cross_entropy(self.of_style(made), styles),
        }


def _content_features(classifier: Stgcn, windows: Tensor) -> Tensor:
    """The last feature map averaged over joints, ``[B, C, T']``."""
    standard = classifier.standardise(windows[:, :: classifier.config.frame_step])
    deep: Tensor = classifier.blocks(standard.permute(0, 3, 1, 2))
    return deep.mean(dim=3)


def _classifier(features: Tensor, labels: Tensor, n_steps: int, seed: int) -> Stgcn:
    network = StgcnConfig(
        CANONICAL_PARENTS, int(labels.max()) + 1, n_frames=features.shape[1], widths=CLASSIFIER_WIDTHS
    )
    model, _ = train_classifier(features.numpy(), labels.numpy(), network, TrainingConfig(n_steps=n_steps), seed=seed)
    return model.requires_grad_(False)
