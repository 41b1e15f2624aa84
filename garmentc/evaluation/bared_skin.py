"""Skin that has come through the cloth: what one sees, where a count of vertices inside the body sees little."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals

REACH = 0.3
"""Metres: cloth further from the skin at rest does not cover it."""

_ON_AN_EDGE = 1e-6
"""Barycentric weight below which a point lies on the side opposite to that corner."""


@dataclass(frozen=True)
class CoveredSkin:
    """The skin beneath an outfit at rest: where the nearest point of the cloth shows its inner side.

    rows       (K,) vertices of the body
    areas      (K,) their shares of its area, relative to each other
    triangles  (F, 3) of the cloth
    rims       (F, 3) whether the side opposite to each corner is the cloth's rim
    """

    rows: NDArray[np.int64]
    areas: NDArray[np.float64]
    triangles: NDArray[np.int64]
    rims: NDArray[np.bool_]

    @classmethod
    def of(cls, cloth: NDArray[Any], triangles: NDArray[Any], skin: NDArray[Any], faces: NDArray[Any]) -> CoveredSkin:
        """From cloth (N, 3), (F, 3) and skin (V, 3), (G, 3) at rest, metres; skin next to a rim is left out."""
        triangles = triangles.astype(np.int64)
        rims = _rims(triangles)
        outside, within, distance = _sides(cloth, triangles, rims, skin)
        rows = np.flatnonzero(within & ~outside & (distance < REACH))
        a, b, c = (skin[faces[:, k]] for k in range(3))
        area = np.repeat(np.linalg.norm(np.cross(b - a, c - a), axis=1), 3)
        areas = np.bincount(faces.reshape(-1), area, len(skin)).astype(np.float64)
        return cls(rows, areas[rows], triangles, rims)

    def bared(self, cloth: NDArray[Any], skin: NDArray[Any]) -> float:
        """Share of the covered skin, by its area at rest, that lies on the outer side of the posed cloth.

        Skin beyond a rim, as that of a knee below a hem that has risen, is not bared.
        """
        if not len(self.rows):
            return 0.0
        outside, within, _ = _sides(cloth, self.triangles, self.rims, skin[self.rows])
        return float(self.areas[outside & within].sum() / self.areas.sum())


def _rims(triangles: NDArray[np.int64]) -> NDArray[np.bool_]:
    """(F, 3): whether no other triangle has the side opposite to the corner."""
    sides = np.sort(np.stack([np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)], axis=2), axis=2)
    _, side, count = np.unique(sides.reshape(-1, 2), axis=0, return_inverse=True, return_counts=True)
    alone: NDArray[np.bool_] = (count[side.reshape(-1)] == 1).reshape(-1, 3)
    return alone


def _sides(
    cloth: NDArray[Any], triangles: NDArray[np.int64], rims: NDArray[np.bool_], points: NDArray[Any]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_], NDArray[np.float64]]:
    """Of points (K, 3): are they on the outer side of the nearest cloth, is that no rim, and how far is it."""
    import igl

    v, p = (np.ascontiguousarray(array, np.float64) for array in (cloth, points))
    squared, face, nearest = igl.point_mesh_squared_distance(p, v, triangles)
    corners = triangles[face]
    weights = _barycentric(nearest, v[corners])
    normals = np.einsum("kc,kcx->kx", weights, vertex_normals(v, triangles.astype(np.int32))[corners])
    outside = np.einsum("kx,kx->k", p - nearest, normals) > 0
    return outside, ~((weights < _ON_AN_EDGE) & rims[face]).any(axis=1), np.sqrt(squared)


def _barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Weights (K, 3) of points (K, 3) on triangles (K, 3, 3); a third each where a triangle has no area."""
    a, b, c = (corners[:, k] for k in range(3))
    normal = np.cross(b - a, c - a)
    square = np.einsum("kx,kx->k", normal, normal)
    flat = square < 1e-24
    opposite = [np.cross(c - b, points - b), np.cross(a - c, points - c), np.cross(b - a, points - a)]
    weights = np.stack([np.einsum("kx,kx->k", part, normal) for part in opposite], axis=1)
    return np.where(flat[:, None], 1 / 3, weights / np.where(flat, 1.0, square)[:, None])
