"""A Deep Learning Framework for Character Motion Synthesis and Editing (Holden, Saito and Komura 2016)."""
