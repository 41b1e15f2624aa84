"""Cloth that lies over other cloth: it should stay there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import triangle_normals
from garmentc.passes.pieces import Pieces
from garmentc.smpl.nearest import closest_on_surface

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
    gaps: NDArray[np.float32]

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

    def in_poses(self, count: int) -> Overlaps:
        """The same of vertices in `count` poses, (n, P) in one row."""
        over, beneath = ((rows[:, None] * count + np.arange(count)).ravel() for rows in (self.over, self.beneath))
        return Overlaps(over, beneath, np.repeat(self.gaps, count))

    def lift(
        self, vertices: NDArray[np.float32], normals: NDArray[np.float32]
    ) -> tuple[NDArray[np.intp], NDArray[np.float32]]:
        """Which of `vertices` (3, n) have to come up, (L,), and how far: metres (3, L).

        normals  (3, K) unit normals of the skin below each, 0 where there is none
        """
        apart = np.take(vertices, self.over, axis=1) - np.take(vertices, self.beneath, axis=1)
        lacking = self.gaps - np.einsum("ik,ik->k", normals, apart)
        rows = np.flatnonzero((lacking > 0) & (lacking < _DEEPEST))
        return self.over[rows], np.take(normals, rows, axis=1) * lacking[rows]


NO_OVERLAPS = Overlaps(np.zeros(0, np.intp), np.zeros(0, np.intp), np.zeros(0, np.float32))
