"""Where cloth lies inside the body, as colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.evaluation.metrics import MILLIMETRES, signed_distance
from garmentc.preview.material import Material
from garmentc.preview.surface import Surface
from garmentc.preview.texture import srgb_to_linear

DEEPEST_MM = 10.0
"""Depth at the end of the scale; what is deeper looks the same."""

_SCALE = ((0.80, 0.82, 0.85), (0.99, 0.86, 0.35), (0.95, 0.47, 0.17), (0.76, 0.10, 0.16), (0.36, 0.02, 0.22))
"""sRGB, from outside the body to DEEPEST_MM inside. Lightness falls all the way, so it reads without colour too."""

_CLOTH = Material(roughness=1.0)
_BODY_BEHIND = 0.04


@dataclass(frozen=True)
class Penetration:
    """Cloth and skin recoloured, and what the picture's caption says.

    share       of the outfit's vertices inside the body; seams count once
    deepest_mm  of them
    """

    cloth: tuple[Surface, ...]
    skin: Surface
    share: float
    deepest_mm: float


def penetration(cloth: Sequence[Surface], skin: Surface) -> Penetration:
    """Measure the cloth against the posed body.

    The body is drawn a little further away than it is: cloth inside it would be hidden else.
    """
    positions = np.concatenate([np.zeros((0, 3)), *(surface.positions for surface in cloth)])
    # Vertices that a seam splits are at one place but for rounding.
    _, first, place = np.unique(positions.round(7), axis=0, return_index=True, return_inverse=True)
    depth = MILLIMETRES * np.maximum(-signed_distance(positions[first], skin.positions, skin.triangles), 0.0)
    colors = depth_colors(depth)[place.reshape(-1)]
    starts = np.cumsum([0, *(len(surface.positions) for surface in cloth)])
    return Penetration(
        cloth=tuple(
            replace(surface, material=_CLOTH, colors=colors[start:end], texcoords=None)
            for surface, start, end in zip(cloth, starts[:-1], starts[1:], strict=True)
        ),
        skin=replace(skin, behind=_BODY_BEHIND),
        share=float((depth > 0).mean()) if len(depth) else 0.0,
        deepest_mm=float(depth.max(initial=0.0)),
    )


def depth_colors(depth_mm: NDArray[Any]) -> NDArray[np.float64]:
    """Linear colours (N, 3) of depths (N,) in millimetres."""
    stops = srgb_to_linear(np.array(_SCALE))
    # What is inside at all starts a little up the scale, so that it shows.
    place = np.where(depth_mm > 0, 0.08 + 0.92 * np.clip(depth_mm / DEEPEST_MM, 0, 1), 0.0)
    at = np.linspace(0, 1, len(stops))
    return np.stack([np.interp(place, at, stops[:, channel]) for channel in range(3)], axis=1)
