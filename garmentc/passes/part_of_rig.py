"""Rigs of some vertices: what is measured or fitted where an outfit has too many."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import Rig


def spread_vertices(count: int, most: int) -> NDArray[np.intp]:
    """At most `most` of the vertices 0..count-1, evenly spread."""
    if count <= most:
        return np.arange(count)
    return np.linspace(0, count - 1, most).astype(np.intp)


def take_vertices(rig: Rig, rows: NDArray[np.intp]) -> Rig:
    """The rig of some of its vertices, without triangles and normals: for posing only."""
    return replace(
        rig,
        template=rig.template[rows],
        triangles=np.zeros((0, 3), dtype=np.int32),
        weights=rig.weights[rows],
        blend_shapes=np.take(rig.blend_shapes, rows, axis=1),
        blend_normals=None,
    )


def side_by_side(first: Rig, second: Rig) -> Rig:
    """Two rigs with the same joints and keys as one, for posing only."""
    return replace(
        first,
        template=np.concatenate([first.template, second.template]),
        triangles=np.zeros((0, 3), dtype=np.int32),
        weights=np.concatenate([first.weights, second.weights]),
        blend_shapes=np.concatenate([first.blend_shapes, second.blend_shapes], axis=1),
        blend_normals=None,
    )
