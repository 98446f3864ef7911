"""Conv1D+AdaIN, a baseline of Motion Puzzle: the networks of Aberman et al. 2020, the losses of Jang et al. 2022."""
