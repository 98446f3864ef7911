"""Aberman et al. 2020, Unpaired Motion Style Transfer from Video to Animation, and a variant taught contents."""
