"""Cloth that lies over other cloth: it should stay there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.compiled import compiled
from garmentc.outfit.topology import triangle_normals
from garmentc.passes.pieces import Pieces
from garmentc.smpl.nearest import closest_on_surface

_Floats = NDArray[np.float32]

_REACH = 0.03
"""Metres: cloth farther off at rest is another story."""

_STEEPEST = 0.5
"""Cosine between the way up from cloth and its skin's normal: what is more to the side does not lie over it."""

_GAP = 0.003
"""Metres that cloth keeps from what is beneath it; where there is less at rest, less."""

_DEEPEST = 0.03
"""Metres beneath that cloth still comes up from."""


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
    def of(cls, template: NDArray[Any], pieces: Pieces, skin: NDArray[Any], faces: NDArray[Any]) -> Overlaps:
        """Of `template` (n, 3), whose large pieces lie over each other on the `skin` (V, 3), (F, 3)."""
        from scipy.spatial import cKDTree

        large = np.flatnonzero(pieces.large(template))
        if len(large) < 2:
            return NO_OVERLAPS
        over, beneath = [], []
        for piece in large:
            own, others = pieces.labels == piece, np.isin(pieces.labels, large[large != piece])
            distance, nearest = cKDTree(template[others]).query(template[own], distance_upper_bound=_REACH)
            found = np.isfinite(distance)
            over.append(np.flatnonzero(own)[found])
            beneath.append(np.flatnonzero(others)[nearest[found]])
        above, below = np.concatenate(over), np.concatenate(beneath)
        outwards = triangle_normals(skin, faces)[closest_on_surface(template[below], skin, faces).face]
        way = template[above] - template[below]
        height = np.einsum("ki,ki->k", way, outwards)
        lies = height > _STEEPEST * np.linalg.norm(way, axis=1)
        return cls(above[lies], below[lies], np.minimum(height[lies], _GAP).astype(np.float32))


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
            height = gaps[k]
            for axis in range(3):
                height -= normals[axis, j, p] * (vertices[axis, i, p] - vertices[axis, j, p])
            lacking[k, p] = height if 0 < height < _DEEPEST else 0
    for k in range(len(over)):
        i, j = over[k], beneath[k]
        for axis in range(3):
            for p in range(vertices.shape[2]):
                vertices[axis, i, p] += normals[axis, j, p] * lacking[k, p]
