"""Anchor rows that look at the fit part: mean pose, style mean-shift, and the two retrieval rows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bench.adapters.anchors import Anchor
from bench.adapters.base import ProgressCallback, Traits
from bench.adapters.window_bank import WINDOW_FRAMES, WindowBank, describe_window
from bench.arrays import FloatArray
from bench.datasets.take import Take
from bench.errors import BadData
from bench.motion import quat
from bench.motion.clip import Clip
from bench.motion.edit import crop
from bench.motion.pose import (
    from_local_rotation_vectors,
    heading_removed,
    local_rotation_vectors,
    onto_skeleton,
)
from bench.motion.skeleton import PARTS

ARRAYS_FILE = "arrays.npz"
ROOT = 0


class MeanPose(Anchor):
    """The mean pose of the fit part, held at the source's place: the floor of everything."""

    name = "mean-pose"
    title = "mean pose"
    description = "the mean pose of the fit part, held still"
    draws_from = "fit"

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self.reference, self.height_statures = mean_pose(takes)

    def save(self, folder: Path) -> None:
        np.savez(folder / ARRAYS_FILE, reference=self.reference, height=np.array(self.height_statures))

    def load(self, folder: Path) -> None:
        with np.load(folder / ARRAYS_FILE, allow_pickle=False) as stored:
            self.reference, self.height_statures = stored["reference"], float(stored["height"])

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self._held(content.clip)

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return self._held(content.clip)

    def predict(self, past: Clip, style: Take, trajectory_xz_m: FloatArray) -> Clip:
        pose = self._held(crop(past, past.n_frames - 1, 1))
        root = pose.root_xyz_m.copy()
        root[0, [0, 2]] = trajectory_xz_m[0]
        return pose.with_motion(pose.rotations_wxyz, root)

    def _held(self, source: Clip) -> Clip:
        _, yaw = heading_removed(source)
        root = np.repeat(source.root_xyz_m[:1], source.n_frames, axis=0)
        root[:, 1] = self.height_statures * source.skeleton.stature_m
        still = np.zeros((source.n_frames, source.skeleton.n_joints, 3))
        return from_local_rotation_vectors(still, self.reference, np.full(len(yaw), yaw[0]), root, source)


class StyleMeanShift(Anchor):
    """The source moved by the difference of the two styles' mean poses: style as posture and nothing else."""

    name = "style-mean-shift"
    title = "style mean-shift"
    description = "source pose + (mean pose of the target style - mean pose of the source style), means over fit"
    draws_from = "fit"
    traits = Traits(needs_style_label=True, needs_source_style_label=True)

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self.reference, _ = mean_pose(takes)
        self.styles = sorted({str(take.style) for take in takes})
        means = [self._mean_of([take for take in takes if take.style == style]) for style in self.styles]
        self.vectors = np.stack([vectors for vectors, _ in means])
        self.heights = np.array([height for _, height in means])

    def _mean_of(self, takes: Sequence[Take]) -> tuple[FloatArray, float]:
        vectors = np.concatenate([local_rotation_vectors(take.clip, self.reference) for take in takes])
        heights = np.concatenate([take.clip.root_xyz_m[:, 1] / take.clip.skeleton.stature_m for take in takes])
        return vectors.mean(axis=0), float(heights.mean())

    def save(self, folder: Path) -> None:
        np.savez(
            folder / ARRAYS_FILE,
            reference=self.reference,
            styles=np.array(self.styles),
            vectors=self.vectors,
            heights=self.heights,
        )

    def load(self, folder: Path) -> None:
        with np.load(folder / ARRAYS_FILE, allow_pickle=False) as stored:
            self.reference, self.vectors, self.heights = stored["reference"], stored["vectors"], stored["heights"]
            self.styles = [str(style) for style in stored["styles"]]

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self._shifted(content, [(style.style, 1.0)], PARTS["all"])

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        return self._shifted(content, [(style_label, 1.0)], PARTS["all"])

    def interpolate(self, content: Take, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator) -> Clip:
        return self.interpolate_parts(content, "all", styles, rng=rng)

    def interpolate_parts(
        self, content: Take, part: str, styles: Sequence[tuple[Take, float]], *, rng: np.random.Generator
    ) -> Clip:
        return self._shifted(content, [(style.style, weight) for style, weight in styles], PARTS[part])

    def transfer_parts(self, content: Take, styles: Mapping[str, Take], *, rng: np.random.Generator) -> Clip:
        clip = content.clip
        for part, style in styles.items():
            clip = self._shifted(content.with_clip(clip), [(style.style, 1.0)], PARTS[part])
        return clip

    def _shifted(self, content: Take, mixture: Sequence[tuple[str | None, float]], joints: Sequence[int]) -> Clip:
        """The source with the joints moved from its own style's mean pose to a mixture of styles' mean poses.

        A source whose style is unknown starts from the mean over all styles.
        """
        source = content.clip
        known = content.style in self.styles
        starts = [self._index(content.style)] if known else list(range(len(self.styles)))
        start, start_height = self.vectors[starts].mean(axis=0), float(self.heights[starts].mean())
        ends = [(self._index(style), weight) for style, weight in mixture]
        shift = sum((weight * self.vectors[end] for end, weight in ends), -start)
        _, yaw = heading_removed(source)
        vectors = local_rotation_vectors(source, self.reference)
        vectors[:, list(joints)] += shift[list(joints)]
        root = source.root_xyz_m.copy()
        if ROOT in joints:
            height = sum(weight * float(self.heights[end]) for end, weight in ends) - start_height
            root[:, 1] += height * source.skeleton.stature_m
        return from_local_rotation_vectors(vectors, self.reference, yaw, root, source)

    def _index(self, style: str | None) -> int:
        if style not in self.styles:
            raise BadData(f"style {style!r} was not in the fit part, which has {', '.join(self.styles)}")
        return self.styles.index(style)


class NearestPose(Anchor):
    """Retrieval: the fit window of the target style nearest to the source by joint positions, not judge features."""

    name = "retrieve-nearest-pose"
    title = "retrieve nearest pose"
    description = "the fit window of the target style whose joint positions are nearest to the source's"
    draws_from = "fit"
    traits = Traits(needs_style_label=True, designed_input_frames=WINDOW_FRAMES, only_designed_input=True)

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        self.bank = WindowBank.of(takes)

    def save(self, folder: Path) -> None:
        self.bank.save(folder)

    def load(self, folder: Path) -> None:
        self.bank = WindowBank.load(folder)

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.sample(content, str(style.style), rng=rng)

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        rows = self.bank.rows(style=style_label)
        distances = np.linalg.norm(self.bank.descriptors[rows] - describe_window(content.clip), axis=1)
        return onto_skeleton(self.bank.clip(int(rows[np.argmin(distances)])), content.clip.skeleton)


class ClassifyAndRetrieve(Anchor):
    """Retrieval by label: guesses the source's content with its own classifier, returns a random fit window.

    The classifier is a multinomial logistic regression on pose descriptors, trained on the fit part only; it shares
    nothing with the judges.
    """

    name = "classify-and-retrieve"
    title = "classify and retrieve"
    description = "a random fit window of the predicted content and the target style"
    draws_from = "fit"
    traits = Traits(needs_style_label=True, designed_input_frames=WINDOW_FRAMES, only_designed_input=True)

    def fit(self, takes: Sequence[Take], *, seed: int, budget: str, progress: ProgressCallback) -> None:
        from sklearn.linear_model import LogisticRegression

        self.bank = WindowBank.of(takes)
        self.contents = sorted(set(self.bank.contents))
        self.centre = self.bank.descriptors.mean(axis=0)
        self.scale = self.bank.descriptors.std(axis=0) + 1e-3
        model = LogisticRegression(C=0.01, max_iter=200)
        model.fit(self._standardised(self.bank.descriptors), [self.contents.index(c) for c in self.bank.contents])
        weights = np.concatenate([model.coef_, model.intercept_[:, None]], axis=1)
        # With two classes scikit-learn keeps one row, the log-odds of the second.
        self.weights = np.concatenate([-weights, weights]) if len(self.contents) == 2 else weights

    def save(self, folder: Path) -> None:
        self.bank.save(folder)
        np.savez(
            folder / ARRAYS_FILE,
            contents=np.array(self.contents),
            centre=self.centre,
            scale=self.scale,
            weights=self.weights,
        )

    def load(self, folder: Path) -> None:
        self.bank = WindowBank.load(folder)
        with np.load(folder / ARRAYS_FILE, allow_pickle=False) as stored:
            self.contents = [str(content) for content in stored["contents"]]
            self.centre, self.scale, self.weights = stored["centre"], stored["scale"], stored["weights"]

    def predicted_content(self, clip: Clip) -> str:
        """The classifier's guess for a window."""
        features = self._standardised(describe_window(clip)[None])[0]
        return self.contents[int(np.argmax(self.weights[:, :-1] @ features + self.weights[:, -1]))]

    def transfer(self, content: Take, style: Take, *, rng: np.random.Generator) -> Clip:
        return self.sample(content, str(style.style), rng=rng)

    def sample(self, content: Take, style_label: str, *, rng: np.random.Generator) -> Clip:
        rows = self.bank.rows(content=self.predicted_content(content.clip), style=style_label)
        if len(rows) == 0:
            rows = self.bank.rows(style=style_label)
        return onto_skeleton(self.bank.clip(int(rng.choice(rows))), content.clip.skeleton)

    def _standardised(self, descriptors: FloatArray) -> FloatArray:
        return np.asarray((descriptors - self.centre) / self.scale)


def mean_pose(takes: Sequence[Take]) -> tuple[FloatArray, float]:
    """Mean rotation per joint ``[J, 4]`` without heading, and mean root height in statures, over all frames."""
    reference = quat.mean(np.concatenate([heading_removed(take.clip)[0] for take in takes]))
    heights = np.concatenate([take.clip.root_xyz_m[:, 1] / take.clip.skeleton.stature_m for take in takes])
    return reference, float(heights.mean())
