"""Textures of glTF materials: PNG and JPEG pass through byte for byte, all else becomes PNG; PBR maps are merged."""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Literal

import numpy as np

from garmentc.outfit.image_file import LoadedImage, plain
from garmentc.outfit.mtl import MapReference
from garmentc.outfit.outfit import Texture

if TYPE_CHECKING:
    from PIL import Image

_EMBEDDABLE = {"PNG": "image/png", "JPEG": "image/jpeg", "MPO": "image/jpeg"}
_EMBEDDABLE_MODES = ("1", "L", "LA", "P", "RGB", "RGBA", "I;16", "I")
_BINARY_SHARE = 0.05
"""A mask with fewer pixels than this between clear and opaque is a cut-out; antialiased edges have some."""

_NORMAL_LENGTH = (0.7, 1.3)
_GREY_DIFFERENCE = 6.0
_SLOPE = 4.0
"""Rise of a converted height map from black to white, in pixels, at -bm 1."""


def as_texture(image: LoadedImage, reference: MapReference) -> Texture:
    """The texture that a map statement makes of an image."""
    if image.kind in _EMBEDDABLE and image.mode in _EMBEDDABLE_MODES:
        return _texture(image.path.stem, image.data, _EMBEDDABLE[image.kind], reference)
    return png_texture(image.path.stem, plain(image.pixels()), reference)


def png_texture(name: str, image: Image.Image, reference: MapReference) -> Texture:
    """A texture of pixels, written as PNG."""
    stream = io.BytesIO()
    image.save(stream, format="PNG")
    return _texture(name, stream.getvalue(), "image/png", reference)


def _texture(name: str, data: bytes, mime_type: str, reference: MapReference) -> Texture:
    return Texture(name, data, mime_type, reference.scale, reference.offset, reference.clamp)


def with_alpha(color: LoadedImage | None, mask: Image.Image) -> Image.Image:
    """RGBA of a colour image (white if None) and a grey mask, in the larger of both sizes."""
    from PIL import Image

    white = Image.new("RGB", mask.size, (255, 255, 255))
    base = white if color is None else plain(color.pixels()).convert("RGB")
    size = (max(base.width, mask.width), max(base.height, mask.height))
    base, mask = (part if part.size == size else part.resize(size, Image.Resampling.BILINEAR) for part in (base, mask))
    base = base.copy()
    base.putalpha(mask)
    return base


def alpha_mode(mask: Image.Image) -> Literal["OPAQUE", "MASK", "BLEND"]:
    """What a mask asks for: nothing, a cut-out, or blending."""
    values = np.asarray(mask)
    if values.min() >= 250:
        return "OPAQUE"
    between = np.count_nonzero((values > 25) & (values < 230))
    return "MASK" if between < _BINARY_SHARE * values.size else "BLEND"


def metallic_roughness(roughness: Image.Image | None, metal: Image.Image | None) -> Image.Image:
    """RGB with roughness in green and metalness in blue, in the larger of both sizes; an absent one is full."""
    from PIL import Image

    given = [part for part in (roughness, metal) if part is not None]
    size = (max(part.width for part in given), max(part.height for part in given))
    full = Image.new("L", size, 255)
    green, blue = (
        full if part is None else part if part.size == size else part.resize(size, Image.Resampling.BILINEAR)
        for part in (roughness, metal)
    )
    return Image.merge("RGB", (full, green, blue))


def bump_kind(image: LoadedImage) -> Literal["normal", "height", "other"]:
    """What a `map_Bump` image holds: unit vectors in colour, heights in grey, or a picture."""
    small = plain(image.pixels())
    if small.mode == "L":
        return "height"
    small = small.convert("RGB")
    small.thumbnail((256, 256))
    rgb = np.asarray(small, dtype=np.float64)
    if (rgb.max(axis=2) - rgb.min(axis=2)).mean() < _GREY_DIFFERENCE:
        return "height"
    vectors = rgb / 127.5 - 1
    length = np.linalg.norm(vectors, axis=2)
    unit = (length > _NORMAL_LENGTH[0]) & (length < _NORMAL_LENGTH[1])
    return "normal" if vectors[..., 2].mean() > 0.3 and unit.mean() > 0.8 else "other"


def normals_of_heights(heights: Image.Image, strength: float, wrap: bool) -> Image.Image:
    """The tangent-space normal map (OpenGL convention, green up) of a grey height map."""
    from PIL import Image

    rise = np.asarray(heights, dtype=np.float64) / 255 * strength * _SLOPE
    padded = np.pad(rise, 1, mode="wrap" if wrap else "edge")
    along_u = (padded[1:-1, 2:] - padded[1:-1, :-2]) / 2
    along_v = (padded[:-2, 1:-1] - padded[2:, 1:-1]) / 2
    normal = np.stack([-along_u, -along_v, np.ones_like(rise)], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return Image.fromarray(np.round((normal + 1) * 127.5).astype(np.uint8), mode="RGB")
