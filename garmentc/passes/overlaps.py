"""Cloth that lies over other cloth: it should stay there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.compiled import compiled
from garmentc.outfit.topology import edge_lengths, triangle_normals
from garmentc.passes.pieces import Pieces
from garmentc.smpl.nearest import closest_on_surface

_Floats = NDArray[np.float32]

_REACH = 0.03
"""Metres: cloth farther off at rest is another story."""

_ALONG = 0.1
"""Metres along the cloth: what is nearer that way is the same layer, bent."""

_STEEPEST = 0.5
"""Cosine between the way up from cloth and a normal, its own or its skin's: what is more to the side does not lie over
it. Straps lie between the vertices of what is beneath, so much is to the side."""

_FACING = 0.5
"""Cosine between the normals of two layers: what faces another way is a lining, or the other side of a fold."""

_NEIGHBOURS = 24
_SEARCHED_AT_ONCE = 512

_GAP = 0.003
"""Metres that cloth keeps from what is beneath it; where there is less at rest, less."""

_DEEPEST = 0.03
"""Metres beneath that cloth still comes up from."""

_BESIDE = 0.03
"""Metres along the skin: what has slid farther off no longer lies over it."""


@dataclass(frozen=True)
class Overlaps:
    """K vertices of an outfit that lie over others, each once.

    over, beneath  (K,) which vertices
    gaps           (K,) float32 metres that they keep
    """

    over: NDArray[np.intp]
    beneath: NDArray[np.intp]
    gaps: _Floats

    @classmethod
    def of(
        cls,
        template: NDArray[Any],
        normals: NDArray[Any],
        pairs: NDArray[Any],
        pieces: Pieces,
        skin: NDArray[Any],
        faces: NDArray[Any],
    ) -> Overlaps:
        """Of `template` (n, 3) with unit `normals` (n, 3), which `pairs` (K, 2) join to `pieces`, on the `skin` (V, 3),
        (F, 3).

        Layers need not be pieces: the straps of dungarees, sewn to a shirt, lie over it. Small pieces are none.
        """
        from scipy.spatial import cKDTree

        count = len(template)
        ranks = np.arange(1, min(_NEIGHBOURS, count) + 1)
        distance, near = cKDTree(template).query(template, k=ranks, distance_upper_bound=_REACH)
        near = np.minimum(near, count - 1)
        height = np.einsum("nki,nki->nk", template[:, None] - template[near], normals[near])
        lies = np.isfinite(distance) & (height > _STEEPEST * distance)
        lies &= np.einsum("ni,nki->nk", normals, normals[near]) > _FACING
        large = pieces.large(template)[pieces.labels]
        lies &= large[near] & large[:, None]
        rows = np.flatnonzero(lies.any(axis=1))
        if not len(rows):
            return NO_OVERLAPS
        lies = lies[rows] & _far_along(template, pairs, rows, near[rows])
        found = lies.any(axis=1)
        over, first = rows[found], lies[found].argmax(axis=1)
        beneath = near[over, first]
        outwards = triangle_normals(skin, faces)[closest_on_surface(template[beneath], skin, faces).face]
        up = np.einsum("ki,ki->k", template[over] - template[beneath], outwards)
        steep = up > _STEEPEST * distance[over, first]
        return cls(over[steep], beneath[steep], np.minimum(up[steep], _GAP).astype(np.float32))

    def restore(self, vertices: _Floats, normals: _Floats) -> None:
        """Bring those of `vertices` (3, n, P) up that are beneath what they lie over; see `lift`."""
        lacking = np.empty((len(self.over), vertices.shape[2]), np.float32)
        lift(vertices, normals, self.over, self.beneath, self.gaps, lacking)


def _far_along(
    template: NDArray[Any], pairs: NDArray[Any], rows: NDArray[np.intp], others: NDArray[np.intp]
) -> NDArray[np.bool_]:
    """Whether the way along the cloth from vertices `rows` (R,) to `others` (R, k) is longer than _ALONG, or none."""
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import dijkstra

    lengths = np.maximum(edge_lengths(template, pairs), np.finfo(float).tiny)  # 0 would be no edge
    joined = csr_matrix((lengths, pairs.T), shape=(len(template), len(template)))
    far = np.empty(others.shape, dtype=np.bool_)
    for begin in range(0, len(rows), _SEARCHED_AT_ONCE):
        some = slice(begin, begin + _SEARCHED_AT_ONCE)
        along = dijkstra(joined, directed=False, indices=rows[some], limit=_ALONG)
        far[some] = np.isinf(np.take_along_axis(along, others[some], axis=1))
    return far


NO_OVERLAPS = Overlaps(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0, np.float32))


@compiled
def lift(
    vertices: _Floats,
    normals: _Floats,
    over: NDArray[np.intp],
    beneath: NDArray[np.intp],
    gaps: _Floats,
    lacking: _Floats,
) -> None:
    """Bring those of `vertices` (3, n, P) up that have come beneath what they lie `over`, all at once.

    normals  (3, n, P) unit normals of the skin below each, 0 where there is none
    lacking  (K, P) is filled with how far
    """
    for k in range(len(over)):
        i, j = over[k], beneath[k]
        for p in range(vertices.shape[2]):
            up, squared = np.float32(0), np.float32(0)
            for axis in range(3):
                apart = vertices[axis, i, p] - vertices[axis, j, p]
                up += normals[axis, j, p] * apart
                squared += apart * apart
            beside = squared - up * up > _BESIDE**2
            lacking[k, p] = 0 if beside or not 0 < gaps[k] - up < _DEEPEST else gaps[k] - up
    for k in range(len(over)):
        i, j = over[k], beneath[k]
        for axis in range(3):
            for p in range(vertices.shape[2]):
                vertices[axis, i, p] += normals[axis, j, p] * lacking[k, p]
