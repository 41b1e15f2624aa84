"""Pictures against the rig: does an engine draw the outfit where it is, to the pixel?"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.ndimage import distance_transform_edt


@dataclass(frozen=True)
class View:
    """A camera; all renderers of the suite take it as it is.

    position, target  metres, glTF's axes; +Y is up
    fov               vertical field of view, degrees
    width, height     pixels
    sun               towards the light
    """

    position: tuple[float, float, float]
    target: tuple[float, float, float]
    fov: float = 30.0
    width: int = 512
    height: int = 640
    sun: tuple[float, float, float] = (1.0, 2.0, 3.0)

    def as_job(self) -> dict[str, Any]:
        """For an engine's jobs.json."""
        return asdict(self)

    @property
    def millimetres_per_pixel(self) -> float:
        """At the target."""
        distance = np.linalg.norm(np.subtract(self.position, self.target))
        return float(2000 * distance * np.tan(np.radians(self.fov) / 2) / self.height)

    def project(self, points: np.ndarray) -> np.ndarray:
        """(S, 3) to (S, 2) pixels, x to the right and y down."""
        forward = np.subtract(self.target, self.position)
        forward = forward / np.linalg.norm(forward)
        right = np.cross(forward, (0, 1, 0))
        right /= np.linalg.norm(right)
        local = (points - self.position) @ np.stack([right, np.cross(right, forward), forward], axis=1)
        focal = self.height / 2 / np.tan(np.radians(self.fov) / 2)
        return local[:, :2] / local[:, 2:] * (focal, -focal) + (self.width / 2, self.height / 2)


def view_of(points: np.ndarray, angle: float = 0.35, **other: Any) -> View:
    """A camera from the front, `angle` radians to the side and a little above, that sees all points (S, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    centre, radius = (low + high) / 2, float(np.linalg.norm(high - low)) / 2
    away = np.array([np.sin(angle), 0.15, np.cos(angle)])
    view = View((0, 0, 0), tuple(centre.tolist()), **other)
    narrow = np.radians(view.fov) / 2 * min(1, view.width / view.height)
    position = centre + away / np.linalg.norm(away) * radius / np.sin(narrow)
    return View(tuple(position.tolist()), view.target, **other)


def silhouette(points: np.ndarray, triangles: np.ndarray, view: View) -> np.ndarray:
    """(height, width) bool: the pixels whose centre lies in a triangle, as GPUs decide it."""
    covered = np.zeros((view.height, view.width), dtype=bool)
    corners = view.project(points)[triangles]
    size = (view.width, view.height)
    low = np.clip(np.ceil(corners.min(axis=1) - 0.5), 0, size).astype(int)
    high = np.clip(np.floor(corners.max(axis=1) + 0.5), 0, size).astype(int)
    seen = (high > low).all(axis=1)
    for (a, b, c), (left, top), (right, bottom) in zip(corners[seen], low[seen], high[seen], strict=True):
        x, y = np.arange(left, right) + 0.5, np.arange(top, bottom)[:, None] + 0.5
        sides = np.stack([_side(a, b, x, y), _side(b, c, x, y), _side(c, a, x, y)])
        covered[top:bottom, left:right] |= (sides >= 0).all(axis=0) | (sides <= 0).all(axis=0)
    return covered


def _side(start: np.ndarray, end: np.ndarray, x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Positive on one side of the line, negative on the other."""
    return (end[0] - start[0]) * (y - start[1]) - (end[1] - start[1]) * (x - start[0])


def drawn(picture: Path) -> np.ndarray:
    """(height, width) bool: the pixels that an engine covered, by the picture's alpha."""
    return np.array(Image.open(picture).convert("RGBA"))[..., 3] > 127


def pixels_apart(found: np.ndarray, expected: np.ndarray) -> float:
    """The largest distance from a pixel that differs to the expected outline; 1 is the rounding of an edge."""
    if not found.any():
        return float(np.inf)
    outside = distance_transform_edt(~expected)[found & ~expected]
    inside = distance_transform_edt(expected)[~found & expected]
    return float(max(outside.max(initial=0), inside.max(initial=0)))
