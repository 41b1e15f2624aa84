"""Sewing patterns as functions: a garment is the part of an implicit solid's surface where a cut function is positive.

Each maker takes a body at rest and a garment's parameters and returns a `Pattern`. The solid is the body offset by the
clearance, joined with lofts where cloth hangs free; the cut function is the smallest of the distances to all hems.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from garmentc.simulation.body_field import Array, Field, Loft, RestBody, smooth_union
from garmentc.simulation.cuts import CUTS
from garmentc.simulation.draping import LOFTS
from garmentc.simulation.outfit_parameters import GarmentParameters

Solid = Callable[[Array, Array], Array]

_FILLET = 0.008
_SLIT = 0.0015


@dataclass(frozen=True)
class Pattern:
    """A garment on one body.

    solid   points (P, 3) and their distances to the body (P,) to a field (P,), negative inside the cloth's solid
    keep    points (P, 3) to (P,), positive where there is cloth
    bounds  (2, 3) box of the cloth with a margin beyond its hems
    split   height below which the left and the right leg are apart, or None
    """

    name: str
    solid: Solid
    keep: Field
    bounds: Array
    split: float | None = None


def make_pattern(body: RestBody, garment: GarmentParameters) -> Pattern:
    """The pattern of one garment on one body."""
    lofts = LOFTS[garment.kind](body, garment) if garment.kind in LOFTS else []
    keep = keep_function(body, garment)
    wrinkle = _wrinkles(garment)
    split = body.crotch if garment.kind in ("trousers", "jumpsuit") else None

    def solid(points: Array, distance: Array) -> Array:
        wrinkled = wrinkle(points)
        value = distance - garment.clearance - wrinkled
        for tube in lofts:
            value = smooth_union(value, tube.field(points) - _fold(garment, points) - wrinkled, _FILLET)
        if split is not None:
            # The legs stay two tubes however wide they are: a slit on the mid-plane below the crotch.
            value = np.maximum(value, np.where(points[:, 1] < split, _SLIT - np.abs(points[:, 0]), -1.0))
        return value

    return Pattern(garment.kind, solid, keep, _bounds(body, garment, keep, lofts), split)


def keep_function(body: RestBody, garment: GarmentParameters) -> Field:
    """The smallest of the garment's cut functions."""
    cuts = CUTS[garment.kind](body, garment)

    def keep(points: Array) -> Array:
        return np.asarray(np.minimum.reduce([cut(points) for cut in cuts]))

    return keep


def _bounds(body: RestBody, garment: GarmentParameters, keep: Field, lofts: list[Loft]) -> Array:
    """Box (2, 3) that holds the kept surface and a margin beyond its hems."""
    vertices = body.vertices[keep(body.vertices) > -0.03]
    if not len(vertices):
        raise ValueError(f"a garment ({garment.kind}) has no surface; its hems leave nothing")
    reach = garment.clearance + garment.roughness + 0.02
    low, high = vertices.min(0) - reach, vertices.max(0) + reach
    for tube in lofts:
        inside = tube.centres[keep(tube.centres) > -0.05]
        if len(inside):
            reach = float(tube.support.max()) + garment.fold_depth + 0.02
            across = [k for k in range(3) if k != tube.along]
            low[across] = np.minimum(low[across], inside[:, across].min(0) - reach)
            high[across] = np.maximum(high[across], inside[:, across].max(0) + reach)
    return np.stack([low, high])


def _wrinkles(garment: GarmentParameters) -> Field:
    """A smooth random variation of the clearance, metres, at least -roughness / 2 and at most roughness."""
    rng = np.random.default_rng(garment.seed)
    waves = rng.normal(size=(8, 3))
    waves *= (2 * np.pi / rng.uniform(0.07, 0.25, 8) / np.linalg.norm(waves, axis=1))[:, None]
    phase = rng.uniform(0, 2 * np.pi, 8)

    def wrinkle(points: Array) -> Array:
        if garment.roughness == 0:
            return np.zeros(len(points))
        wave = np.sin(points @ waves.T + phase).mean(1)
        return np.asarray(garment.roughness * np.clip(1.5 * wave, -0.5, 1.0))

    return wrinkle


def _fold(garment: GarmentParameters, points: Array) -> Array:
    """Folds of a skirt that deepen towards the hem, metres."""
    if garment.fold_depth == 0:
        return np.zeros(len(points))
    rng = np.random.default_rng(garment.seed + 1)
    angle = np.arctan2(points[:, 0], points[:, 2])
    depth = np.clip(-points[:, 1] / 0.6, 0, 1)
    twist = rng.uniform(-1, 1) * points[:, 1]
    wave = np.cos(garment.fold_count * (angle + twist) + rng.uniform(0, 6.28) + 0.7 * np.sin(2 * angle))
    return np.asarray(garment.fold_depth * depth * (wave - 0.2))
