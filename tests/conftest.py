"""Shared test set-up: hypothesis without deadlines (compiled kernels are slow once), real data by environment."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("stylebench", deadline=None, derandomize=True, max_examples=50)
settings.load_profile("stylebench")


def real_data(name: str) -> Path:
    """A file or folder of real motion under ``$STYLEBENCH_DATA``; the test is skipped where there is none."""
    root = os.environ.get("STYLEBENCH_DATA")
    if not root:
        pytest.skip("STYLEBENCH_DATA is not set: real motion is not here")
    path = Path(root) / name
    if not path.exists():
        pytest.skip(f"{path} does not exist")
    return path


@pytest.fixture(scope="session")
def bandai_namco_zip() -> Path:
    """The 1310 takes of Bandai-Namco dataset 2 as one archive."""
    return real_data("bandai-namco-2-dev.zip")


@pytest.fixture(scope="session")
def xia_folder() -> Path:
    """A few clips of Xia et al. 2015 on the 31-joint CMU skeleton."""
    return real_data("xia-sample")
