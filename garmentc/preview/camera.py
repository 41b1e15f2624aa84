"""Orthographic views."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Camera:
    """A parallel projection: the same size everywhere, so that pictures compare.

    axes    (3, 3) rows: right, down, away, in world coordinates; orthonormal
    center  (3,) the place in the middle of the picture, metres
    scale   pixels per metre
    size    width, height of the picture, pixels
    """

    axes: NDArray[np.float64]
    center: NDArray[np.float64]
    scale: float
    size: tuple[int, int]

    def project(self, positions: NDArray[Any]) -> NDArray[np.float64]:
        """(V, 3): pixels right, pixels down, depth in metres."""
        seen: NDArray[np.float64] = (positions - self.center) @ self.axes.T
        seen[:, :2] = seen[:, :2] * self.scale + np.array(self.size) / 2
        return seen


def looking(towards: NDArray[Any]) -> NDArray[np.float64]:
    """Axes of a view along a direction, upright where that can be: rows right, down, away."""
    away = np.asarray(towards, np.float64) / np.linalg.norm(towards)
    up = np.array([0.0, 1.0, 0.0]) if abs(away[1]) < 0.999 else np.array([0.0, 0.0, -1.0])
    right = np.cross(away, up)
    right /= np.linalg.norm(right)
    return np.stack([right, np.cross(away, right), away])


def view_axes(heading: float, turn: float, pitch: float) -> NDArray[np.float64]:
    """Axes of a view of somebody who faces `heading`, from `turn` to their left and from `pitch` above; radians.

    Turn 0 is the front; a heading of 0 faces +Z.
    """
    angle = heading + turn
    level = np.cos(pitch)
    return looking(-np.array([np.sin(angle) * level, np.sin(pitch), np.cos(angle) * level]))


def around(positions: NDArray[Any], axes: NDArray[np.float64], resolution: int, margin: float = 0.05) -> Camera:
    """A square view along `axes` that shows all positions (V, 3)."""
    seen = positions @ axes.T
    low, high = seen.min(axis=0), seen.max(axis=0)
    extent = max(float((high - low)[:2].max()), 1e-3) + 2 * margin
    return Camera(axes, (low + high) / 2 @ axes, resolution / extent, (resolution, resolution))
