"""The brim of a hat: rows of triangles added outside its rim."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from garmentc.simulation.body_field import Array
from garmentc.simulation.surface import Faces


def rim_loops(faces: Faces) -> list[list[int]]:
    """Closed loops of boundary vertices, in the direction in which the faces run along them."""
    directed = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    known = {(int(a), int(b)) for a, b in directed}
    after = {a: b for a, b in known if (b, a) not in known}
    loops = []
    while after:
        start = min(after)
        loop = [start]
        while (vertex := after.pop(loop[-1])) != start:
            loop.append(vertex)
        loops.append(loop)
    return loops


def add_brim(vertices: Array, faces: Faces, width: float, length: float) -> tuple[Array, Faces]:
    """Rows of triangles around the longest rim, outwards and slightly down; wider in front than behind.

    width   metres, in front
    length  about the edge length of the triangles
    """
    loop = max(rim_loops(faces), key=len)
    rim = vertices[loop]
    outwards = rim - rim.mean(0)
    outwards[:, 1] = 0
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    for _ in range(3):
        outwards = outwards + np.roll(outwards, 1, axis=0) + np.roll(outwards, -1, axis=0)
        outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    reach = width * (0.75 + 0.25 * outwards[:, 2:3]) * (outwards - [0, 0.25, 0])
    rows = max(round(width / length), 1)
    n, base = len(loop), len(vertices)
    numbers = [np.array(loop)] + [base + row * n + np.arange(n) for row in range(rows)]
    places = [rim + reach * (row + 1) / rows for row in range(rows)]
    triangles = [faces]
    for inner, outer in pairwise(numbers):
        next_inner, next_outer = np.roll(inner, -1), np.roll(outer, -1)
        triangles += [np.stack([next_inner, inner, outer], 1), np.stack([next_inner, outer, next_outer], 1)]
    return np.concatenate([vertices, *places]), np.concatenate(triangles).astype(np.int32)
