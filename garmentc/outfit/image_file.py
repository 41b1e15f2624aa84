"""Image files as textures use them: read, checked, one channel taken. Bytes are kept: most are embedded unchanged."""

from __future__ import annotations

import io
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import GarmentcError

if TYPE_CHECKING:
    from PIL import Image

_FORMATS = ("PNG", "JPEG", "TGA", "BMP", "TIFF", "WEBP", "GIF", "PPM", "DDS", "PSD", "SGI", "PCX")
"""What Pillow may decode; not EPS and its like, which run other programs."""


@dataclass(frozen=True)
class LoadedImage:
    """An image file: its bytes, and what Pillow made of its header. `kind` is Pillow's name of the format."""

    path: Path
    data: bytes
    kind: str
    mode: str
    size: tuple[int, int]

    @property
    def has_alpha(self) -> bool:
        return self.mode in ("RGBA", "LA", "PA", "La", "RGBa") or (self.mode == "P" and self._transparency())

    def _transparency(self) -> bool:
        return "transparency" in self.pixels().info

    def pixels(self) -> Image.Image:
        """The decoded image. Raises GarmentcError where the file is damaged."""
        with _opened(self.path, self.data) as image:
            image.load()
            return image


def load_image(path: Path) -> LoadedImage:
    """Read an image and check that it is whole.

    Raises GarmentcError for a file that cannot be read, is no image of a known format, is damaged or cut short, or
    would unpack to more pixels than Pillow allows (a decompression bomb).
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise GarmentcError(f"texture cannot be read: {error.strerror}", path) from None
    with _opened(path, data) as image:
        loaded = LoadedImage(path, data, str(image.format), image.mode, image.size)
        if image.format == "PNG":
            image.verify()  # all checksums; nothing is unpacked
        else:
            image.draft("RGB", (64, 64))  # a JPEG's stream is read to its end, most of its work left out
            image.load()
    return loaded


@contextmanager
def _opened(path: Path, data: bytes) -> Iterator[Image.Image]:
    """Pillow's image of `data`; what goes wrong with it within the block becomes a GarmentcError."""
    from PIL import Image, UnidentifiedImageError

    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Pillow's word on odd files, and on large ones it still takes
            yield Image.open(io.BytesIO(data), formats=_FORMATS)
    except Image.DecompressionBombError:
        raise GarmentcError("texture has too many pixels; scale it down to 8192 x 8192 or less", path) from None
    except UnidentifiedImageError:
        raise GarmentcError("texture is no image of a known format; convert it to PNG or JPEG", path) from None
    except Exception as error:  # Pillow's decoders raise whatever a damaged file provokes
        raise GarmentcError(f"texture is damaged ({error}); export it again", path) from None


def plain(image: Image.Image) -> Image.Image:
    """The image as 8-bit grey, RGB or RGBA."""
    if image.mode in ("L", "RGB", "RGBA"):
        return image
    if image.mode.startswith(("I", "F")):
        values = np.asarray(image, dtype=np.float64)
        top = 65535.0 if image.mode.startswith("I") else 1.0
        return _grey(values / top)
    transparent = image.mode in ("LA", "PA", "La", "RGBa") or "transparency" in image.info
    return image.convert("RGBA" if transparent else "RGB")


def _grey(values: NDArray[Any]) -> Image.Image:
    """An 8-bit image of values in [0, 1]."""
    from PIL import Image

    return Image.fromarray(np.round(np.clip(values, 0, 1) * 255).astype(np.uint8), mode="L")


def channel(image: LoadedImage, wanted: str | None, default: Literal["l", "m"] = "l") -> Image.Image:
    """One channel as 8-bit grey: "r", "g", "b", "m" (alpha) or "l" (luminance), the -imfchan of MTL.

    Without -imfchan `default` counts; "m" falls back to luminance where an image has no alpha or an opaque one.
    """
    pixels = plain(image.pixels())
    bands = pixels.getbands()
    if wanted in ("r", "g", "b") and wanted.upper() in bands:
        return pixels.getchannel(wanted.upper())
    if "A" in bands and (wanted == "m" or (wanted is None and default == "m")):
        alpha = pixels.getchannel("A")
        if wanted == "m" or np.asarray(alpha).min() < 255:
            return alpha
    return pixels.convert("RGB").convert("L")


def is_translucent(image: LoadedImage) -> bool:
    """Whether any pixel of the image is not opaque."""
    if not image.has_alpha:
        return False
    return bool(np.asarray(plain(image.pixels()).getchannel("A")).min() < 255)
