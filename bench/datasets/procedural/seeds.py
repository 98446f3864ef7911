"""Seeds and digests of the procedural dataset: everything random is derived from names by hashing."""

from __future__ import annotations

import hashlib
import json
from typing import Any

import numpy as np

GENERATOR_VERSION = 1
"""Raised whenever a generated motion changes; part of every seed and of the dataset's digest."""


def canonical_digest(content: Any) -> str:
    """blake2b (16 bytes, hex) of the canonical JSON of ``content``."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.blake2b(text.encode(), digest_size=16).hexdigest()


def generator(*names: str | int) -> np.random.Generator:
    """A random generator decided by the generator version and ``names`` alone."""
    digest = canonical_digest([GENERATOR_VERSION, *names])
    return np.random.default_rng(int(digest, 16))
