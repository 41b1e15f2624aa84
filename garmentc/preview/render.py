"""A picture of a scene."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from garmentc.preview.camera import Camera
from garmentc.preview.light import Lamp, lamp, sky_light
from garmentc.preview.raster import Fragments, visible
from garmentc.preview.shading import opaque, shade, texture_footprint
from garmentc.preview.surface import Scene
from garmentc.preview.texture import linear_to_srgb, srgb_to_linear

SAMPLES = 3
"""Samples of a pixel, across and down."""

BACKGROUND = (0.925, 0.93, 0.935)
"""sRGB."""

_LAMP_DIRECTION = np.array([-0.5, -1.2, -0.7])
"""Towards the lamp, in the view's axes (right, down, away): above the left shoulder of who looks."""

_FLOOR_CLEAR, _FLOOR_REACH = 0.25, 1.0
"""Metres from the middle of the scene up to which shadows on the floor are full, and where they end."""

_FLOOR_CELLS = 40


@dataclass(frozen=True)
class LitScene:
    """A scene with the light of its surroundings, which all views of it share.

    sky    (V, 2) of its vertices
    floor  points (K, 3), triangles (L, 3) and light (K, 2) of the floor, or None
    """

    scene: Scene
    sky: NDArray[np.float32]
    floor: tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float32]] | None


def light_scene(scene: Scene) -> LitScene:
    """Compute the ambient light of a scene."""
    points, triangles = _floor(scene)
    up = np.broadcast_to([0.0, 1.0, 0.0], points.shape)
    sky = sky_light(
        scene.positions,
        scene.casters,
        np.concatenate([scene.positions, points]),
        np.concatenate([scene.normals, up]),
    )
    count = len(scene.positions)
    return LitScene(scene, sky[:count], (points, triangles, sky[count:]) if len(points) else None)


def render(lit: LitScene, camera: Camera) -> NDArray[np.uint8]:
    """The picture (height, width, 3), sRGB."""
    scene = lit.scene
    fine = replace(camera, scale=camera.scale * SAMPLES, size=(camera.size[0] * SAMPLES, camera.size[1] * SAMPLES))
    shining = lamp(scene.positions, scene.casters, _LAMP_DIRECTION @ camera.axes)
    floor = srgb_to_linear(np.array(BACKGROUND)).astype(np.float32) * _floor_light(lit, camera, shining)[:, :, None]
    picture = np.repeat(np.repeat(floor, SAMPLES, axis=0), SAMPLES, axis=1).reshape(-1, 3)
    _draw_surfaces(lit, fine, shining, picture)
    pixels = picture.reshape(camera.size[1], SAMPLES, camera.size[0], SAMPLES, 3).mean(axis=(1, 3))
    return np.asarray(np.round(np.clip(linear_to_srgb(pixels), 0, 1) * 255), dtype=np.uint8)


def _draw_surfaces(lit: LitScene, camera: Camera, shining: Lamp, picture: NDArray[np.float32]) -> None:
    scene = lit.scene
    points = camera.project(scene.positions)
    points[:, 2] += scene.behind
    footprints = [texture_footprint(surface, camera.scale) for surface in scene.surfaces]
    first = np.cumsum([0, *(len(surface.triangles) for surface in scene.surfaces)])

    def within(fragments: Fragments, number: int) -> Fragments:
        return replace(fragments, triangle=fragments.triangle - first[number])

    def kept(fragments: Fragments) -> NDArray[np.bool_]:
        result = np.ones(len(fragments.pixel), dtype=bool)
        for number, surface in enumerate(scene.surfaces):
            if surface.material.is_cut_out:
                here = np.flatnonzero(scene.owner[fragments.triangle] == number)
                result[here] = opaque(surface, within(fragments[here], number), footprints[number], camera.size[0])
        return result

    cuts = any(surface.material.is_cut_out for surface in scene.surfaces)
    shown = visible(points, scene.triangles, camera.size, kept if cuts else None)
    owner = scene.owner[shown.triangle]
    for number, surface in enumerate(scene.surfaces):
        part = shown[owner == number]
        sky = lit.sky[scene.starts[number] : scene.starts[number + 1]]
        away = camera.axes[2]
        color = shade(surface, within(part, number), footprints[number], sky, shining, away)
        picture[part.pixel] = _neutral(color)


def _floor_light(lit: LitScene, camera: Camera, shining: Lamp) -> NDArray[np.float32]:
    """(height, width): how bright the floor is, 1 where nothing shades it.

    The floor is the background darkened by shadows that fade with distance, so that it has no edge.
    """
    light = np.ones(camera.size[0] * camera.size[1], dtype=np.float32)
    if lit.floor is not None:
        points, triangles, sky = lit.floor
        shown = visible(camera.project(points), triangles, camera.size)
        places = shown.interpolate(points, triangles)
        up = np.broadcast_to(np.array([0, 1, 0], np.float32), places.shape)
        ambient = np.minimum(shown.interpolate(sky, triangles)[:, 0], 1.0)
        distance = np.hypot(*(places - points.mean(axis=0))[:, ::2].T)
        strength = np.clip((_FLOOR_REACH - distance) / (_FLOOR_REACH - _FLOOR_CLEAR), 0, 1)
        strength = strength**2 * (3 - 2 * strength)
        light[shown.pixel] -= strength * (1 - 0.7 * ambient - 0.3 * shining.reaches(places, up))
    return light.reshape(camera.size[::-1])


def _floor(scene: Scene) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A grid of points (K, 3) around the scene's middle, and its triangles (L, 3)."""
    if scene.floor is None or not len(scene.positions):
        return np.zeros((0, 3)), np.zeros((0, 3), np.int64)
    middle = (scene.positions.min(axis=0) + scene.positions.max(axis=0)) / 2
    steps = np.linspace(-_FLOOR_REACH, _FLOOR_REACH, _FLOOR_CELLS + 1)
    x, z = np.meshgrid(steps + middle[0], steps + middle[2], indexing="ij")
    points = np.stack([x.ravel(), np.full(x.size, scene.floor), z.ravel()], axis=1)
    corner = (np.arange(_FLOOR_CELLS)[:, None] * (_FLOOR_CELLS + 1) + np.arange(_FLOOR_CELLS)).ravel()
    far = corner + _FLOOR_CELLS + 1
    triangles = [np.stack([corner, corner + 1, far], axis=1), np.stack([corner + 1, far + 1, far], axis=1)]
    return points, np.concatenate(triangles)


def _neutral(color: NDArray[np.float32]) -> NDArray[np.float32]:
    """Khronos PBR Neutral tone mapping: base colours come through unchanged, only highlights are compressed."""
    start, desaturation = 0.8 - 0.04, 0.15
    low = color.min(axis=-1, keepdims=True)
    color = color - np.where(low < 0.08, low - 6.25 * low**2, 0.04)
    peak = np.maximum(color.max(axis=-1, keepdims=True), 1e-6)
    width = 1 - start
    new_peak = 1 - width**2 / (np.maximum(peak, start) + width - start)
    share = 1 - 1 / (desaturation * (np.maximum(peak, start) - new_peak) + 1)
    compressed = color * new_peak / peak * (1 - share) + new_peak * share
    mapped: NDArray[np.float32] = np.where(peak < start, color, compressed)
    return mapped
