"""The edges of a garment as springs, which pull it back to the lengths that it was cut to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


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
        lengths = np.linalg.norm(differences @ template.astype(np.float64), axis=1).astype(np.float32)
        valence = np.bincount(edges.ravel(), minlength=len(template))
        means = diags(-1 / np.maximum(valence, 1).astype(np.float32)) @ differences.T
        each = eye(3, dtype=np.float32)  # coordinates
        return cls(kron(each, differences, "csr"), kron(each, means, "csr"), lengths)

    def pull(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where to vertices (3, n, P) in P poses are pulled, (3, n, P): half an edge's stretch, the mean over edges."""
        along = self._differences(vertices)
        length = np.sqrt(np.einsum("iep,iep->ep", along, along))
        slack = np.divide(self.lengths[:, None], np.maximum(length, 1e-9, out=length), out=length)
        along *= np.subtract(1, slack, out=slack)
        return 0.5 * self._means(along)

    def roughness(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """How far `values` (3, n, P) are from the mean of their neighbours', with the opposite sign; (3, n, P)."""
        return self._means(self._differences(values))

    def _differences(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        apart: NDArray[np.float32] = self.differences @ values.reshape(-1, values.shape[2])
        return apart.reshape(3, -1, values.shape[2])

    def _means(self, along: NDArray[np.float32]) -> NDArray[np.float32]:
        mean: NDArray[np.float32] = self.means @ along.reshape(-1, along.shape[2])
        return mean.reshape(3, -1, along.shape[2])
