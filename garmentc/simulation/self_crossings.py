"""Edges of a mesh that pierce triangles of it, found exactly enough to be counted."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edges as edges_of

_Floats = NDArray[np.float64]
_Boxes = tuple[_Floats, _Floats]
_LARGE = 8.0
"""Boxes longer than this many cells are not sorted into them."""


def self_crossings(vertices: NDArray[Any], triangles: NDArray[Any]) -> NDArray[np.int32]:
    """Edges (K, 2) that pierce a triangle of `vertices` (N, 3), `triangles` (F, 3) with which they share no vertex.

    An edge pierces a triangle where its ends lie strictly on the two sides of the triangle's plane and its line passes
    between all three sides: five signs of tetrahedra's volumes (Guigue and Devillers 2003), in float64. What only
    touches, or lies in the plane, does not count.
    """
    points = np.asarray(vertices, np.float64)
    tri = np.asarray(triangles, np.intp)
    edge = edges_of(np.asarray(triangles, np.int32))
    which, face = _near_pairs(points[edge], points[tri])
    for end in edge.T:
        for corner in tri.T:
            apart = end[which] != corner[face]
            which, face = which[apart], face[apart]
    pierced = _pierces(points[edge[which]], points[tri[face]])
    crossing: NDArray[np.int32] = edge[np.unique(which[pierced])]
    return crossing


def _pierces(segment: _Floats, triangle: _Floats) -> NDArray[np.bool_]:
    """Whether segments (P, 2, 3) pierce triangles (P, 3, 3)."""
    start, end = segment[:, 0], segment[:, 1]
    a, b, c = triangle[:, 0], triangle[:, 1], triangle[:, 2]
    apart = _volume(a, b, c, start) * _volume(a, b, c, end) < 0
    sides = [_volume(start, end, *pair) for pair in ((a, b), (b, c), (c, a))]
    within = (np.minimum.reduce(sides) > 0) | (np.maximum.reduce(sides) < 0)
    pierced: NDArray[np.bool_] = apart & within
    return pierced


def _volume(a: _Floats, b: _Floats, c: _Floats, d: _Floats) -> _Floats:
    """Six times the signed volumes (P,) of tetrahedra."""
    volume: _Floats = np.einsum("pi,pi->p", np.cross(b - a, c - a), d - a)
    return volume


def _near_pairs(segments: _Floats, triangles: _Floats) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Pairs (segment, triangle) whose bounding boxes overlap, each once.

    Boxes are sorted into a grid of cells as large as most boxes. Boxes over many cells, as in torn meshes, are compared
    with all others instead.
    """
    boxes = [(group.min(axis=1), group.max(axis=1)) for group in (segments, triangles)]
    size = max(float(np.percentile(high - low, 90)) for low, high in boxes)
    large = [((high - low) > _LARGE * size).any(axis=1) for low, high in boxes]
    origin = np.minimum(boxes[0][0].min(axis=0), boxes[1][0].min(axis=0))
    segment_cell, segment = _cells(*boxes[0], ~large[0], origin, size)
    triangle_cell, triangle = _cells(*boxes[1], ~large[1], origin, size)
    order = np.argsort(triangle_cell, kind="stable")
    triangle_cell, triangle = triangle_cell[order], triangle[order]
    first = np.searchsorted(triangle_cell, segment_cell, side="left")
    count = np.searchsorted(triangle_cell, segment_cell, side="right") - first
    which = np.repeat(segment, count)
    within = np.arange(len(which)) - np.repeat(np.cumsum(count) - count, count)
    face = triangle[np.repeat(first, count) + within]
    pairs = [(which, face)]
    pairs += [(np.full(len(triangles), index), np.arange(len(triangles))) for index in np.flatnonzero(large[0])]
    pairs += [(np.arange(len(segments)), np.full(len(segments), index)) for index in np.flatnonzero(large[1])]
    found = [_overlapping(*pair, *boxes) for pair in pairs]
    keys = np.sort(np.concatenate([which * len(triangles) + face for which, face in found]))
    keys = keys[np.diff(keys, prepend=-1) > 0]
    return keys // len(triangles), keys % len(triangles)


def _overlapping(
    which: NDArray[np.intp], face: NDArray[np.intp], segments: _Boxes, triangles: _Boxes
) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """Those of the pairs whose boxes overlap."""
    for axis in range(3):  # one after the other: each leaves fewer pairs to the next
        overlap = segments[0][which, axis] <= triangles[1][face, axis]
        overlap &= triangles[0][face, axis] <= segments[1][which, axis]
        which, face = which[overlap], face[overlap]
    return which, face


def _cells(
    low: _Floats, high: _Floats, chosen: NDArray[np.bool_], origin: _Floats, size: float
) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
    """Grid cells that the chosen boxes touch: keys (K,) of cells and the box in each."""
    first = np.floor((low - origin) / size).astype(np.int64)
    spans = np.floor((high - origin) / size).astype(np.int64) - first + 1
    count = spans.prod(axis=1) * chosen
    box = np.repeat(np.arange(len(low)), count)
    index = np.arange(len(box)) - np.repeat(np.cumsum(count) - count, count)
    span = spans[box]
    offset = np.stack(
        [index % span[:, 0], index // span[:, 0] % span[:, 1], index // (span[:, 0] * span[:, 1])], axis=1
    )
    cell = first[box] + offset
    return (cell[:, 0] << 42) + (cell[:, 1] << 21) + cell[:, 2], box
