"""From the corner table to vertices a GPU can draw: split where texture coordinates, normals or colours differ.

The map back to welded vertices is kept, so what the network says of a place holds for all vertices there and UV seams
never tear.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import Welded, angle_weighted_normals, averaged_normals, first_equal, unit_rows

_SHORTEST_NORMAL = 1e-6


@dataclass(frozen=True)
class CornerPrimitive:
    """The vertices and triangles of one material, in order of first use (glTF 2.0 section 3.7.2).

    material      index into `Outfit.materials`
    vertices      (S,) int32: welded vertex of each vertex
    obj_vertices  (S,) int32: the OBJ vertex of the first corner that made each vertex
    triangles     (F, 3) uint32 indices into the S vertices
    tri_index     (F,) int32: the outfit's triangle
    texcoords     (S, 2) float32 in glTF convention (v downwards), or None where no corner has one
    normals       (S, 3) float32, unit length, in the pose of the outfit
    colors        (S, 3) float32, linear, or None
    """

    material: int
    vertices: NDArray[np.int32]
    obj_vertices: NDArray[np.int32]
    triangles: NDArray[np.uint32]
    tri_index: NDArray[np.int32]
    texcoords: NDArray[np.float32] | None
    normals: NDArray[np.float32]
    colors: NDArray[np.float32] | None


@dataclass(frozen=True)
class CornerMesh:
    """One primitive for each material that a visible triangle uses, in the order of `Outfit.materials`."""

    primitives: tuple[CornerPrimitive, ...]


@dataclass(frozen=True)
class _CornerNormals:
    """`rows` (R, 3) unit normals; `index` (F, 3) into them."""

    rows: NDArray[np.float64]
    index: NDArray[np.int64]


def split_corners(outfit: Outfit, welded: Welded) -> CornerMesh:
    """Split the corners of an outfit into vertices.

    Two corners share a vertex where welded vertex, texture coordinate, normal and colour are the same (by value).
    Normals are the authored ones; where there are none, or one has no length, they are averaged by corner angle over
    the welded surface within a smoothing group ("s off" is flat; a file without `s` lines is all smooth).
    Triangles that have no area after welding are left out.
    """
    corner_vertex = welded.vertex_of[outfit.tri_v]
    a, b, c = corner_vertex.T
    kept = np.flatnonzero((a != b) & (b != c) & (c != a))
    normals = _corner_normals(outfit, welded, corner_vertex)
    uv_of = np.append(first_equal(outfit.texcoords), -1)  # the last is found by index -1: absent
    color_of = None if outfit.colors is None else first_equal(outfit.colors)

    primitives = []
    for material in range(len(outfit.materials)):
        tri = kept[outfit.tri_material[kept] == material]
        if not len(tri):
            continue
        uv = uv_of[outfit.tri_vt[tri]].ravel()
        keys = [corner_vertex[tri].ravel(), uv, normals.index[tri].ravel()]
        if color_of is not None:
            keys.append(color_of[outfit.tri_v[tri]].ravel())
        first, vertex_of_corner = _by_first_use(keys)
        obj_vertices = outfit.tri_v[tri].ravel()[first]
        primitives.append(
            CornerPrimitive(
                material=material,
                vertices=corner_vertex[tri].ravel()[first],
                obj_vertices=obj_vertices,
                triangles=vertex_of_corner.reshape(-1, 3).astype(np.uint32),
                tri_index=tri.astype(np.int32),
                texcoords=_gltf_texcoords(outfit.texcoords, uv[first]),
                normals=normals.rows[normals.index[tri].ravel()[first]].astype(np.float32),
                colors=None if outfit.colors is None else linear(outfit.colors[obj_vertices]).astype(np.float32),
            )
        )
    return CornerMesh(tuple(primitives))


def linear(srgb: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear values of sRGB values in [0, 1] (IEC 61966-2-1)."""
    result: NDArray[np.float64] = np.where(
        srgb <= 0.04045, srgb / 12.92, ((np.maximum(srgb, 0) + 0.055) / 1.055) ** 2.4
    )
    return result


def _gltf_texcoords(texcoords: NDArray[np.float64], index: NDArray[np.int64]) -> NDArray[np.float32] | None:
    if (index < 0).all():
        return None
    chosen = np.where((index < 0)[:, None], 0.0, texcoords[index])
    return np.stack([chosen[:, 0], 1.0 - chosen[:, 1]], axis=1).astype(np.float32)


def _by_first_use(keys: list[NDArray[Any]]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Distinct combinations of keys (C,), numbered as they first appear: first corner of each, and number (C,)."""
    combined = keys[0].astype(np.int64)
    for key in keys[1:]:
        span = int(key.max()) + 2
        if int(combined.max()) >= np.iinfo(np.int64).max // span:
            combined = np.unique(combined, return_inverse=True)[1].astype(np.int64)
        combined = combined * span + (key + 1)
    _, first, inverse = np.unique(combined, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(first), dtype=np.int64)
    rank[order] = np.arange(len(first))
    return first[order], rank[inverse]


def _corner_normals(outfit: Outfit, welded: Welded, corner_vertex: NDArray[np.int32]) -> _CornerNormals:
    """The normal of every corner: authored, smooth or flat."""
    length = np.linalg.norm(outfit.normals, axis=1)
    valid = np.append(length > _SHORTEST_NORMAL, False)  # the last is found by index -1: absent
    authored = valid[outfit.tri_vn]
    index = np.append(first_equal(outfit.normals), -1)[outfit.tri_vn]
    if authored.all():
        return _CornerNormals(unit_rows(outfit.normals), index)

    points = welded.vertices
    patch, flat = _smoothing(outfit, corner_vertex)
    smooth = averaged_normals(angle_weighted_normals(points, corner_vertex), patch.ravel(), int(patch.max()) + 1)
    flat |= (smooth[patch] == 0).all(axis=2)  # both sides of the cloth share these vertices
    polygons = int(outfit.tri_face.max()) + 1
    facets = averaged_normals(_area_normals(points, corner_vertex), outfit.tri_face, polygons)
    facets[(facets == 0).all(axis=1)] = (0.0, 1.0, 0.0)
    first_smooth = len(outfit.normals)
    first_facet = first_smooth + len(smooth)
    computed = np.where(flat, first_facet + outfit.tri_face[:, None].astype(np.int64), first_smooth + patch)
    return _CornerNormals(
        rows=np.concatenate([unit_rows(outfit.normals), smooth, facets]), index=np.where(authored, index, computed)
    )


def _smoothing(outfit: Outfit, corner_vertex: NDArray[np.int32]) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """(F, 3) number of the smooth surface patch around each corner; (F, 3) whether it is flat instead."""
    if outfit.tri_smooth is None:
        return corner_vertex.astype(np.int64), np.zeros(corner_vertex.shape, dtype=bool)
    _, group = np.unique(outfit.tri_smooth, return_inverse=True)
    key = corner_vertex.astype(np.int64) * (int(group.max()) + 1) + group[:, None]
    _, patch = np.unique(key, return_inverse=True)
    return patch.reshape(key.shape), np.repeat(outfit.tri_smooth == 0, 3).reshape(-1, 3)


def _area_normals(points: NDArray[np.float64], triangles: NDArray[np.int32]) -> NDArray[np.float64]:
    a, b, c = (points[triangles[:, k]] for k in range(3))
    normals: NDArray[np.float64] = np.cross(b - a, c - a)
    return normals
