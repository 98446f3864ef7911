"""Stylebench: a benchmark and evaluation harness for human-motion style transfer."""

__version__ = "0.1.0"
