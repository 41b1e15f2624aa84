"""Small scenes for tests of the cloth simulation."""

from __future__ import annotations

from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray


def sheet(width: float, depth: float, columns: int, rows: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """A level sheet around the origin, x by z, rows of vertices along x, facing up; diagonals alternate."""
    x, z = np.linspace(-width / 2, width / 2, columns), np.linspace(-depth / 2, depth / 2, rows)
    vertices = np.stack([np.tile(x, rows), np.zeros(columns * rows), np.repeat(z, columns)], axis=1)
    triangles = []
    for row in range(rows - 1):
        for column in range(columns - 1):
            a = row * columns + column
            b, c, d = a + 1, a + columns, a + columns + 1
            triangles += [(a, c, b), (b, c, d)] if (row + column) % 2 else [(a, c, d), (a, d, b)]
    return vertices, np.array(triangles, dtype=np.int32)


def ball(radius: float) -> tuple[NDArray[Any], NDArray[Any]]:
    """A closed sphere around the origin, 642 vertices."""
    mesh = trimesh.creation.icosphere(subdivisions=3, radius=radius)
    return np.array(mesh.vertices), np.array(mesh.faces)


def slab(tilt: float = 0.0) -> tuple[NDArray[Any], NDArray[Any]]:
    """A thick slab, 2 m by 2 m, whose top goes through the origin, tilted down towards +X by `tilt` degrees."""
    mesh = trimesh.creation.box(extents=(2, 0.4, 2))
    mesh.apply_translation([0, -0.2, 0])
    mesh.apply_transform(trimesh.transformations.rotation_matrix(np.radians(-tilt), [0, 0, 1]))
    return np.array(mesh.vertices), np.array(mesh.faces)
