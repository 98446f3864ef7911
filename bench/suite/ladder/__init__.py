"""Metrics under test: real motion corrupted step by step, and what every metric must make of it.

Read it in this order: ``rungs`` (the corruptions and their levels), ``climb`` (scoring them with the judges),
``declared`` (what must happen), ``verdict`` (whether it did), ``page`` (docs/metrics/ladder.md from stored numbers).
"""
