"""Textures as the renderer samples them: linear light, with mip levels so that small pictures do not flicker."""

from __future__ import annotations

import io
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError
from garmentc.gltf.glb_asset import Image

LARGEST = 1024
"""Pixels of a side; larger images are scaled down, as the pictures are small."""

REPEAT, CLAMP_TO_EDGE, MIRRORED_REPEAT = 10497, 33071, 33648
"""glTF's numbers of wrapping modes (glTF 2.0 section 5.26)."""


@dataclass(frozen=True)
class Texture:
    """An image with its mip levels, and how texture coordinates find a place in it.

    levels     (h, w, 4) float32 in [0, 1], each half as large as the one before
    wrap       modes of u and v
    offset, rotation, scale  KHR_texture_transform; radians
    """

    levels: tuple[NDArray[np.float32], ...]
    wrap: tuple[int, int] = (REPEAT, REPEAT)
    offset: tuple[float, float] = (0.0, 0.0)
    rotation: float = 0.0
    scale: tuple[float, float] = (1.0, 1.0)

    def placed(self, uv: NDArray[Any]) -> NDArray[np.float64]:
        """Texture coordinates (..., 2) after the transform."""
        sine, cosine = np.sin(self.rotation), np.cos(self.rotation)
        matrix = np.array([[cosine, sine], [-sine, cosine]]) * self.scale
        moved: NDArray[np.float64] = uv @ matrix.T + self.offset
        return moved

    def sample(self, uv: NDArray[Any], footprint: NDArray[Any]) -> NDArray[np.float32]:
        """Colours (P, 4) at texture coordinates (P, 2), bilinear, from the mip level that fits.

        footprint  (P,) area that a pixel covers in texture coordinates
        """
        height, width = self.levels[0].shape[:2]
        texels = np.maximum(footprint * abs(self.scale[0] * self.scale[1]) * width * height, 1.0)
        chosen = np.minimum((0.5 * np.log2(texels)).round().astype(int), len(self.levels) - 1)
        places = self.placed(uv)
        color = np.empty((len(uv), 4), dtype=np.float32)
        for level in np.unique(chosen):
            here = np.flatnonzero(chosen == level)
            color[here] = _bilinear(self.levels[level], places[here], self.wrap)
        return color


def _bilinear(image: NDArray[np.float32], uv: NDArray[Any], wrap: tuple[int, int]) -> NDArray[np.float32]:
    height, width = image.shape[:2]
    place = uv * (width, height) - 0.5
    low = np.floor(place)
    share = (place - low).astype(np.float32)
    left, right = (_wrapped(low[:, 0] + step, width, wrap[0]) for step in (0, 1))
    upper, lower = (_wrapped(low[:, 1] + step, height, wrap[1]) for step in (0, 1))
    x, y = share[:, :1], share[:, 1:]
    above = image[upper, left] * (1 - x) + image[upper, right] * x
    below = image[lower, left] * (1 - x) + image[lower, right] * x
    mixed: NDArray[np.float32] = above * (1 - y) + below * y
    return mixed


def _wrapped(index: NDArray[Any], size: int, mode: int) -> NDArray[Any]:
    number: NDArray[np.int64] = np.nan_to_num(index).clip(-(2.0**31), 2.0**31).astype(np.int64)
    if mode == CLAMP_TO_EDGE:
        return number.clip(0, size - 1)
    if mode == MIRRORED_REPEAT:
        period = number % (2 * size)
        return np.minimum(period, 2 * size - 1 - period)
    return number % size


def decode(image: Image, path: Path, is_color: bool) -> tuple[NDArray[np.float32], ...]:
    """Mip levels of an embedded PNG or JPEG.

    is_color  the image holds sRGB colours; otherwise plain numbers (normals, roughness)
    Raises GarmentcError where the image is damaged, or of another format.
    """
    import PIL.Image

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            opened = PIL.Image.open(io.BytesIO(image.data), formats=("PNG", "JPEG", "WEBP"))
            opened.thumbnail((LARGEST, LARGEST), PIL.Image.Resampling.BOX)
            pixels = np.asarray(opened.convert("RGBA"))
    except Exception as error:  # Pillow's decoders raise whatever a damaged file provokes
        raise GarmentcError(
            f"has an image '{image.name}' that cannot be read ({error}); embed it again", path
        ) from None
    level: NDArray[Any] = pixels.astype(np.float32) / 255
    if is_color:
        level[..., :3] = srgb_to_linear(level[..., :3])
    levels = [level]
    while min(level.shape[:2]) >= 2:
        level = level[: level.shape[0] // 2 * 2, : level.shape[1] // 2 * 2]
        level = (level[::2, ::2] + level[1::2, ::2] + level[::2, 1::2] + level[1::2, 1::2]) / 4
        levels.append(level)
    return tuple(levels)


def srgb_to_linear(value: NDArray[Any]) -> NDArray[Any]:
    """IEC 61966-2-1, values in [0, 1]."""
    linear: NDArray[Any] = np.where(value <= 0.04045, value / 12.92, ((value + 0.055) / 1.055) ** 2.4)
    return linear


def linear_to_srgb(value: NDArray[Any]) -> NDArray[Any]:
    """IEC 61966-2-1, values in [0, 1]."""
    srgb: NDArray[Any] = np.where(value <= 0.0031308, value * 12.92, 1.055 * np.maximum(value, 0) ** (1 / 2.4) - 0.055)
    return srgb
