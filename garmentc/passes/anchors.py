"""Some vertices that stand for all, so that a pass costs the same on any outfit: the others move with them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals
from garmentc.passes.part_of_rig import spread_vertices
from garmentc.passes.pieces import layers
from garmentc.rig import Rig

_NORMAL_REACH = 0.05
_LAYER_REACH = 1.0
_NEIGHBOURS = 6
_SUPPORT = 4
_VALUES_AT_ONCE = 2_000_000


@dataclass(frozen=True)
class Anchors:
    """Vertices of an outfit, spread over it.

    rows    (n,) which vertices
    places  (N, 7) position, scaled normal and layer of every vertex at rest. Vertices are neighbours where these are
            close: the two sides of a gap face each other, so nothing leaks across it, and neither from layer to layer
    """

    rows: NDArray[np.intp]
    places: NDArray[np.float64]

    @classmethod
    def of(cls, rig: Rig, most: int) -> Anchors:
        template = rig.template.astype(np.float64)
        normals = _NORMAL_REACH * vertex_normals(template, rig.triangles)
        joined = np.concatenate([rig.triangles[:, :2], rig.triangles[:, 1:]])
        layer = _LAYER_REACH * layers(template, joined).astype(np.float64)
        return cls(spread_vertices(rig.vertex_count, most), np.column_stack([template, normals, layer]))

    @property
    def normals(self) -> NDArray[np.float64]:
        """Unit normals (n, 3) of the anchors at rest."""
        return self.places[self.rows, 3:6] / _NORMAL_REACH

    @cached_property
    def smoother(self) -> Any:
        """Sparse (n, n) float32: the mean of each anchor and its nearest others."""
        from scipy.sparse import csr_matrix

        own = self.places[self.rows]
        count = min(_NEIGHBOURS + 1, len(own))
        nearest = self._tree.query(own, k=np.arange(1, count + 1))[1]
        row, share = np.repeat(np.arange(len(own)), count), np.full(nearest.size, 1 / count, dtype=np.float32)
        return csr_matrix((share, (row, nearest.ravel())), shape=(len(own), len(own)))

    def joined(self, edges: NDArray[Any]) -> NDArray[np.intp]:
        """Pairs (K, 2) of anchors that `edges` (E, 2) of the outfit join: each vertex counts as its nearest anchor."""
        if len(self.rows) == len(self.places):
            return edges.astype(np.intp)
        pairs = np.sort(self._tree.query(self.places, workers=-1)[1][edges], axis=1)
        joined: NDArray[np.intp] = np.unique(pairs[pairs[:, 0] < pairs[:, 1]], axis=0)
        return joined

    def interpolators(self, size: int) -> Iterator[tuple[slice, Any]]:
        """Blocks of at most `size` vertices and, for each, the sparse (B, n) float32 that takes anchors' values to it.

        Shares fall with the square of the distance and sum to 1; an anchor hangs on itself.
        """
        from scipy.sparse import csr_matrix

        everyone, count = len(self.rows) == len(self.places), len(self.places)
        ranks = np.arange(1, min(_SUPPORT, len(self.rows)) + 1)
        for start in range(0, count, size):
            rows = slice(start, min(start + size, count))
            if everyone:
                nearest, share = np.arange(rows.start, rows.stop)[:, None], np.ones((rows.stop - start, 1))
            else:
                distance, nearest = self._tree.query(self.places[rows], k=ranks, workers=-1)
                share = 1 / np.maximum(distance, 1e-9) ** 2
                share /= share.sum(axis=1, keepdims=True)
            ends = np.arange(len(nearest) + 1) * nearest.shape[1]
            shape = (len(nearest), len(self.rows))
            yield rows, csr_matrix((share.ravel().astype(np.float32), nearest.ravel(), ends), shape=shape)

    def carried(self, shapes: NDArray[np.float32]) -> Iterator[tuple[slice, NDArray[np.float32]]]:
        """Blocks of vertices and, for each, the shapes (K, B, 3) that shapes of the anchors (K, n, 3) make of them."""
        by_anchor = shapes.transpose(1, 2, 0).reshape(len(self.rows), -1)
        for rows, interpolator in self.interpolators(max(1, _VALUES_AT_ONCE // max(1, by_anchor.shape[1]))):
            yield rows, (interpolator @ by_anchor).reshape(-1, 3, len(shapes)).transpose(2, 0, 1)

    @cached_property
    def _tree(self) -> Any:
        from scipy.spatial import cKDTree

        return cKDTree(self.places[self.rows])
