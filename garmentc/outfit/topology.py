"""The welded mesh: what the networks see. Vertices at one place are one vertex, so no seam can tear."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic, GarmentcError
from garmentc.outfit.outfit import Outfit

WELD_TOLERANCE = 1e-6
"""Vertices closer than this part of the bounding box's diagonal are one: far below any cloth's thickness,
above the rounding of six decimals that exporters print."""

_NEIGHBOURS = 16
_CANCELLED = 1e-9


@dataclass(frozen=True)
class Welded:
    """An outfit's vertices merged by position, the unreferenced ones dropped.

    vertex_of  (V,) int32: welded vertex of each OBJ vertex, -1 where no face uses it
    vertices   (N, 3) float64: the position of the first OBJ vertex at each place
    triangles  (F', 3) int32: triangles that have three different welded vertices; F' <= F
    """

    vertex_of: NDArray[np.int32]
    vertices: NDArray[np.float64]
    triangles: NDArray[np.int32]


def weld(outfit: Outfit, tolerance: float = WELD_TOLERANCE) -> Welded:
    """Merge vertices at equal positions.

    Equal means exactly equal, or linked by vertices closer than `tolerance` times the diagonal of the bounding box
    (and than a hundredth of the median edge, so that one stray far-away triangle does not melt a garment).
    Welded vertices keep the order in which the OBJ first gives them.
    """
    used = np.zeros(len(outfit.vertices), dtype=bool)
    used[outfit.tri_v] = True
    index = np.flatnonzero(used)
    points = outfit.vertices[index]
    exact = first_equal(points)
    representatives = np.flatnonzero(exact == np.arange(len(points)))
    near = _first_near(points[representatives], _radius(outfit, points, tolerance))
    place = np.zeros(len(points), dtype=np.int64)
    place[representatives] = representatives[near]
    place = place[exact]

    kept = np.flatnonzero(place == np.arange(len(points)))
    number = np.zeros(len(points), dtype=np.int32)
    number[kept] = np.arange(len(kept), dtype=np.int32)
    vertex_of = np.full(len(outfit.vertices), -1, dtype=np.int32)
    vertex_of[index] = number[place]
    triangles = vertex_of[outfit.tri_v]
    return Welded(vertex_of, points[kept], triangles[_proper(triangles)])


def surface_warnings(outfit: Outfit, welded: Welded) -> tuple[Diagnostic, ...]:
    """Warnings of triangles that lost their area by welding, and so are left out, and of triangles that repeat others.

    Raises GarmentcError where no triangle is left at all.
    """
    if not len(welded.triangles):
        raise GarmentcError(
            "no triangle has three corners at different places, as places closer than a millionth of the outfit's size "
            "are one; remove what lies far away, or export more decimals",
            outfit.path,
        )
    corner_vertex = welded.vertex_of[outfit.tri_v]
    proper = _proper(corner_vertex)
    repeated = np.zeros(len(proper), dtype=bool)
    repeated[proper] = _repeated(welded.triangles)
    found = (
        ("weld.collapsed", _proper(outfit.tri_v) & ~proper, "have two corners at one place; they are left out"),
        ("weld.duplicate", repeated, "lie exactly on others and are drawn twice; remove doubles and export again"),
    )
    return tuple(
        Diagnostic(code, f"{chosen.sum()} triangle(s) {what}", str(outfit.path), _first_line(outfit, chosen))
        for code, chosen, what in found
        if chosen.any()
    )


def _first_line(outfit: Outfit, chosen: NDArray[np.bool_]) -> int:
    return int(outfit.face_line[outfit.tri_face[np.argmax(chosen)]])


def _repeated(triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
    """(F,) whether a triangle has the corners of an earlier one, in the same turn: the back of cloth is no repeat."""
    start = triangles.argmin(axis=1)[:, None]
    turned = np.take_along_axis(triangles, (start + np.arange(3)) % 3, axis=1)
    repeated: NDArray[np.bool_] = first_equal(turned.astype(np.float64)) != np.arange(len(triangles))
    return repeated


def edges(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """(E, 2) unique undirected edges of triangles (F, 3), the smaller index first, in rising order."""
    here = triangles.astype(np.int64).ravel()
    there = np.roll(triangles, -1, axis=1).astype(np.int64).ravel()
    keys = np.minimum(here, there) << 32 | np.maximum(here, there)
    keys.sort()
    keys = keys[np.concatenate([[True], keys[1:] != keys[:-1]])] if len(keys) else keys
    return np.stack([keys >> 32, keys & 0xFFFFFFFF], axis=1).astype(np.int32)


def edge_lengths(vertices: NDArray[Any], edges: NDArray[Any]) -> NDArray[np.float64]:
    """Lengths (E,) of `edges` (E, 2) between `vertices` (N, 3), in their unit."""
    starts, ends = (np.asarray(vertices, np.float64)[rows] for rows in edges.T)
    lengths: NDArray[np.float64] = np.linalg.norm(starts - ends, axis=-1)
    return lengths


def corner_angles(points: NDArray[np.float64], triangles: NDArray[Any]) -> NDArray[np.float64]:
    """(F, 3) angle at each corner, radians; 0 where a triangle has no area."""
    corners = [points[triangles[:, k]] for k in range(3)]
    sides = [corners[(k + 1) % 3] - corners[k] for k in range(3)]
    height = np.sqrt(_squares(np.cross(sides[0], sides[1])))  # twice the area, whichever corner it is seen from
    widths = [-np.einsum("fi,fi->f", sides[k], sides[k - 1]) for k in range(3)]
    angles = np.stack([np.arctan2(height, width) for width in widths], axis=1)
    angles[height == 0] = 0.0
    return angles


def _squares(rows: NDArray[Any]) -> NDArray[np.float64]:
    total: NDArray[np.float64] = np.einsum("fi,fi->f", rows, rows)
    return total


def triangle_normals(points: NDArray[np.float64], triangles: NDArray[Any]) -> NDArray[np.float64]:
    """(F, 3) unit normals; zero where a triangle has no area."""
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return unit_rows(np.cross(b - a, c - a))


def unit_rows(rows: NDArray[Any]) -> NDArray[np.float64]:
    """Rows scaled to length 1; rows of length 0 stay 0."""
    length = np.linalg.norm(rows, axis=-1, keepdims=True)
    unit: NDArray[np.float64] = rows / np.where(length > 0, length, 1.0)
    return unit


def vertex_normals(vertices: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    """(N, 3) unit normals, triangle normals averaged by corner angle (Thuermer and Wuethrich 1998).

    A vertex with no area around it, or as much facing one way as the other, gets (0, 1, 0).
    """
    normals = averaged_normals(angle_weighted_normals(vertices, triangles), triangles.ravel(), len(vertices))
    normals[(normals == 0).all(axis=1)] = (0.0, 1.0, 0.0)
    return normals


def angle_weighted_normals(points: NDArray[np.float64], triangles: NDArray[Any]) -> NDArray[np.float64]:
    """(3 F, 3) each corner's triangle normal times the corner's angle."""
    weighted: NDArray[np.float64] = (
        triangle_normals(points, triangles)[:, None] * corner_angles(points, triangles)[:, :, None]
    )
    return weighted.reshape(-1, 3)


def averaged_normals(weighted: NDArray[np.float64], owner: NDArray[Any], count: int) -> NDArray[np.float64]:
    """(count, 3) unit sums of rows (C, 3) by their owner (C,); zero where the rows cancel or there are none."""
    sums = np.stack([np.bincount(owner, weighted[:, axis], minlength=count) for axis in range(3)], axis=1)
    total = np.bincount(owner, np.sqrt(_squares(weighted)), minlength=count)
    sums[np.sqrt(_squares(sums)) <= _CANCELLED * total] = 0.0
    return unit_rows(sums)


def components(triangles: NDArray[np.int32], count: int) -> NDArray[np.int32]:
    """(count,) int32: which connected piece each vertex belongs to, numbered by their first vertex."""
    return connected(np.concatenate([triangles[:, :2], triangles[:, ::2]]), count)


def connected(pairs: NDArray[Any], count: int) -> NDArray[np.int32]:
    """(count,) int32: the same of vertices that `pairs` (K, 2) join."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components

    graph = coo_matrix((np.ones(len(pairs), bool), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    _, label = connected_components(graph, directed=False)
    return _by_first_use(label)


def _by_first_use(label: NDArray[Any]) -> NDArray[np.int32]:
    """Labels renumbered 0, 1, ... in the order in which they first appear."""
    _, first, inverse = np.unique(label, return_index=True, return_inverse=True)
    rank = np.empty(len(first), dtype=np.int32)
    rank[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
    return rank[inverse]


def _radius(outfit: Outfit, points: NDArray[np.float64], tolerance: float) -> float:
    if not len(outfit.tri_v):
        return 0.0
    a, b = (outfit.vertices[outfit.tri_v[:, k]] for k in (0, 1))
    diagonal = np.linalg.norm(np.ptp(points, axis=0))
    return float(min(tolerance * diagonal, 0.01 * np.sqrt(np.median(_squares(b - a)))))


def _proper(triangles: NDArray[np.int32]) -> NDArray[np.bool_]:
    a, b, c = triangles.T
    proper: NDArray[np.bool_] = (a != b) & (b != c) & (c != a)
    return proper


def first_equal(rows: NDArray[np.float64]) -> NDArray[np.int64]:
    """(N,) index of the first of the rows (N, k) that is exactly equal to each."""
    if not len(rows):
        return np.zeros(0, dtype=np.int64)
    rows = rows + 0.0  # -0.0 becomes 0.0
    order = np.lexsort(rows.T)
    ordered = rows[order]
    new = np.concatenate([[True], (ordered[1:] != ordered[:-1]).any(axis=1)])
    firsts = np.minimum.reduceat(order, np.flatnonzero(new))
    result = np.empty(len(rows), dtype=np.int64)
    result[order] = firsts[np.cumsum(new) - 1]
    return result


def _first_near(points: NDArray[np.float64], radius: float) -> NDArray[np.int64]:
    """(N,) index of the first point linked to each by steps of at most `radius`, no two points being equal."""
    index = np.arange(len(points))
    if len(points) < 2 or radius <= 0:
        return index
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    nearest, _ = cKDTree(points).query(points, k=[2], distance_upper_bound=radius)
    crowded = np.flatnonzero(np.isfinite(nearest[:, 0]))
    if not len(crowded):
        return index
    # A bounded number of neighbours, as all pairs of a dense cluster would not fit into memory.
    _, near = cKDTree(points[crowded]).query(points[crowded], k=_NEIGHBOURS, distance_upper_bound=radius)
    row, column = np.nonzero(near < len(crowded))
    graph = coo_matrix((np.ones(len(row), bool), (row, near[row, column])), shape=(len(crowded), len(crowded)))
    _, label = connected_components(graph, directed=False)
    firsts = np.full(int(label.max()) + 1, len(points))
    np.minimum.at(firsts, label, crowded)
    index[crowded] = firsts[label]
    return index
