"""What holds a garment up where friction does not: rims that are worn tight are pinned to the body's skin.

A waistband is narrower than the hips below it and its elastic presses it to the skin. Cloth that starts unstretched on
the body has no such tension, so the vertices of the rim keep their place on the skin instead, at the distance that they
had at rest.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import unit_rows
from garmentc.simulation.brims import rim_loops
from garmentc.simulation.outfits import GeneratedOutfit

_TIGHT_KINDS = ("feet", "mittens", "band", "hat")
_WAISTED_KINDS = ("skirt", "trousers")


@dataclass(frozen=True)
class Pins:
    """Cloth vertices that follow the skin.

    vertices  (P,) int: which cloth vertices
    anchors   (P, 3) int: body vertices of the triangle below each
    shares    (P, 3): barycentric coordinates of the nearest point there
    offset    (P, 3) metres from there to the cloth, in the triangle's own axes
    """

    vertices: NDArray[np.intp]
    anchors: NDArray[np.intp]
    shares: NDArray[np.float64]
    offset: NDArray[np.float64]

    def positions(self, body: NDArray[Any]) -> NDArray[np.float64]:
        """Where the pinned vertices are (P, 3) on the body's vertices (V, 3)."""
        if not len(self.vertices):
            return np.zeros((0, 3))
        corners = np.asarray(body, np.float64)[self.anchors]
        placed: NDArray[np.float64] = np.einsum("pk,pki->pi", self.shares, corners)
        placed += np.einsum("pij,pi->pj", _axes(corners), self.offset)
        return placed


NO_PINS = Pins(np.zeros(0, np.intp), np.zeros((0, 3), np.intp), np.zeros((0, 3)), np.zeros((0, 3)))


def pin(
    vertices: NDArray[Any], pinned: NDArray[Any], body: NDArray[Any], faces: NDArray[Any], clearance: float = 0.0
) -> Pins:
    """Pin the cloth vertices `pinned` (P,) of `vertices` (N, 3) to the body at rest, (V, 3) and (F, 3).

    They keep their place above the skin, but are at least `clearance` metres outside.
    """
    import igl

    if not len(pinned):
        return NO_PINS
    body = np.ascontiguousarray(body, np.float64)
    points = np.ascontiguousarray(np.asarray(vertices, np.float64)[pinned])
    _, face, nearest = igl.point_mesh_squared_distance(points, body, np.ascontiguousarray(faces, np.int64))
    anchors = np.asarray(faces, np.intp)[face]
    corners = body[anchors]
    shares = igl.barycentric_coordinates(nearest, *(np.ascontiguousarray(corners[:, k]) for k in range(3)))
    offset = np.einsum("pij,pj->pi", _axes(corners), points - nearest)
    offset[:, 0] = np.maximum(offset[:, 0], clearance)
    return Pins(np.asarray(pinned, np.intp), anchors, shares, offset)


def _axes(corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """Right-angled axes (P, 3, 3) of triangles (P, 3, 3), one a row: the normal, the first edge, and what is left."""
    first = unit_rows(corners[:, 1] - corners[:, 0])
    normal = unit_rows(np.cross(first, corners[:, 2] - corners[:, 0]))
    return np.stack([normal, first, np.cross(normal, first)], axis=1)


def worn_tight(outfit: GeneratedOutfit) -> NDArray[np.intp]:
    """Vertices of an outfit's rims that are worn tight, in rising order.

    Those are the waistbands of skirts and trousers, the upper rim of strapless garments, and every rim of shoes,
    mittens, bands and hats.
    """
    pinned: list[int] = []
    for index, garment in enumerate(outfit.parameters.garments):
        triangles = outfit.triangles[outfit.triangle_part == index]
        loops = rim_loops(triangles)
        if not loops:
            continue
        if garment.kind in _TIGHT_KINDS:
            pinned += [vertex for loop in loops for vertex in loop]
        elif garment.kind in _WAISTED_KINDS or garment.neckline == "strapless":
            pinned += max(loops, key=lambda loop: float(outfit.vertices[np.array(loop), 1].mean()))
    return np.unique(np.array(pinned, dtype=np.intp))
