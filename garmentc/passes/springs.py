"""The edges of a garment as springs, which pull it back to the lengths that it was cut to."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Springs:
    """E springs between n vertices.

    differences  sparse (E, n) float32: takes the vertices' values to those at an edge's end minus those at its start
    lengths      (E,) float32 metres, unstretched
    valence      (n,) float32: edges at a vertex, at least 1
    """

    differences: Any
    lengths: NDArray[np.float32]
    valence: NDArray[np.float32]

    @classmethod
    def of(cls, template: NDArray[Any], edges: NDArray[Any]) -> Springs:
        """Springs along `edges` (E, 2), unstretched where vertices are at `template` (n, 3)."""
        from scipy.sparse import csr_matrix

        signs = np.tile(np.array([-1, 1], dtype=np.float32), len(edges))
        rows = np.repeat(np.arange(len(edges)), 2)
        differences = csr_matrix((signs, (rows, edges.ravel())), shape=(len(edges), len(template)))
        lengths = np.linalg.norm(differences @ template.astype(np.float64), axis=1).astype(np.float32)
        valence = np.bincount(edges.ravel(), minlength=len(template))
        return cls(differences, lengths, np.maximum(valence, 1).astype(np.float32))

    def pull(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """Where to vertices (n, 3, P) in P poses are pulled, (n, 3, P): half an edge's stretch, the mean over edges."""
        along = self._differences(vertices)
        length = np.sqrt(np.einsum("eip,eip->ep", along, along))
        along *= (0.5 * (1 - self.lengths[:, None] / np.maximum(length, 1e-9)))[:, None]
        return self._gathered(along)

    def roughness(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        """How far `values` (n, 3, P) are from the mean of their neighbours', with the opposite sign; (n, 3, P)."""
        return self._gathered(self._differences(values))

    def _differences(self, values: NDArray[np.float32]) -> NDArray[np.float32]:
        apart: NDArray[np.float32] = self.differences @ values.reshape(len(values), -1)
        return apart.reshape(-1, *values.shape[1:])

    def _gathered(self, along: NDArray[np.float32]) -> NDArray[np.float32]:
        """What edges (E, 3, P) do to their two ends, in opposite directions; (n, 3, P)."""
        total: NDArray[np.float32] = -(self.differences.T @ along.reshape(len(along), -1))
        total /= self.valence[:, None]
        return total.reshape(-1, *along.shape[1:])
