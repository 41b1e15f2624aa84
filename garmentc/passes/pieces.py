"""The pieces that an outfit's edges do not join, and which of them are sewn on another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import connected

_SMALL = 0.15
"""Metres: the diagonal of the largest piece that is taken for a button, a badge or a pocket."""

_SEWN = 0.03
"""Metres from such a piece to the nearest vertex of what it is sewn on, at most."""

_THREADS = 3


@dataclass(frozen=True)
class Pieces:
    """The piece of each of n vertices.

    labels  (n,) which one
    count   of pieces
    """

    labels: NDArray[np.int32]
    count: int

    @classmethod
    def of(cls, pairs: NDArray[Any], vertices: int) -> Pieces:
        """What `pairs` (K, 2) of so many vertices join."""
        labels = connected(pairs, vertices)
        return cls(labels, int(labels.max(initial=-1)) + 1)

    def large(self, template: NDArray[Any]) -> NDArray[np.bool_]:
        """Which pieces (count,) of the vertices `template` (n, 3) are too large to be sewn on another."""
        low, high = np.full((self.count, 3), np.inf), np.full((self.count, 3), -np.inf)
        np.minimum.at(low, self.labels, template)
        np.maximum.at(high, self.labels, template)
        large: NDArray[np.bool_] = np.linalg.norm(high - low, axis=1) >= _SMALL
        return large

    def any(self, marked: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Whether any vertex of the same piece is `marked` (n, P); (n, P)."""
        if self.count == 1:
            return np.broadcast_to(marked.any(axis=0), marked.shape)
        some = np.zeros((self.count, marked.shape[1]), dtype=bool)
        np.logical_or.at(some, self.labels, marked)
        return some[self.labels]


def sewn_on(template: NDArray[Any], pairs: NDArray[Any]) -> tuple[NDArray[np.intp], Pieces]:
    """The `pairs` (K, 2) of vertices of `template` (n, 3) that are joined, and threads from small pieces to large ones
    right beside them; with those, the pieces that are left."""
    from scipy.spatial import cKDTree

    pieces = Pieces.of(pairs, len(template))
    large = pieces.large(template)[pieces.labels]
    ends, others = np.flatnonzero(~large), np.flatnonzero(large)
    if not len(ends) or not len(others):
        return pairs.astype(np.intp), pieces
    ranks = np.arange(1, min(_THREADS, len(others)) + 1)
    distance, nearest = cKDTree(template[others]).query(template[ends], k=ranks)
    gap = np.full(pieces.count, np.inf)
    np.minimum.at(gap, pieces.labels[ends], distance[:, 0])
    beneath = others[nearest]
    piece = pieces.labels[beneath]
    # All to the piece that is nearest: it sews no layers together.
    sewn = (piece == piece[:, :1]) & (gap[pieces.labels[ends]] < _SEWN)[:, None]
    threads = np.column_stack([np.broadcast_to(ends[:, None], sewn.shape)[sewn], beneath[sewn]])
    joined = np.concatenate([pairs, threads]).astype(np.intp)
    return joined, Pieces.of(joined, len(template))


def layers(template: NDArray[Any], pairs: NDArray[Any]) -> NDArray[np.intp]:
    """The layer (n,) of each vertex of `template` (n, 3): large pieces that `pairs` (K, 2) join, numbered from 0.

    A small piece belongs to the large one that is nearest to any of its vertices.
    """
    from scipy.spatial import cKDTree

    pieces = Pieces.of(pairs, len(template))
    large = pieces.large(template)
    number = np.cumsum(large) - 1
    vertex_large = large[pieces.labels]
    ends, others = np.flatnonzero(~vertex_large), np.flatnonzero(vertex_large)
    if len(ends) and len(others):
        distance, nearest = cKDTree(template[others]).query(template[ends])
        order = np.argsort(-distance, kind="stable")  # the nearest comes last, and stays
        number[pieces.labels[ends[order]]] = number[pieces.labels[others[nearest[order]]]]
    layer: NDArray[np.intp] = np.maximum(number, 0)[pieces.labels]
    return layer
