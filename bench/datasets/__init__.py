"""Datasets: takes with labels, split into parts. The table of all is in bench.datasets.table."""
