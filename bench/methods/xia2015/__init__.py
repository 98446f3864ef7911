"""Xia et al. 2015, Realtime Style Transfer for Unlabeled Heterogeneous Human Motion."""
