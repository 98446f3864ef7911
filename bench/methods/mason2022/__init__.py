"""Mason et al. 2022, Real-Time Style Modelling of Human Locomotion: seven models of the next frame."""
