"""Cutting cloth at its hems."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.simulation.body_field import Array, Field
from garmentc.simulation.surface import Faces, compact, vertex_normals


def split_at(vertices: Array, faces: Faces, values: Array) -> tuple[Array, Faces]:
    """The part of a mesh where `values` (V,) >= 0; crossed triangles are cut along the zero line."""
    inside = values >= 0
    count = inside[faces].sum(1)
    whole = faces[count == 3]
    crossed = np.concatenate([faces[(count == 1) | (count == 2)]])
    # Turn each crossed triangle so that its lone corner comes first.
    flags = inside[crossed]
    lone_value = (count[(count == 1) | (count == 2)] == 1)[:, None]
    lone = np.argmax(flags == lone_value, axis=1)
    rows = np.arange(len(crossed))
    a, b, c = (crossed[rows, (lone + k) % 3] for k in range(3))
    pairs = np.sort(np.concatenate([np.stack([a, b], 1), np.stack([a, c], 1)]), axis=1)
    unique, number = np.unique(pairs, axis=0, return_inverse=True)
    t = values[unique[:, 0]] / (values[unique[:, 0]] - values[unique[:, 1]])
    fresh = vertices[unique[:, 0]] * (1 - t[:, None]) + vertices[unique[:, 1]] * t[:, None]
    # Where a corner lies on the line, it is the cut point itself.
    place = np.where(t == 0, unique[:, 0], np.where(t == 1, unique[:, 1], np.arange(len(unique)) + len(vertices)))
    number = place[number.reshape(-1)]
    ab, ac = number[: len(a)], number[len(a) :]
    one = lone_value[:, 0]
    parts = [
        whole,
        np.stack([a, ab, ac], 1)[one],
        np.stack([ab, b, c], 1)[~one],
        np.stack([ab, c, ac], 1)[~one],
    ]
    joined = np.concatenate(parts).astype(np.int32)
    joined = joined[(joined[:, 0] != joined[:, 1]) & (joined[:, 1] != joined[:, 2]) & (joined[:, 2] != joined[:, 0])]
    return compact(np.concatenate([vertices, fresh]), joined)


def trim(vertices: Array, faces: Faces, keep: Field, length: float) -> tuple[Array, Faces]:
    """Cut a mesh where `keep` turns negative. Vertices near the hem slide onto it first, so no slivers remain."""
    normals = vertex_normals(vertices, faces)
    moved, on_hem = slide_to_hem(vertices, normals, keep, 0.35 * length)
    values = np.where(on_hem, 0.0, keep(moved))
    moved, faces = split_at(moved, faces, values)
    # A triangle with all corners on a concave hem may lie outside.
    flap = keep(moved[faces].mean(1)) < -0.1 * length
    return compact(moved, faces[~flap])


def slide_to_hem(points: Array, normals: Array, keep: Field, reach: float) -> tuple[Array, NDArray[np.bool_]]:
    """Newton steps along the surface to the zero line of `keep`, for points within `reach`; says which arrived."""
    moved = points.copy()
    chosen = np.nonzero(np.abs(keep(points)) < 1.5 * reach)[0]
    for _ in range(3):
        here, step = moved[chosen], 1e-5
        value = keep(here)
        gradient = np.stack([(keep(here + step * axis) - value) / step for axis in np.eye(3)], 1)
        gradient -= (gradient * normals[chosen]).sum(1, keepdims=True) * normals[chosen]
        moved[chosen] -= (value / np.maximum((gradient**2).sum(1), 0.05))[:, None] * gradient
    arrived = (np.linalg.norm(moved[chosen] - points[chosen], axis=1) < reach) & (np.abs(keep(moved[chosen])) < 1e-4)
    on_hem = np.zeros(len(points), dtype=bool)
    on_hem[chosen[arrived]] = True
    return np.where(on_hem[:, None], moved, points), on_hem
