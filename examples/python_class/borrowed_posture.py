"""A Python class is enough: the source's motion with the mean spine of the style reference."""

from bench.adapters.base import Adapter
from bench.motion import quat
from bench.motion.skeleton import PARTS


class BorrowedPosture(Adapter):
    name = "borrowed-posture"
    title = "borrowed posture"

    def transfer(self, content, style, *, rng):
        spine = PARTS["spine"][1:]
        rotations_wxyz = content.clip.rotations_wxyz.copy()
        rotations_wxyz[:, spine] = quat.mean(style.clip.rotations_wxyz[:, spine])
        return content.clip.with_motion(rotations_wxyz, content.clip.root_xyz_m)
