"""Pose correctives: the vertex offsets that joint rotations switch on before skinning."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.smpl.skeleton import JOINT_COUNT

COLUMNS = 9 * (JOINT_COUNT - 1)
"""Columns of SMPL's posedirs: the row-major entries of R - I for joints 1..23."""


@dataclass(frozen=True)
class PoseCorrectives:
    """SMPL's posedirs (Loper et al. 2015, equation 9), kept per joint with only the vertices that a joint moves.

    A joint moves few vertices, so this is a small part of the dense (V, 3, 207) array, which takes longer to fill
    than everything else about a body takes to load.

    vertices    23 arrays (n_j,): the vertices that joint j + 1 moves, each once
    directions  23 arrays (9, n_j, 3): metres per entry of R - I, row-major
    """

    vertices: tuple[NDArray[np.intp], ...]
    directions: tuple[NDArray[Any], ...]

    @classmethod
    def from_dense(cls, posedirs: NDArray[Any]) -> PoseCorrectives:
        """From the dense array (V, 3, 207)."""
        blocks = posedirs.reshape(len(posedirs), 3, JOINT_COUNT - 1, 9)
        vertices = tuple(np.flatnonzero(blocks[:, :, j].any(axis=(1, 2))) for j in range(JOINT_COUNT - 1))
        directions = (blocks[moved, :, j].transpose(2, 0, 1) for j, moved in enumerate(vertices))
        return cls(vertices, tuple(np.ascontiguousarray(block) for block in directions))

    def dense(self, vertex_count: int) -> NDArray[Any]:
        """The dense array (V, 3, 207)."""
        posedirs = np.zeros((vertex_count, 3, JOINT_COUNT - 1, 9), dtype=self.directions[0].dtype)
        for j, (moved, block) in enumerate(zip(self.vertices, self.directions, strict=True)):
            posedirs[moved, :, j] = block.transpose(1, 2, 0)
        return posedirs.reshape(vertex_count, 3, COLUMNS)

    def astype(self, dtype: type[np.floating[Any]]) -> PoseCorrectives:
        """The same correctives in `dtype`."""
        return PoseCorrectives(self.vertices, tuple(block.astype(dtype) for block in self.directions))

    def of_vertices(self, rows: NDArray[Any]) -> PoseCorrectives:
        """The correctives of some vertices, `rows` in rising order."""
        vertices, directions = [], []
        for moved, block in zip(self.vertices, self.directions, strict=True):
            place = np.searchsorted(rows, moved)
            kept = rows[np.minimum(place, len(rows) - 1)] == moved
            vertices.append(place[kept])
            directions.append(block[:, kept])
        return PoseCorrectives(tuple(vertices), tuple(directions))

    def add_to(self, vertices: NDArray[Any], rotations: NDArray[Any]) -> None:
        """Add the offsets of joint rotations (..., 24, 3, 3) to vertices (..., V, 3) in place."""
        batch = rotations.shape[:-3]
        features = (rotations - np.eye(3, dtype=rotations.dtype)).reshape(*batch, JOINT_COUNT, 9)
        for j, (moved, block) in enumerate(zip(self.vertices, self.directions, strict=True)):
            offsets = features[..., j + 1, :] @ block.reshape(9, -1)
            vertices[..., moved, :] += offsets.reshape(*batch, -1, 3)
