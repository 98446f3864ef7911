"""Kuriyama et al. 2022, Context-based style transfer of tokenized gestures."""
