"""Research code as it is: any Python from 3.7, any numpy or torch; it knows nothing of the benchmark.

The same as ``examples/python_class``: the source's motion with the mean spine of the style reference.
"""

import numpy as np

print("whatever this prints goes to the log; numpy", np.__version__)  # noqa: T201


def transfer(content, style):
    spine = [content.names.index(name) for name in ("Spine", "Spine1", "Neck1", "Head")]
    rotations = content.rotations_wxyz
    rotations[:, spine] = mean_rotations(style.rotations_wxyz[:, spine])
    return rotations, content.root_xyz_m


def mean_rotations(rotations):
    """Mean unit quaternions [J, 4] over [T, J, 4]: the largest eigenvector of their outer products."""
    outer = np.einsum("tji,tjk->jik", rotations, rotations)
    return np.linalg.eigh(outer)[1][:, :, -1]
