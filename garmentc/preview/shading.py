"""Colours of fragments: glTF's metallic-roughness model under the sky and the lamp."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.preview.light import AMBIENT, LAMP, Lamp
from garmentc.preview.raster import Fragments
from garmentc.preview.surface import Surface
from garmentc.preview.texture import Texture

_DIELECTRIC = 0.04
"""Reflectance of cloth, leather and skin seen straight on."""


def texture_footprint(surface: Surface, scale: float) -> NDArray[np.float64]:
    """(F,) area of texture coordinates that a pixel covers on each triangle that faces the camera.

    scale  pixels per metre
    """
    if surface.texcoords is None:
        return np.zeros(len(surface.triangles))
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    u, v, w = (surface.texcoords[surface.triangles[:, k]].astype(np.float64) for k in range(3))
    (x, y), (z, t) = (v - u).T, (w - u).T
    footprint: NDArray[np.float64] = np.abs(x * t - y * z) / np.maximum(area, 1e-12) / scale**2
    return footprint


def shade(
    surface: Surface,
    fragments: Fragments,
    footprint: NDArray[np.float64],
    sky: NDArray[np.float32],
    lamp: Lamp,
    away: NDArray[np.float64],
) -> NDArray[np.float32]:
    """Linear colours (P, 3) of fragments of one surface; their triangles count within it.

    footprint  (F,) as from `texture_footprint`
    sky        (V, 2) as from `sky_light`
    away       (3,) the direction of view
    """
    material = surface.material
    normal, points = (
        fragments.interpolate(values, surface.triangles) for values in (surface.normals, surface.positions)
    )
    ambient = fragments.interpolate(sky, surface.triangles)
    normal = _unit(normal)
    behind = normal @ away > 0
    light = np.where(behind, ambient[:, 1], ambient[:, 0])[:, None]

    uv = None if surface.texcoords is None else fragments.interpolate(surface.texcoords, surface.triangles)
    size = footprint[fragments.triangle]

    def sampled(texture: Texture | None) -> NDArray[np.float32] | None:
        return None if texture is None or uv is None else texture.sample(uv, size)

    base = np.broadcast_to(_row(material.base_color[:3]), points.shape)
    painted = sampled(material.base_color_texture)
    if painted is not None:
        base = base * painted[:, :3]
    if surface.colors is not None:
        base = fragments.interpolate(surface.colors, surface.triangles)
    bumps = sampled(material.normal_texture)
    detailed = normal.copy()
    if bumps is not None:
        detailed = bumped(surface, fragments, normal, bumps[:, :3], material.normal_scale)
    for rows in (normal, detailed):
        rows[behind] *= -1  # the back of cloth is lit like a front (glTF 2.0, doubleSided)
    metallic, roughness = _row([material.metallic]), _row([material.roughness])
    surface_maps = sampled(material.metallic_roughness_texture)
    if surface_maps is not None:
        metallic, roughness = metallic * surface_maps[:, 2:3], roughness * surface_maps[:, 1:2]

    diffuse = base * (1 - metallic)
    reflectance = _DIELECTRIC * _row(material.specular) * (1 - metallic) + base * metallic
    facing = np.maximum(detailed @ lamp.direction, 0)[:, None].astype(np.float32)
    lit = np.flatnonzero(facing[:, 0] > 0)
    reaching = np.zeros_like(facing)
    reaching[lit, 0] = lamp.reaches(points[lit], normal[lit])
    direct = LAMP * facing * reaching
    gloss = _specular(detailed, lamp.direction, -away, reflectance, roughness)
    # Of the sky's mirror image only its brightness is left: right for cloth, dull for polished metal.
    color = (diffuse + 0.6 * reflectance) * AMBIENT * light + (diffuse + gloss) * direct
    glow = sampled(material.emissive_texture)
    emissive = _row(material.emissive) * (1 if glow is None else glow[:, :3])
    return np.asarray(color + emissive, dtype=np.float32)


def opaque(surface: Surface, fragments: Fragments, footprint: NDArray[np.float64], width: int) -> NDArray[np.bool_]:
    """Which fragments (P,) of one surface alpha leaves over. "BLEND" becomes a dither, which supersampling smooths."""
    material = surface.material
    alpha = np.full(len(fragments.pixel), material.base_color[3], dtype=np.float32)
    if material.base_color_texture is not None and surface.texcoords is not None:
        uv = fragments.interpolate(surface.texcoords, surface.triangles)
        alpha *= material.base_color_texture.sample(uv, footprint[fragments.triangle])[:, 3]
    if material.alpha_mode == "MASK":
        return np.asarray(alpha >= material.cutoff)
    row, column = np.divmod(fragments.pixel, width)
    rank = (column % 3) + 3 * (row % 3)
    return np.asarray(alpha > (np.array([0, 5, 2, 7, 4, 8, 3, 6, 1])[rank] + 0.5) / 9)


def bumped(
    surface: Surface, fragments: Fragments, normal: NDArray[Any], bumps: NDArray[np.float32], scale: float
) -> NDArray[np.float32]:
    """Normals (P, 3) bent by a normal map; tangents from the texture coordinates of each triangle.

    bumps  (P, 3) the map's colours
    scale  of the map's x and y
    """
    assert surface.texcoords is not None
    a, b, c = (surface.positions[surface.triangles[:, k]] for k in range(3))
    u, v, w = (surface.texcoords[surface.triangles[:, k]].astype(np.float64) for k in range(3))
    (x, y), (z, t) = (v - u).T, (w - u).T
    turned = np.sign(x * t - y * z)[:, None]
    along_u = (turned * ((b - a) * t[:, None] - (c - a) * y[:, None]))[fragments.triangle]
    tangent = _unit(along_u - normal * np.einsum("pk,pk->p", along_u, normal)[:, None])
    # glTF's texture coordinates point down the image, its normal maps up.
    bitangent = -turned[fragments.triangle] * np.cross(normal, tangent)
    bend = (2 * bumps - 1) * _row([scale, scale, 1.0])
    return _unit(bend[:, :1] * tangent + bend[:, 1:2] * bitangent + bend[:, 2:] * normal)


def _specular(
    normal: NDArray[Any], light: NDArray[Any], eye: NDArray[Any], reflectance: NDArray[Any], roughness: Any
) -> NDArray[np.float32]:
    """GGX with Smith's shadowing and Schlick's Fresnel (glTF 2.0 appendix B); pi is in the lamp's brightness."""
    half = (light + eye) / np.linalg.norm(light + eye)
    alpha = np.maximum(roughness, 0.05) ** 2
    square = alpha**2
    across, above = np.maximum(normal @ half, 0)[:, None], np.maximum(normal @ light, 0)[:, None]
    seen = np.maximum(normal @ eye, 1e-3)[:, None]
    spread = square / np.maximum((across**2 * (square - 1) + 1) ** 2, 1e-6)
    masked = 0.5 / np.maximum(
        above * np.sqrt(seen**2 * (1 - square) + square) + seen * np.sqrt(above**2 * (1 - square) + square), 1e-6
    )
    fresnel = reflectance + (1 - reflectance) * (1 - max(float(eye @ half), 0.0)) ** 5
    return np.asarray(spread * masked * fresnel, dtype=np.float32)


def _row(values: Sequence[float]) -> NDArray[np.float32]:
    return np.array(values, dtype=np.float32)


def _unit(rows: NDArray[Any]) -> NDArray[np.float32]:
    length = np.sqrt(np.einsum("pk,pk->p", rows, rows))[:, None]
    return np.asarray(rows / np.maximum(length, 1e-12), dtype=np.float32)
