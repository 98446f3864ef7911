"""Jang et al. 2022, Motion Puzzle: arbitrary motion style transfer by body part."""
