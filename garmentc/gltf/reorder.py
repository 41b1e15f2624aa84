"""Triangles and vertices in an order that compresses well, and that a GPU draws fast."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.gltf.meshopt import codec
from garmentc.outfit.corners import CornerPrimitive


def reordered(primitive: CornerPrimitive) -> CornerPrimitive:
    """The same primitive: triangles beside triangles that share their vertices, vertices in order of first use.

    Vertices that no triangle uses are left out.
    """
    flat = primitive.triangles.reshape(-1).astype(np.uint32)
    indices, place, used = codec().reorder_mesh(flat, triangles=True, optsize=True)
    order = np.argsort(place, kind="stable")[:used]
    triangles = indices.reshape(-1, 3).astype(np.uint32)
    came_from = _matched(order[triangles], primitive.triangles)

    def taken(values: NDArray[Any] | None) -> NDArray[Any] | None:
        return None if values is None else values[order]

    return replace(
        primitive,
        vertices=primitive.vertices[order],
        obj_vertices=primitive.obj_vertices[order],
        triangles=triangles,
        tri_index=primitive.tri_index[came_from],
        texcoords=taken(primitive.texcoords),
        normals=primitive.normals[order],
        colors=taken(primitive.colors),
    )


def _matched(triangles: NDArray[Any], among: NDArray[Any]) -> NDArray[np.intp]:
    """For each triangle (F, 3) its place in `among`, which holds the same ones in another order."""
    sorted_here, sorted_there = (np.lexsort(np.sort(rows, axis=1).T) for rows in (triangles, among))
    places = np.empty(len(triangles), dtype=np.intp)
    places[sorted_here] = sorted_there
    return places
