"""Tao et al. 2022, Style-ERD: responsive and coherent online motion style transfer."""
