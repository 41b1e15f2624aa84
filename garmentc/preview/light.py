"""Light: a soft sky with ambient occlusion, and one lamp with soft shadows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.preview.camera import Camera, around, looking
from garmentc.preview.raster import depth_range

AMBIENT, LAMP = 0.6, 0.95
"""Brightness of a white surface that faces up to the open sky, and of one that faces the lamp."""

_SKY, _GROUND = 1.0, 0.5
"""Brightness of the surroundings straight above and straight below, relative to each other."""

_DIRECTIONS = 64
_SKY_MAP, _LAMP_MAP = 320, 1024
_LIFT = 0.006
"""Metres off its surface at least that a point is asked about: cloth must not shade itself."""

_PENUMBRA = 0.012
"""Metres: half width of the blur of the lamp's shadows."""


def sky_light(
    positions: NDArray[Any], triangles: NDArray[Any], points: NDArray[Any], normals: NDArray[Any]
) -> NDArray[np.float32]:
    """Light of the surroundings that reaches points on surfaces, (P, 2): on the side of the normal, and behind it.

    1 is what an unshaded surface facing up gets. Occlusion is measured with depth maps along 64 directions, each of
    which serves the opposite direction too.

    positions, triangles  (V, 3), (F, 3) what casts shadows
    points, normals       (P, 3) each
    """
    light = np.zeros((len(points), 2))
    directions = _half_sphere(_DIRECTIONS // 2)
    for direction in directions:
        camera = around(positions, looking(direction), _SKY_MAP)
        near, far = depth_range(camera.project(positions), triangles, camera.size)
        cosine = normals @ direction
        lift = _lift(camera)
        for source, blocker in ((1.0, far), (-1.0, near)):  # light from `direction`, and from its opposite
            brightness = _GROUND + (_SKY - _GROUND) * (source * direction[1] + 1) / 2
            for side, facing in ((0, source * cosine), (1, -source * cosine)):
                lit = np.flatnonzero(facing > 0)
                lifted = camera.project(points[lit] + (lift if side == 0 else -lift) * normals[lit])
                free = source * (lifted[:, 2] - _lookup(blocker, lifted)) >= 0
                light[lit, side] += brightness * facing[lit] * free
    upward = sum(direction[1] * (_GROUND + (_SKY - _GROUND) * (direction[1] + 1) / 2) for direction in directions)
    relative: NDArray[np.float32] = (light / upward).astype(np.float32)
    return relative


@lru_cache(maxsize=1)
def _half_sphere(count: int) -> NDArray[np.float64]:
    """(count, 3) unit vectors which with their opposites cover the sphere evenly: a Fibonacci lattice's upper half."""
    index = np.arange(count)
    height = (index + 0.5) / count
    angle = index * np.pi * (3 - np.sqrt(5))
    ring = np.sqrt(1 - height**2)
    return np.stack([ring * np.cos(angle), height, ring * np.sin(angle)], axis=1)


@dataclass(frozen=True)
class Lamp:
    """A distant lamp and the depth map of what it lights first.

    direction  (3,) towards the lamp, unit
    """

    direction: NDArray[np.float64]
    camera: Camera
    depth: NDArray[np.float32]

    def reaches(self, points: NDArray[Any], normals: NDArray[Any]) -> NDArray[np.float32]:
        """Share (P,) of the lamp that is seen from points; normals are on the lit side."""
        places = self.camera.project(points + _lift(self.camera) * normals)
        share = np.zeros(len(points), dtype=np.float32)
        offsets = _disc(16) * _PENUMBRA * self.camera.scale
        for offset in offsets:
            share += _lookup(self.depth, places[:, :2] + offset) >= places[:, 2]
        return share / np.float32(len(offsets))


def lamp(positions: NDArray[Any], triangles: NDArray[Any], direction: NDArray[Any]) -> Lamp:
    """A lamp in a direction (3,) that shines on a mesh (V, 3), (F, 3)."""
    towards = np.asarray(direction, np.float64) / np.linalg.norm(direction)
    camera = around(positions, looking(-towards), _LAMP_MAP)
    return Lamp(towards, camera, depth_range(camera.project(positions), triangles, camera.size)[0])


@lru_cache(maxsize=1)
def _disc(count: int) -> NDArray[np.float64]:
    """(count, 2) points spread evenly over the unit disc (Vogel's spiral)."""
    index = np.arange(count)
    radius, angle = np.sqrt((index + 0.5) / count), index * np.pi * (3 - np.sqrt(5))
    return np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)


def _lift(camera: Camera) -> float:
    """Metres off a surface where its own pixels in a depth map no longer shade it."""
    return max(_LIFT, 1.5 / camera.scale)


def _lookup(image: NDArray[np.float32], places: NDArray[Any]) -> NDArray[np.float32]:
    """The pixels (P,) of a map at places (P, 2 or more); a map's border is empty, so places beyond it are too."""
    height, width = image.shape
    column = np.clip(places[:, 0].astype(np.int64), 0, width - 1)
    row = np.clip(places[:, 1].astype(np.int64), 0, height - 1)
    found: NDArray[np.float32] = image[row, column]
    return found
