"""Texture coordinates for outfits that have none, by xatlas: charts cut along creases, packed into the unit square."""

from __future__ import annotations

from dataclasses import replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import weld

UnwrapMode = Literal["auto", "never", "always"]

LARGEST_AUTOMATIC = 200_000
"""Triangles beyond which "auto" leaves an outfit without texture coordinates: it would take minutes."""

_RESOLUTION = 1024
_PADDING = 2
"""Pixels between charts at the resolution, so that mipmaps do not bleed."""


def unwrap(outfit: Outfit, mode: UnwrapMode = "auto") -> Outfit:
    """The outfit with texture coordinates for every corner, one atlas for all materials.

    "auto" makes them only where no corner has any and the outfit is not too large (a warning says so), "always"
    replaces what there is, "never" changes nothing. Vertices, triangles and normals stay as they are.
    """
    if mode == "never" or not len(outfit.tri_v) or (mode == "auto" and bool((outfit.tri_vt >= 0).any())):
        return outfit
    if mode == "auto" and len(outfit.tri_v) > LARGEST_AUTOMATIC:
        message = (
            f"{len(outfit.tri_v)} triangles have no texture coordinates and are too many to unwrap by default; "
            "pass --unwrap always, or give the OBJ coordinates"
        )
        return _with_warning(outfit, Diagnostic("unwrap.too-large", message, str(outfit.path)))

    welded = weld(outfit)
    corner_vertex = welded.vertex_of[outfit.tri_v]
    a, b, c = corner_vertex.T
    proper = (a != b) & (b != c) & (c != a)
    vertex_of_uv, uv_triangles, texcoords = _atlas(welded.vertices, welded.triangles)
    any_uv = np.zeros(len(welded.vertices), dtype=np.int32)
    any_uv[vertex_of_uv[::-1]] = np.arange(len(vertex_of_uv), dtype=np.int32)[::-1]
    tri_vt = any_uv[corner_vertex]  # what triangles without area get
    tri_vt[proper] = uv_triangles
    unwrapped = replace(outfit, texcoords=texcoords, tri_vt=tri_vt)
    textured = [m.name for m in outfit.materials if m.base_color_texture or m.normal_texture]
    if textured:
        message = f"the textures of '{textured[0]}' were painted for other texture coordinates than the new ones"
        unwrapped = _with_warning(unwrapped, Diagnostic("unwrap.textured", message, str(outfit.path)))
    return unwrapped


def _with_warning(outfit: Outfit, warning: Diagnostic) -> Outfit:
    return replace(outfit, warnings=(*outfit.warnings, warning))


def _atlas(
    vertices: NDArray[np.float64], triangles: NDArray[np.int32]
) -> tuple[NDArray[np.int64], NDArray[np.int32], NDArray[np.float64]]:
    """The vertex that each of U texture coordinates belongs to (U,), triangles in them (F, 3), and they (U, 2).

    xatlas leaves out what has no area at its own absolute scale, so the mesh is scaled to edges of length 1;
    triangles without area get coordinates (0, 0).
    """
    import xatlas

    if not len(triangles):
        return np.zeros(1, np.int64), np.zeros((0, 3), np.int32), np.zeros((1, 2))
    edge = np.median(np.linalg.norm(vertices[triangles[:, 1]] - vertices[triangles[:, 0]], axis=1))
    scaled = (vertices - vertices.mean(axis=0)) / (edge if edge > 0 else 1.0)
    atlas = xatlas.Atlas()
    atlas.add_mesh(scaled.astype(np.float32), triangles.astype(np.uint32))
    packing = xatlas.PackOptions()
    packing.resolution, packing.padding = _RESOLUTION, _PADDING
    packing.rotate_charts = False  # it turns by swapping u and v, which mirrors charts
    atlas.generate(xatlas.ChartOptions(), packing)
    vertex_of_uv, uv_triangles, texcoords = atlas[0]
    return (
        vertex_of_uv.astype(np.int64),
        uv_triangles.astype(np.int32),
        np.nan_to_num(texcoords.astype(np.float64), nan=0.0),
    )
