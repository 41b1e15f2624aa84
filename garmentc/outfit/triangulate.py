"""Polygons to triangles, winding and corner order kept.

A convex polygon becomes a fan from its first corner; a concave quad is cut through its reflex corner; other concave
polygons are ear-clipped in the plane of their Newell normal. Corners that lie on an edge are kept: dropping them would
leave T-junctions that open as cracks when the mesh bends.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

_FLAT = 1e-9
"""A triangle smaller than this part of its polygon has no area worth the name."""


def triangulate(
    points: NDArray[np.float64], corners: NDArray[np.int32], counts: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Triangles of P polygons with C corners in all.

    points   (V, 3); corners (C,) indices into points; counts (P,) corners of each polygon, each at least 3
    returns  (F, 3) int32 indices into `corners`, n - 2 for a polygon with n corners, in polygon order;
             (F,) int32 polygon of each triangle; and the polygons so degenerate that they were merely fanned
    """
    starts = np.cumsum(counts, dtype=np.int64) - counts
    produced = counts - 2
    tri_polygon = np.repeat(np.arange(len(counts), dtype=np.int32), produced)
    first = np.cumsum(produced, dtype=np.int64) - produced
    step = np.arange(len(tri_polygon)) - np.repeat(first, produced)
    start = np.repeat(starts, produced)
    triangles = np.stack([start, start + step + 1, start + step + 2], axis=1).astype(np.int32)  # fans

    degenerate: list[int] = []
    for count in np.unique(counts[counts > 3]).tolist():
        polygons = np.flatnonzero(counts == count)
        ring = points[corners[starts[polygons, None] + np.arange(count)]]
        not_fan = _not_fan(ring)
        if count == 4:
            flipped = polygons[not_fan][_other_diagonal(ring[not_fan])]
            triangles[first[flipped], 2] = starts[flipped] + 3
            triangles[first[flipped] + 1, 0] = starts[flipped] + 1
            continue
        for polygon, outline in zip(polygons[not_fan].tolist(), ring[not_fan], strict=True):
            local = _ear_clip(outline)
            if local is None:
                degenerate.append(polygon)
            else:
                triangles[first[polygon] : first[polygon] + count - 2] = local + starts[polygon]
    return triangles, tri_polygon, np.array(sorted(degenerate), dtype=np.int32)


def newell(ring: NDArray[np.float64]) -> NDArray[np.float64]:
    """(Q, 3) twice the area vector of Q polygons (Q, n, 3), planar or not (Newell's method)."""
    centred = ring - ring.mean(axis=1, keepdims=True)
    total: NDArray[np.float64] = np.cross(centred, np.roll(centred, -1, axis=1)).sum(axis=1)
    return total


def _areas(ring: NDArray[np.float64], triangles: NDArray[np.int64], normal: NDArray[np.float64]) -> NDArray[np.float64]:
    """(Q, k) twice the signed area, seen along the unit normals, of the same k triangles in each of Q rings."""
    a, b, c = (ring[:, triangles[:, i]] for i in range(3))
    areas: NDArray[np.float64] = np.einsum("qki,qi->qk", np.cross(b - a, c - a), normal)
    return areas


def _unit_newell(ring: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    total = newell(ring)
    size = np.linalg.norm(total, axis=1)
    return total / np.where(size > 0, size, 1)[:, None], size


def _not_fan(ring: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(Q,) whether a fan from the first corner would fold or have slivers: the polygon is not strictly convex."""
    count = ring.shape[1]
    normal, size = _unit_newell(ring)
    i = np.arange(count)
    turns = np.stack([i - 1, i, (i + 1) % count], axis=1) % count
    fan = np.stack([np.zeros(count - 2, np.int64), i[1:-1], i[2:]], axis=1)
    smallest = _areas(ring, fan, normal).min(axis=1)
    if count > 4:  # a quad's fan may be right though another corner is reflex
        smallest = np.minimum(smallest, _areas(ring, turns, normal).min(axis=1))
    result: NDArray[np.bool_] = ~(smallest > _FLAT * size)
    return result


def _other_diagonal(ring: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(Q,) of quads (Q, 4, 3): whether the diagonal 1-3 leaves the better worst triangle than 0-2."""
    normal, _ = _unit_newell(ring)
    here = _areas(ring, np.array([[0, 1, 2], [0, 2, 3]]), normal).min(axis=1)
    there = _areas(ring, np.array([[0, 1, 3], [1, 2, 3]]), normal).min(axis=1)
    result: NDArray[np.bool_] = there > here
    return result


def _ear_clip(outline: NDArray[np.float64]) -> NDArray[np.int32] | None:
    """(n - 2, 3) triangles of one polygon (n, 3) by ear clipping; None where it has no area or no triangulation."""
    import mapbox_earcut

    normal, size = _unit_newell(outline[None])
    if not size[0] > 0:
        return None
    least = np.eye(3)[np.argmin(np.abs(normal[0]))]
    x = np.cross(least, normal[0])
    x /= np.linalg.norm(x)
    flat = np.stack([outline @ x, outline @ np.cross(normal[0], x)], axis=1)
    flat = (flat - flat.mean(axis=0)) / np.sqrt(size[0])
    clipped = mapbox_earcut.triangulate_float64(flat, np.array([len(flat)], np.uint32)).reshape(-1, 3).astype(np.int64)
    a, b, c = (flat[clipped[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    clipped[area < 0] = clipped[area < 0][:, ::-1]
    return _with_all_corners(clipped, len(flat))


def _with_all_corners(triangles: NDArray[np.int64], count: int) -> NDArray[np.int32] | None:
    """Put back corners that the clipper dropped for lying on an edge: split the triangle that has this edge."""
    faces = [tuple(row) for row in triangles.tolist()]
    used = sorted({corner for face in faces for corner in face})
    if len(used) < 3:
        return None
    for a, b in zip(used, [*used[1:], used[0]], strict=True):
        dropped = [(a + i) % count for i in range(1, (b - a) % count)]
        if not dropped:
            continue
        edge = [(f, k) for f, face in enumerate(faces) for k in range(3) if (face[k], face[(k + 1) % 3]) == (a, b)]
        if not edge:
            return None
        f, k = edge[0]
        apex = faces[f][(k + 2) % 3]
        chain = [a, *dropped, b]
        faces[f] = (chain[0], chain[1], apex)
        faces += [(p, q, apex) for p, q in pairwise(chain[1:])]
    return np.array(faces, dtype=np.int32) if len(faces) == count - 2 else None
