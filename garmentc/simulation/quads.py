"""Pairs of triangles as quads, for files that people open in modelling tools."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array
from garmentc.simulation.surface import Faces, face_normals

_SKEWEST = 0.64
"""Cosine of a quad's corner: 0 is square; corners sharper than 50 or blunter than 130 degrees make no quad."""


def pair_triangles(vertices: Array, triangles: Faces, group: NDArray[np.int32]) -> NDArray[np.int32]:
    """The triangle (F,) that each triangle makes a quad with, -1 where it stays alone.

    Greedy, squarest quads first; only triangles of the same `group` (F,) that are nearly coplanar pair up.
    """
    count = len(triangles)
    sides = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    apex = np.concatenate([triangles[:, 2], triangles[:, 0], triangles[:, 1]])
    owner = np.tile(np.arange(count), 3)
    order = np.lexsort(np.sort(sides, axis=1).T)
    key = np.sort(sides, axis=1)[order]
    twin = np.nonzero((key[1:] == key[:-1]).all(1))[0]
    one, two = order[twin], order[twin + 1]
    # Around the quad: first apex, start of the shared side, second apex, end of the shared side.
    corners = vertices[np.stack([apex[one], sides[one, 0], apex[two], sides[one, 1]], 1)]
    edge = np.roll(corners, -1, axis=1) - corners
    edge /= np.maximum(np.linalg.norm(edge, axis=2, keepdims=True), 1e-12)
    skew = np.abs((edge * np.roll(edge, 1, axis=1)).sum(2)).max(1)
    normal = face_normals(vertices, triangles)
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-30)
    flat = (normal[owner[one]] * normal[owner[two]]).sum(1) > 0.8
    good = flat & (skew < _SKEWEST) & (group[owner[one]] == group[owner[two]])
    partner = np.full(count, -1, dtype=np.int32)
    for k in np.argsort(skew, kind="stable"):
        a, b = owner[one[k]], owner[two[k]]
        if good[k] and partner[a] < 0 and partner[b] < 0:
            partner[a], partner[b] = b, a
    return partner


def polygon_corners(triangles: Faces, partner: NDArray[np.int32]) -> list[list[tuple[int, int]]]:
    """Polygons as lists of (triangle, corner), in the order of the first triangle of each."""
    polygons = []
    for t, other in enumerate(partner.tolist()):
        if other < 0:
            polygons.append([(t, k) for k in range(3)])
        elif t < other:
            mine, its = triangles[t].tolist(), triangles[other].tolist()
            lone = next(k for k in range(3) if mine[k] not in its)
            far = next(k for k in range(3) if its[k] not in mine)
            # Starting on the shared side, so that a fan gives the same two triangles again.
            polygons.append([(t, (lone + 1) % 3), (other, far), (t, (lone + 2) % 3), (t, lone)])
    return polygons
