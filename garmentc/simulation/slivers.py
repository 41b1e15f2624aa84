"""Mending the few bad triangles that cutting leaves."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array
from garmentc.simulation.surface import Faces, boundary_edges, compact, non_manifold

QUALITY = 0.15
"""Shape of a triangle: 4 sqrt(3) area / sum of squared edges; 1 equilateral, 0 degenerate. Below this: a sliver."""


def shape_quality(vertices: Array, faces: Faces) -> Array:
    """Shape (F,) of each triangle, 0 to 1."""
    corners = vertices[faces]
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1)
    squares = ((corners - np.roll(corners, 1, axis=1)) ** 2).sum((1, 2))
    return np.asarray(4 * np.sqrt(3) * area / np.maximum(squares, 1e-30))


def mend_slivers(vertices: Array, faces: Faces, attempts: int = 60) -> tuple[Array, Faces]:
    """Remove slivers one by one: collapse a short edge, flip a long one, or drop the triangle at a hem.

    A change is kept only if the mesh stays manifold and its worst local shape improves.
    """
    given_up: set[tuple[int, ...]] = set()
    for _ in range(attempts):
        quality = shape_quality(vertices, faces)
        bad = [int(t) for t in np.argsort(quality)[:20] if quality[t] < QUALITY]
        bad = [t for t in bad if tuple(faces[t]) not in given_up]
        if not bad:
            break
        changed = _mended(vertices, faces, bad[0])
        if changed is None:
            given_up.add(tuple(faces[bad[0]]))
        else:
            vertices, faces = changed
    return compact(vertices, faces)


def _mended(vertices: Array, faces: Faces, sliver: int) -> tuple[Array, Faces] | None:
    corners = faces[sliver]
    length = np.linalg.norm(vertices[corners] - vertices[np.roll(corners, -1)], axis=1)
    short, long = int(length.argmin()), int(length.argmax())
    options: list[tuple[Array, Faces] | None] = []
    if len(_neighbours(faces, sliver)) <= 1:
        options.append((vertices, np.delete(faces, sliver, axis=0)))  # an ear on a straight hem
    if length[short] < 0.35 * length[long]:
        options.append(_collapsed(vertices, faces, int(corners[short]), int(corners[(short + 1) % 3])))
    options.append(_flipped(vertices, faces, sliver, int(corners[long]), int(corners[(long + 1) % 3])))
    before = shape_quality(vertices, faces[[sliver]])[0]
    for option in options:
        if option is None:
            continue
        moved, changed = option
        fresh = ~(changed[:, None] == faces[None, sliver]).all(2).any(1)
        touched = np.isin(changed, corners).any(1) & fresh
        worst = shape_quality(moved, changed[touched]).min() if touched.any() else 1.0
        if worst > 1.5 * before and not non_manifold(compact(moved, changed)[1]):
            return moved, changed
    return None


def _neighbours(faces: Faces, triangle: int) -> NDArray[np.intp]:
    """Triangles that share an edge with `triangle`."""
    return np.nonzero(np.isin(faces, faces[triangle]).sum(1) == 2)[0]


def _collapsed(vertices: Array, faces: Faces, a: int, b: int) -> tuple[Array, Faces]:
    rim = np.isin([a, b], boundary_edges(faces))
    point = vertices[a] if rim[0] and not rim[1] else vertices[b] if rim[1] and not rim[0] else vertices[[a, b]].mean(0)
    moved = vertices.copy()
    moved[a] = point
    joined = np.where(faces == b, a, faces)
    keep = (joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])
    return moved, joined[keep].astype(np.int32)


def _flipped(vertices: Array, faces: Faces, sliver: int, a: int, b: int) -> tuple[Array, Faces] | None:
    """The long edge a-b flipped, or the sliver dropped where that edge is a hem."""
    both = np.nonzero((faces == a).any(1) & (faces == b).any(1))[0]
    if len(both) == 1:
        return vertices, np.delete(faces, sliver, axis=0)
    c = int(next(v for v in faces[sliver] if v not in (a, b)))
    d = int(next(v for v in faces[both[both != sliver][0]] if v not in (a, b)))
    changed = faces.copy()
    changed[sliver], changed[both[both != sliver][0]] = (a, d, c), (d, b, c)
    old = np.cross(vertices[b] - vertices[a], vertices[c] - vertices[a])
    for face in ((a, d, c), (d, b, c)):
        if np.cross(vertices[face[1]] - vertices[face[0]], vertices[face[2]] - vertices[face[0]]) @ old <= 0:
            return None
    return vertices, changed
