"""The procedural dataset: generated, seeded, licence-free, and with the true answer of every task.

Read it in this order: ``dataset`` (which takes there are), ``performance`` (what is done, and its rendering in a
style), ``styles``, ``actors``, then the actions themselves in ``locomotion``, ``actions`` and ``gestures``.
"""

from __future__ import annotations

from bench.datasets.procedural.dataset import ENTRY, imitated, load, performed_by, true_answer, unseen_takes

__all__ = ["ENTRY", "imitated", "load", "performed_by", "true_answer", "unseen_takes"]
