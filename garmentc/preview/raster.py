"""Triangles to pixels: a z-buffer in numpy, for orthographic views."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

_BATCH = 1 << 20
"""Pixels of bounding boxes that are tested at a time; bounds the memory."""


@dataclass(frozen=True)
class Fragments:
    """Pixels with a triangle behind their centre.

    pixel        (P,) row * width + column
    triangle     (P,)
    barycentric  (P, 3) float32, weights of the triangle's corners
    depth        (P,) float32
    """

    pixel: NDArray[np.int64]
    triangle: NDArray[np.int64]
    barycentric: NDArray[np.float32]
    depth: NDArray[np.float32]

    def __getitem__(self, chosen: Any) -> Fragments:
        return Fragments(self.pixel[chosen], self.triangle[chosen], self.barycentric[chosen], self.depth[chosen])

    def interpolate(self, values: NDArray[Any], triangles: NDArray[Any]) -> NDArray[np.float32]:
        """Values (V, C) at the vertices of `triangles` (F, 3), at the fragments: (P, C) float32."""
        corners = values.astype(np.float32)[triangles[self.triangle]]
        values_there: NDArray[np.float32] = np.einsum("pk,pkc->pc", self.barycentric, corners)
        return values_there


def visible(
    points: NDArray[Any],
    triangles: NDArray[Any],
    size: tuple[int, int],
    kept: Callable[[Fragments], NDArray[np.bool_]] | None = None,
) -> Fragments:
    """The nearest fragment of each covered pixel; of equally near ones that of the later triangle.

    points     (V, 3) pixels right, pixels down, depth; smaller depth is nearer. Pixel centres lie at halves
    triangles  (F, 3)
    size       width, height in pixels
    kept       which fragments there are at all: cut-outs of transparent textures
    """
    depth = np.full(size[0] * size[1], np.inf, dtype=np.float32)
    owner = np.full(size[0] * size[1], -1)
    layers = []
    for fragments in _covered(points, triangles, size):
        if kept is not None:
            fragments = fragments[kept(fragments)]
        np.minimum.at(depth, fragments.pixel, fragments.depth)
        layers.append(fragments[fragments.depth == depth[fragments.pixel]])
    for number, layer in enumerate(layers):
        layers[number] = nearest = layer[layer.depth == depth[layer.pixel]]
        np.maximum.at(owner, nearest.pixel, nearest.triangle)
    return _joined([layer[layer.triangle == owner[layer.pixel]] for layer in layers])


def depth_range(
    points: NDArray[Any], triangles: NDArray[Any], size: tuple[int, int]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Depth of the nearest and of the farthest surface at each pixel, (height, width) each; infinite where is none.

    Arguments as in `visible`.
    """
    near = np.full(size[0] * size[1], np.inf, dtype=np.float32)
    far = np.full(size[0] * size[1], -np.inf, dtype=np.float32)
    for fragments in _covered(points, triangles, size):
        np.minimum.at(near, fragments.pixel, fragments.depth)
        np.maximum.at(far, fragments.pixel, fragments.depth)
    return near.reshape(size[::-1]), far.reshape(size[::-1])


def _covered(points: NDArray[Any], triangles: NDArray[Any], size: tuple[int, int]) -> Iterator[Fragments]:
    """All fragments, in batches: every pixel of every triangle's bounding box, tested by barycentric coordinates."""
    corners = np.asarray(points, dtype=np.float64)[triangles]
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    first = np.clip(np.ceil(low - 0.5), 0, size).astype(np.int64)
    last = np.clip(np.floor(high - 0.5), -1, np.array(size) - 1).astype(np.int64)
    extent = np.maximum(last - first + 1, 0)
    first_edge, second_edge = corners[:, 1, :2] - corners[:, 0, :2], corners[:, 2, :2] - corners[:, 0, :2]
    area = first_edge[:, 0] * second_edge[:, 1] - first_edge[:, 1] * second_edge[:, 0]
    count = np.where(np.abs(area) > 1e-12, extent[:, 0] * extent[:, 1], 0)
    seen = np.flatnonzero(count)
    if not len(seen):
        return
    # Barycentric coordinates and depth are planes over the picture: one value and two slopes for each triangle.
    corners, first, width, count, area = corners[seen], first[seen], extent[seen, 0], count[seen], area[seen]
    across = np.stack([second_edge[seen, 1], -first_edge[seen, 1]], axis=1) / area[:, None]
    down = np.stack([-second_edge[seen, 0], first_edge[seen, 0]], axis=1) / area[:, None]
    offset = first + 0.5 - corners[:, 0, :2]
    start = across * offset[:, :1] + down * offset[:, 1:]
    planes = np.concatenate([start, across, down], axis=1).astype(np.float32)
    depths = np.stack([corners[:, 0, 2], *(corners[:, 1:, 2] - corners[:, :1, 2]).T], axis=1).astype(np.float32)
    corner = first[:, 1] * size[0] + first[:, 0]

    ends = np.cumsum(count)
    begin = 0
    while begin < len(seen):
        before = int(ends[begin] - count[begin])
        end = max(begin + 1, int(np.searchsorted(ends, before + _BATCH, side="right")))
        part = slice(begin, end)
        local = np.repeat(np.arange(begin, end), count[part])
        step = np.arange(len(local)) - np.repeat(ends[part] - count[part] - before, count[part])
        row, column = np.divmod(step.astype(np.int32), width.astype(np.int32)[local])
        right, below = column.astype(np.float32), row.astype(np.float32)
        plane = planes[local]
        second = plane[:, 0] + plane[:, 2] * right + plane[:, 4] * below
        third = plane[:, 1] + plane[:, 3] * right + plane[:, 5] * below
        inside = np.flatnonzero((second >= 0) & (third >= 0) & (second + third <= 1))
        local, second, third = local[inside], second[inside], third[inside]
        yield Fragments(
            pixel=corner[local] + row[inside].astype(np.int64) * size[0] + column[inside],
            triangle=seen[local],
            barycentric=np.stack([1 - second - third, second, third], axis=1),
            depth=depths[local, 0] + depths[local, 1] * second + depths[local, 2] * third,
        )
        begin = end


def _joined(parts: list[Fragments]) -> Fragments:
    """Several as one."""
    if not parts:
        none = np.zeros(0, dtype=np.int64)
        return Fragments(none, none, np.zeros((0, 3), np.float32), np.zeros(0, np.float32))
    return Fragments(
        np.concatenate([part.pixel for part in parts]),
        np.concatenate([part.triangle for part in parts]),
        np.concatenate([part.barycentric for part in parts]),
        np.concatenate([part.depth for part in parts]),
    )
