"""Graphs, partitions and the spatial-temporal convolution."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from classifiers.graph import (
    BadGraph,
    GraphConv,
    SpatialTemporalConv,
    distance_partition,
    hop_distances,
    spatial_partition,
)

CANONICAL = (-1, 0, 1, 2, 3, 0, 5, 6, 7, 0, 9, 10, 11, 10, 13, 14, 15, 10, 17, 18, 19)
PARK_10 = (4, 0, 4, 2, -1, 4, 5, 6, 5, 8)
STAR_5 = (2, 2, -1, 2, 2)


def edge_counts(parents: tuple[int, ...], *, faithful: bool) -> tuple[int, int, int]:
    """Directed edges that fall into the nearer, the farther and the self subset."""
    same, nearer, farther = (int(np.count_nonzero(s)) for s in spatial_partition(parents, faithful=faithful))
    return nearer, farther, same - len(parents)


@pytest.mark.parametrize(("parents", "counts"), [(CANONICAL, (6, 6, 28)), (PARK_10, (7, 7, 4)), (STAR_5, (4, 4, 0))])
def test_faithful_partition_reproduces_the_collapse(parents: tuple[int, ...], counts: tuple[int, int, int]) -> None:
    assert edge_counts(parents, faithful=True) == counts


@pytest.mark.parametrize("parents", [CANONICAL, PARK_10, STAR_5])
def test_true_partition_puts_every_edge_nearer_or_farther(parents: tuple[int, ...]) -> None:
    edges = len(parents) - 1
    assert edge_counts(parents, faithful=False) == (edges, edges, 0)


def test_nearer_subset_sends_parents_to_children() -> None:
    _, nearer, farther = spatial_partition(CANONICAL)
    assert nearer[0, 1] == 1.0 and nearer[1, 0] == 0.0
    assert farther[1, 0] == pytest.approx(1.0 / 3.0) and farther[0, 1] == 0.0


def test_weights_sum_to_one_over_the_subset_or_the_neighbourhood() -> None:
    for partition in (spatial_partition(CANONICAL), distance_partition(CANONICAL, 2)):
        sums = partition.sum(axis=1)
        assert np.all(np.isclose(sums, 1.0) | (sums == 0.0))
    for partition in (spatial_partition(CANONICAL, faithful=True), distance_partition(CANONICAL, 2, faithful=True)):
        assert np.allclose(partition.sum(axis=(0, 1)), 1.0)


@pytest.mark.parametrize(("parents", "max_hop", "subsets"), [(CANONICAL, 2, 3), (PARK_10, 1, 2), (STAR_5, 1, 2)])
def test_distance_partition_has_one_subset_a_hop(parents: tuple[int, ...], max_hop: int, subsets: int) -> None:
    partition = distance_partition(parents, max_hop)
    assert partition.shape == (subsets, len(parents), len(parents))
    assert np.array_equal(partition[0], np.eye(len(parents)))


@given(st.lists(st.integers(0, 1000), min_size=1, max_size=15))
def test_hop_distances_are_a_metric_on_any_tree(draws: list[int]) -> None:
    parents = [-1, *(draw % (joint + 1) for joint, draw in enumerate(draws))]
    hops = hop_distances(parents)
    assert np.array_equal(hops, hops.T) and np.all(np.diag(hops) == 0.0)
    assert np.all(hops[:, :, None] <= hops[:, None, :] + hops.T[None, :, :])
    assert np.count_nonzero(hops == 1.0) == 2 * len(draws)


@pytest.mark.parametrize("parents", [(0, 1), (-1, -1), (-1, 2, 1), (-1, 5)])
def test_what_is_no_tree_is_refused(parents: tuple[int, ...]) -> None:
    with pytest.raises(BadGraph, match="parents must"):
        hop_distances(parents)


def test_graph_conv_equals_the_written_out_sum() -> None:
    torch.manual_seed(0)
    partition = spatial_partition(CANONICAL)
    conv = GraphConv(5, 8, partition)
    with torch.no_grad():
        conv.edge_importance.uniform_(0.5, 1.5)
    x = torch.randn(2, 5, 6, 21)
    adjacency = torch.as_tensor(partition, dtype=torch.float32) * conv.edge_importance
    weights = conv.mix.weight.view(8, 3, 5)
    expected = torch.einsum("okc,nctu,kuv->notv", weights, x, adjacency) + conv.mix.bias[:, None, None]
    assert torch.allclose(conv(x), expected, atol=1e-5)


@pytest.mark.parametrize(("stride", "frames"), [(1, 9), (2, 5)])
def test_spatial_temporal_conv_shapes(stride: int, frames: int) -> None:
    conv = SpatialTemporalConv(3, 4, spatial_partition(CANONICAL), 5, stride=stride)
    assert conv(torch.zeros(2, 3, 9, 21)).shape == (2, 4, frames, 21)
