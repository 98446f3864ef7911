"""Diverse Motion Stylization for Multiple Style Domains via Spatial-Temporal Graph-Based Generative Model."""
