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

_MOST_CORNERS = 20_000
"""Ear clipping takes quadratic time; no real polygon is larger."""

_BATCH = 1 << 18
"""Corners treated at once: bounds the memory."""


def triangulate(
    points: NDArray[np.float64], corners: NDArray[np.int32], counts: NDArray[np.int32]
) -> tuple[NDArray[np.int32], NDArray[np.int32], NDArray[np.int32]]:
    """Triangles of P polygons with C corners in all.

    points   (V, 3); corners (C,) indices into points; counts (P,) corners of each polygon, each at least 3
    returns  (F, 3) int32 indices into `corners`, n - 2 for a polygon with n corners, in polygon order;
             (F,) int32 polygon of each triangle; and the polygons so degenerate, or large, that they were merely fanned
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
        same = np.flatnonzero(counts == count)
        for polygons in np.array_split(same, 1 + len(same) * count // _BATCH):
            ring = points[corners[starts[polygons, None] + np.arange(count)]]
            bad = np.flatnonzero(_not_fan(ring))
            if count == 4:
                flipped = polygons[bad[_other_diagonal(ring[bad])]]
                triangles[first[flipped], 2] = starts[flipped] + 3
                triangles[first[flipped] + 1, 0] = starts[flipped] + 1
                continue
            for i in bad.tolist():
                polygon = int(polygons[i])
                local = _ear_clip(ring[i])
                if local is None:
                    degenerate.append(polygon)
                else:
                    triangles[first[polygon] : first[polygon] + count - 2] = local + starts[polygon]
    return triangles, tri_polygon, np.array(sorted(degenerate), dtype=np.int32)


def area_vectors(ring: NDArray[np.float64], triangles: NDArray[np.int64]) -> NDArray[np.float64]:
    """(Q, k, 3) twice the area vectors of the same k triangles in each of Q polygons (Q, n, 3)."""
    a, b, c = (ring[:, triangles[:, i]] for i in range(3))
    vectors: NDArray[np.float64] = np.cross(b - a, c - a)
    return vectors


def _fan(count: int) -> NDArray[np.int64]:
    i = np.arange(1, count - 1)
    return np.stack([np.zeros_like(i), i, i + 1], axis=1)


def _unit(total: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    size = np.sqrt(np.einsum("qi,qi->q", total, total))
    return total / np.where(size > 0, size, 1)[:, None], size


def _not_fan(ring: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(Q,) whether a fan from the first corner would fold or have slivers: the polygon is not strictly convex.

    The normal is Newell's, the sum of a fan's area vectors: it exists for polygons that are not planar, too.
    """
    count = ring.shape[1]
    fan = area_vectors(ring, _fan(count))
    normal, size = _unit(fan.sum(axis=1))
    smallest = np.einsum("qki,qi->qk", fan, normal).min(axis=1)
    if count > 4:  # a quad's fan may be right though another corner is reflex
        i = np.arange(count)
        turns = area_vectors(ring, np.stack([i - 1, i, i + 1], axis=1) % count)
        smallest = np.minimum(smallest, np.einsum("qki,qi->qk", turns, normal).min(axis=1))
    result: NDArray[np.bool_] = ~(smallest > _FLAT * size)
    return result


def _other_diagonal(ring: NDArray[np.float64]) -> NDArray[np.bool_]:
    """(Q,) of quads (Q, 4, 3): whether the diagonal 1-3 leaves the better worst triangle than 0-2."""
    here = area_vectors(ring, _fan(4))
    there = area_vectors(ring, np.array([[0, 1, 3], [1, 2, 3]]))
    normal, _ = _unit(here.sum(axis=1))
    worst = [np.einsum("qki,qi->qk", vectors, normal).min(axis=1) for vectors in (here, there)]
    result: NDArray[np.bool_] = worst[1] > worst[0]
    return result


def _ear_clip(outline: NDArray[np.float64]) -> NDArray[np.int32] | None:
    """(n - 2, 3) triangles of one polygon (n, 3) by ear clipping; None where it has no area or no triangulation."""
    import mapbox_earcut

    normal, size = _unit(area_vectors(outline[None], _fan(len(outline))).sum(axis=1))
    if not size[0] > 0 or len(outline) > _MOST_CORNERS:
        return None
    least = np.eye(3)[np.argmin(np.abs(normal[0]))]
    x = np.cross(least, normal[0])
    x /= np.linalg.norm(x)
    flat = np.stack([outline @ x, outline @ np.cross(normal[0], x)], axis=1)
    flat = (flat - flat.mean(axis=0)) / np.sqrt(size[0])
    distinct = np.flatnonzero((outline != np.roll(outline, 1, axis=0)).any(axis=1))
    ring = np.array([len(distinct)], np.uint32)
    clipped = distinct[mapbox_earcut.triangulate_float64(flat[distinct], ring).reshape(-1, 3)]
    a, b, c = (flat[clipped[:, i]] for i in range(3))
    area = (b[:, 0] - a[:, 0]) * (c[:, 1] - a[:, 1]) - (b[:, 1] - a[:, 1]) * (c[:, 0] - a[:, 0])
    if area.sum() < 0:
        clipped = clipped[:, ::-1]
    return _with_all_corners(clipped, len(flat))


def _with_all_corners(triangles: NDArray[np.int64], count: int) -> NDArray[np.int32] | None:
    """Put back corners that the clipper dropped for lying on an edge: split the triangle that has this edge."""
    faces = [tuple(row) for row in triangles.tolist()]
    used = sorted({corner for face in faces for corner in face})
    if len(used) < 3:
        return None
    holder = {(face[k - 1], face[k]): (number, k) for number, face in enumerate(faces) for k in range(3)}
    for a, b in zip(used, [*used[1:], used[0]], strict=True):
        dropped = [(a + i) % count for i in range(1, (b - a) % count)]
        if not dropped:
            continue
        if (a, b) not in holder:
            return None
        number, k = holder[a, b]
        apex = faces[number][(k + 1) % 3]
        chain = [a, *dropped, b]
        pieces = [(p, q, apex) for p, q in pairwise(chain)]
        faces[number] = pieces[0]
        for piece in pieces[1:]:
            holder[piece[1], piece[2]] = (len(faces), 2)
            holder[piece[2], piece[0]] = (len(faces), 0)
            faces.append(piece)
        holder[apex, a] = (number, 0)
    return np.array(faces, dtype=np.int32) if len(faces) == count - 2 else None
