"""Pictures of clothes on bodies, for people to look at."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from garmentc.outfit.topology import vertex_normals
from garmentc.preview.camera import Camera, view_axes
from garmentc.preview.material import Material
from garmentc.preview.render import light_scene, render
from garmentc.preview.surface import Scene, Surface
from garmentc.preview.worn import CLAY

COLORS = ((0.06, 0.14, 0.35), (0.40, 0.06, 0.05), (0.11, 0.25, 0.11), (0.50, 0.33, 0.08), (0.18, 0.11, 0.27))
"""Linear light."""

PITCH = 0.12


def draw(
    body: tuple[NDArray[Any], NDArray[Any]],
    layers: Sequence[tuple[NDArray[Any], NDArray[Any], int]],
    turns: Sequence[float],
    frame: tuple[NDArray[Any], float],
    size: tuple[int, int],
) -> list[Image.Image]:
    """A picture from each of `turns` (radians about the vertical; 0 is the front).

    body    vertices and faces
    layers  vertices, triangles and the number of a colour, each
    frame   the place (3,) in the middle of the pictures, and the metres that their height shows
    """
    surfaces = [_surface(*body, CLAY)]
    surfaces += [
        _surface(vertices, triangles, Material(base_color=(*COLORS[color % len(COLORS)], 1.0)))
        for vertices, triangles, color in layers
    ]
    lit = light_scene(Scene(tuple(surfaces)))
    cameras = (Camera(view_axes(0.0, turn, PITCH), frame[0], size[1] / frame[1], size) for turn in turns)
    return [Image.fromarray(render(lit, camera)) for camera in cameras]


def _surface(vertices: NDArray[Any], triangles: NDArray[Any], material: Material) -> Surface:
    places = np.asarray(vertices, np.float64)
    return Surface(places, vertex_normals(places, triangles), triangles, material)
