"""Triangles to pixels on the CPU: orthographic, depth-buffered, smooth-shaded. For pictures in reports."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals

SAMPLES = 2
"""Along each side of a pixel: edges are smoothed by so many times so many samples."""

BACKGROUND = 1.0

_LIGHT = np.array([0.3, 0.5, 0.8]) / np.linalg.norm([0.3, 0.5, 0.8])
_AMBIENT = 0.35
_AT_ONCE = 1 << 20
"""Samples tested at once; this bounds memory."""


@dataclass(frozen=True)
class Surface:
    """A mesh to draw: vertices (V, 3) metres, triangles (F, 3), colors (V, 3) or (3,) from 0 to 1."""

    vertices: NDArray[Any]
    triangles: NDArray[Any]
    colors: NDArray[Any]


@dataclass(frozen=True)
class Camera:
    """Where a picture is taken from.

    rotation  (3, 3) turns the world so that X points right, Y up and Z at the viewer
    target    (3,) what comes to the middle
    height    metres that the picture's height shows
    size      width and height, pixels
    """

    rotation: NDArray[Any]
    target: NDArray[Any]
    height: float
    size: tuple[int, int]


def render(surfaces: Sequence[Surface], camera: Camera) -> NDArray[np.uint8]:
    """The picture (H, W, 3) of `surfaces`. Both sides of a triangle are lit alike."""
    width, height = (SAMPLES * side for side in camera.size)
    colors = np.full((height * width, 3), BACKGROUND)
    depths = np.full(height * width, -np.inf)
    for surface in surfaces:
        points, lit = _projected(surface, camera)
        for pixel, depth, triangle, barycentric in _fragments(points[surface.triangles], width, height):
            # Of the samples at one pixel the nearest wins, and of equally near ones the first triangle's.
            order = np.lexsort((triangle, -depth, pixel))
            first = order[np.diff(pixel[order], prepend=-1) > 0]
            seen = first[depth[first] > depths[pixel[first]]]
            depths[pixel[seen]] = depth[seen]
            corners = lit[surface.triangles[triangle[seen]]]
            colors[pixel[seen]] = np.einsum("nk,nkc->nc", barycentric[seen], corners)
    blocks = colors.reshape(camera.size[1], SAMPLES, camera.size[0], SAMPLES, 3)
    picture: NDArray[np.uint8] = np.rint(255 * np.clip(blocks.mean(axis=(1, 3)), 0, 1)).astype(np.uint8)
    return picture


def _projected(surface: Surface, camera: Camera) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Vertices as x and y in samples, y downwards, and height above the picture's plane; and their lit colours."""
    seen = (np.asarray(surface.vertices, np.float64) - camera.target) @ camera.rotation.T
    scale = SAMPLES * camera.size[1] / camera.height
    middle = SAMPLES * np.array([*camera.size, 0.0]) / 2
    normals = vertex_normals(seen, surface.triangles)
    shade = _AMBIENT + (1 - _AMBIENT) * np.abs(normals @ _LIGHT)
    return seen * [scale, -scale, scale] + middle, np.asarray(surface.colors) * shade[:, None]


def _fragments(
    corners: NDArray[np.float64], width: int, height: int
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.float64], NDArray[np.intp], NDArray[np.float64]]]:
    """Samples covered by triangles `corners` (F, 3, 3): their pixels, depths, triangles and barycentric coordinates.

    Triangles of like size are tested together, each on the grid of samples around it.
    """
    low = np.floor(corners[..., :2].min(axis=1)).astype(np.intp)
    extent = np.ceil(corners[..., :2].max(axis=1)).astype(np.intp) - low + 1
    grid = 1 << np.ceil(np.log2(extent.max(axis=1))).astype(np.intp)
    onto = ((low + extent > 0) & (low < [width, height])).all(axis=1)
    for side in np.unique(grid[onto]):
        alike = np.flatnonzero(onto & (grid == side))
        offsets = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
        chunk = max(_AT_ONCE // len(offsets), 1)
        for start in range(0, len(alike), chunk):
            chosen = alike[start : start + chunk]
            cells = low[chosen, None] + offsets
            weights = _barycentric(cells + 0.5, corners[chosen, :, :2])
            covered = (weights >= 0).all(axis=2) & ((cells >= 0) & (cells < [width, height])).all(axis=2)
            row, column = np.nonzero(covered)
            inner = weights[row, column]
            depth = np.einsum("nk,nk->n", inner, corners[chosen[row], :, 2])
            yield cells[row, column] @ [1, width], depth, chosen[row], inner


def _barycentric(points: NDArray[np.float64], corners: NDArray[np.float64]) -> NDArray[np.float64]:
    """(F, P, 3) coordinates of points (F, P, 2) in triangles (F, 3, 2); all -1 in triangles without area."""
    a, b, c = (corners[:, None, k] for k in range(3))

    def cross(u: NDArray[Any], v: NDArray[Any]) -> NDArray[Any]:
        return np.asarray(u[..., 0] * v[..., 1] - u[..., 1] * v[..., 0])

    area = cross(b - a, c - a)
    parts = np.stack([cross(c - b, points - b), cross(a - c, points - c), cross(b - a, points - a)], axis=-1)
    return np.where(area[..., None] != 0, parts / np.where(area, area, 1)[..., None], -1.0)
