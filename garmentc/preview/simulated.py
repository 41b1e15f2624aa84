"""Simulated outfits as surfaces to be drawn, each garment in a colour of its own."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import vertex_normals
from garmentc.preview.camera import Camera, view_axes
from garmentc.preview.material import Material
from garmentc.preview.surface import Surface
from garmentc.preview.texture import srgb_to_linear
from garmentc.smpl.rotations import axis_angle_to_matrix

if TYPE_CHECKING:
    from garmentc.simulation.sequence import Sequence

_MATT = Material(roughness=1.0)
_CLOTH = np.array([[0.27, 0.43, 0.71], [0.75, 0.31, 0.27], [0.35, 0.59, 0.35], [0.75, 0.63, 0.31]])
_TURN, _PITCH = np.radians(25.0), np.radians(8.0)
_MARGIN = 1.06


def garment_colors(sequence: Sequence) -> NDArray[np.float64]:
    """Colours (V, 3), sRGB, of an outfit's vertices by the garment that they belong to."""
    part = np.zeros(len(sequence.template), np.intp)
    part[sequence.faces] = sequence.triangle_part[:, None]
    colors: NDArray[np.float64] = _CLOTH[part % len(_CLOTH)]
    return colors


def cloth_surface(vertices: NDArray[Any], faces: NDArray[Any], colors: NDArray[Any]) -> Surface:
    """Matt cloth of posed `vertices` (V, 3) in sRGB `colors` (V, 3)."""
    return Surface(vertices, vertex_normals(vertices, faces), faces, _MATT, colors=srgb_to_linear(colors))


def front_camera(
    points: NDArray[np.float64], pose: NDArray[Any], size: tuple[int, int], scale: float | None = None
) -> Camera:
    """A view from the front, whichever way the pelvis faces, a little from above and from the side.

    points  (N, 3) what is in the middle
    pose    (24, 3)
    size    width, height, pixels
    scale   pixels per metre; None shows all points
    """
    front = axis_angle_to_matrix(np.asarray(pose[0], np.float64))[:, 2]
    axes = view_axes(np.arctan2(front[0], front[2]), _TURN, _PITCH)
    seen = points @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    fitting = float((np.array(size) / (high - low)[:2]).min() / _MARGIN)
    return Camera(axes, (low + high) / 2 @ axes, scale or fitting, size)
