"""The edges of a garment as springs, which pull it back to the lengths that it was cut to."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edge_lengths


@dataclass(frozen=True)
class Springs:
    """E springs between n vertices.

    differences  sparse (3E, 3n) float32: takes vertices (3n,) to those at an edge's end minus those at its start
    means        sparse (3n, 3E) float32: takes edges (3E,) to the mean over each vertex's edges, with the sign of what
                 draws it towards the other end
    lengths      (E,) float32 metres, unstretched
    """

    differences: Any
    means: Any
    lengths: NDArray[np.float32]

    @classmethod
    def of(cls, template: NDArray[Any], edges: NDArray[Any]) -> Springs:
        """Springs along `edges` (E, 2), unstretched where vertices are at `template` (n, 3)."""
        from scipy.sparse import csr_matrix, diags, eye, kron

        signs = np.tile(np.array([-1, 1], dtype=np.float32), len(edges))
        rows = np.repeat(np.arange(len(edges)), 2)
        differences = csr_matrix((signs, (rows, edges.ravel())), shape=(len(edges), len(template)))
        lengths = edge_lengths(template, edges).astype(np.float32)
        valence = np.bincount(edges.ravel(), minlength=len(template))
        means = diags(-1 / np.maximum(valence, 1).astype(np.float32)) @ differences.T
        each = eye(3, dtype=np.float32)  # coordinates
        return cls(kron(each, differences, "csr"), kron(each, means, "csr"), lengths)

    def pull(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where to vertices (3, n, P) in P poses are pulled, (3, n, P): half an edge's stretch, the mean over edges."""
        along = self._differences(vertices)
        length = np.einsum("iep,iep->ep", along, along)
        np.sqrt(length, out=length)
        slack = np.divide(self.lengths[:, None], np.maximum(length, 1e-9, out=length), out=length)
        along *= np.subtract(1, slack, out=slack)
        pull = self._means(along)
        pull *= np.float32(0.5)
        return pull

    def sag(self, vertices: NDArray[np.float32], normals: NDArray[np.float32]) -> NDArray[np.float32]:
        """How far skin rises between vertices (3, n, P) that touch it, (n, P): the mean over each vertex's edges.

        Over an edge along which the skin's normal turns by an angle a, the skin rises by a/8 of its length, where it
        bulges. A cylinder's edges turn half as much on average as those across it, so twice that is taken: across a
        limb the full height. `normals` (3, n, P) are the skin's at the vertices, 0 where they do not touch it.
        """
        count = len(self.lengths)
        touching = np.asarray(normals.any(axis=0), np.float32)
        turned = self._differences(normals)
        rise = np.einsum("iep,iep->ep", turned, self._differences(vertices)) / 4
        rise *= (rise > 0) & (self.differences[:count, : len(touching)] @ touching == 0)
        sag: NDArray[np.float32] = self._means_of_lengths @ rise
        return sag

    @property
    def mean_lengths(self) -> NDArray[np.float32]:
        """(n,) metres: the mean over each vertex's edges, unstretched; 0 where there are none."""
        mean: NDArray[np.float32] = self._means_of_lengths @ self.lengths
        return mean

    @cached_property
    def _means_of_lengths(self) -> Any:
        """Sparse (n, E): the mean over each vertex's edges of what has no direction."""
        return abs(self.means[: self.means.shape[0] // 3, : len(self.lengths)])

    def roughness(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """How far `values` (3, n, P) are from the mean of their neighbours', with the opposite sign; (3, n, P)."""
        return self._means(self._differences(values))

    def _differences(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        apart: NDArray[np.float32] = self.differences @ values.reshape(-1, values.shape[2])
        return apart.reshape(3, -1, values.shape[2])

    def _means(self, along: NDArray[np.float32]) -> NDArray[np.float32]:
        mean: NDArray[np.float32] = self.means @ along.reshape(-1, along.shape[2])
        return mean.reshape(3, -1, along.shape[2])


def mean_edge_lengths(template: NDArray[Any], edges: NDArray[Any]) -> NDArray[np.float32]:
    """The mean length (N,) of the `edges` (E, 2) at each vertex of `template` (N, 3); 0 where there are none."""
    lengths = edge_lengths(template, edges)
    total = sum(np.bincount(ends, lengths, len(template)) for ends in edges.T)
    return (total / np.maximum(np.bincount(edges.ravel(), minlength=len(template)), 1)).astype(np.float32)
