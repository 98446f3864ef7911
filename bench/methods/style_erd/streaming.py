"""What is asked of a trained Style-ERD: whole clips, and streams of frames with a state of their own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from bench.arrays import FloatArray
from bench.methods import rotations
from bench.methods.style_erd.frames import N_ROTATIONS, Frames
from bench.methods.style_erd.network import State
from bench.methods.style_erd.style_erd import StyleErdNetwork
from bench.methods.windows import at_training_rate
from bench.motion.clip import Clip
from bench.motion.skeleton import N_JOINTS

Mixture = Sequence[tuple[str | None, float]]
"""Style labels and their weights; less than 1 in sum leaves a rest of neutral (section 4.4)."""


class StyleErdStream:
    """An open transfer: frames in, as many out; the state after them is all that is kept.

    Parameters
    ----------
    content : label of what comes in; None where it is not known.
    styles : what shall come out.
    source_style : label of what comes in; None where it is not known, which the network takes for neutral.
    """

    def __init__(
        self, network: StyleErdNetwork, content: str | None, styles: Mixture, source_style: str | None = None
    ) -> None:
        self.network = network
        self.contents = network.content_weights(content)
        self.target = network.style_weights(styles)
        self.source = network.style_weights([(source_style, 1.0)] if source_style else [])
        with torch.inference_mode():
            self.states: list[State] = network.generator.initial(self.contents)
        self.before: Tensor | None = None

    def step(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Answer one frame: ``[21, 4]`` and ``[3]`` in, the same out."""
        return self.frames(rotations_wxyz[None], root_xyz_m[None])[0], root_xyz_m

    @torch.inference_mode()
    def frames(self, rotations_wxyz: FloatArray, root_xyz_m: FloatArray) -> FloatArray:
        """Rotations ``[T, 21, 4]`` of the frames that follow those before; the root path stays the source's."""
        net = self.network
        unit, root = (torch.from_numpy(np.array(x, dtype=np.float32)[None]) for x in (rotations_wxyz, root_xyz_m))
        read: Frames = net.reader(unit, root, self.before)
        code, self.states = net.generator.recur(net.code(read, self.contents, self.source), self.target, self.states)
        self.before = read.last
        made = net.decode(read, code, self.target)[..., :N_ROTATIONS].reshape(1, -1, N_JOINTS, 4)
        turned = rotations.multiply(read.heading, made[:, :, 0])
        return torch.cat([turned[:, :, None], made[:, :, 1:]], dim=2)[0].double().numpy()

    def copy(self) -> StyleErdStream:
        """A second stream that goes on from here on its own; states are replaced, never written to."""
        twin = object.__new__(StyleErdStream)
        twin.__dict__.update(self.__dict__)
        return twin


def transfer(network: StyleErdNetwork, content: Clip, label: str | None, styles: Mixture) -> Clip:
    """A whole clip as a stream of its frames at 30 fps; as offline, it differs from the stream by rounding alone."""

    def answer(clip: Clip) -> Clip:
        stream = StyleErdStream(network, label, styles)
        return clip.with_motion(stream.frames(clip.rotations_wxyz, clip.root_xyz_m), clip.root_xyz_m)

    return at_training_rate(content, answer)
