"""The outfit as its author made it: positions, corners, materials. Nothing here knows about bodies or glTF."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic


@dataclass(frozen=True)
class Texture:
    """An image that a material names. `data` is a PNG or JPEG file's bytes, ready to embed.

    `scale` and `offset` are MTL's -s and -o options (u, v); `clamp` is -clamp on.
    """

    name: str
    data: bytes
    mime_type: str  # "image/png" or "image/jpeg"
    scale: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    clamp: bool = False


@dataclass(frozen=True)
class Material:
    """A metallic-roughness material (glTF 2.0 section 3.9), colours linear.

    `metallic_roughness` is an image with roughness in G and metalness in B, merged from the MTL's separate maps.
    """

    name: str
    base_color: tuple[float, float, float, float] = (0.8, 0.8, 0.8, 1.0)
    metallic: float = 0.0
    roughness: float = 1.0
    specular_color: tuple[float, float, float] | None = None
    emissive: tuple[float, float, float] = (0.0, 0.0, 0.0)
    alpha_mode: str = "OPAQUE"  # "OPAQUE", "MASK" or "BLEND"
    base_color_texture: Texture | None = None
    metallic_roughness_texture: Texture | None = None
    normal_texture: Texture | None = None
    normal_scale: float = 1.0
    emissive_texture: Texture | None = None


@dataclass(frozen=True)
class Outfit:
    """A triangulated outfit that still knows its OBJ.

    The corner table is the truth: corner k of triangle t is (tri_v[t, k], tri_vt[t, k], tri_vn[t, k]),
    indices into `vertices`, `texcoords` and `normals`; -1 where the file gives none.
    Vertex order is the file's. Unreferenced vertices are kept.

    vertices      (V, 3) float64, in file units until `align` has run, metres and Y up after
    texcoords     (T, 2) float64, OBJ convention (v upwards)
    normals       (K, 3) float64, as authored, not necessarily unit length
    colors        (V, 3) float64 in [0, 1] (sRGB as authored) or None
    tri_v/vt/vn   (F, 3) int32
    tri_face      (F,) int32: polygon of the file that a triangle came from
    tri_material  (F,) int32: index into `materials`
    tri_group     (F,) int32: index into `groups`
    tri_smooth    (F,) int32: smoothing group, 0 = flat ("s off"); None where the file has no `s` line
    face_line     (P,) int32: 1-based line of each polygon in `path`
    """

    path: Path
    vertices: NDArray[np.float64]
    tri_v: NDArray[np.int32]
    tri_vt: NDArray[np.int32]
    tri_vn: NDArray[np.int32]
    tri_face: NDArray[np.int32]
    tri_material: NDArray[np.int32]
    tri_group: NDArray[np.int32]
    face_line: NDArray[np.int32]
    texcoords: NDArray[np.float64]
    normals: NDArray[np.float64]
    materials: tuple[Material, ...]
    groups: tuple[str, ...] = ("",)
    colors: NDArray[np.float64] | None = None
    tri_smooth: NDArray[np.int32] | None = None
    warnings: tuple[Diagnostic, ...] = field(default=())

    @property
    def has_texcoords(self) -> bool:
        """True where every corner has a texture coordinate."""
        return bool(len(self.tri_vt)) and bool((self.tri_vt >= 0).all())
