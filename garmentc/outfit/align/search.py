"""The search for unit, axes and origin where a file is not already as the body is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.axes import AXES, PER_METRE, Axes
from garmentc.outfit.align.fit import ClothSample, misfit
from garmentc.outfit.align.guess import Guess, axes_prior, cheapest, guess, in_body_axes
from garmentc.outfit.align.options import AlignOptions
from garmentc.outfit.align.origins import BODY, known_origins
from garmentc.outfit.align.skin import Skin
from garmentc.outfit.align.stance import Stance

SMALLEST, LARGEST = 0.05, 1.3
"""Longest side of an outfit as a part of the body's height: from a bracelet to a train."""

SEARCH_POINTS = 60
SLIDE = 0.12
"""Metres between the heights that are tried where no known origin fits."""


def search_axes(cloth: ClothSample, surface: Skin, options: AlignOptions) -> list[Guess]:
    """One rough guess for each unit and pair of axes that `options` allow, the best first.

    Each is tried with a few points of the cloth, the known origins and a slide along the body's height.
    Empty where no unit makes the outfit as large as a part of a body.
    """
    cloth = cloth.thinned(SEARCH_POINTS)
    known = known_origins(surface)
    moves, clouds = [], []
    possible = possible_axes(cloth, surface, options)
    for axes in possible:
        points = in_body_axes(cloth, axes).points
        moves.append(
            np.stack([*known.values(), *_slides(points, surface)] if options.origin == "auto" else [known[BODY]])
        )
        clouds.append(points + moves[-1][:, None])
    if not possible:
        return []
    scores = np.split(misfit(surface.distance(np.concatenate(clouds))), np.cumsum([len(m) for m in moves])[:-1])
    # The origin is only a place to start from here, so none costs more than another.
    rough = [
        cheapest([guess(cloth, axes, Stance(options.given_pose, BODY, *tried)) for tried in zip(m, score, strict=True)])
        for axes, m, score in zip(possible, moves, scores, strict=True)
    ]
    return sorted(rough, key=lambda candidate: candidate.cost)


def possible_axes(cloth: ClothSample, surface: Skin, options: AlignOptions) -> list[Axes]:
    """Units and axes that `options` leave open and that make the outfit as large as clothes are, the usual first."""
    height = float(np.ptp(surface.vertices[:, 1]))
    size = float(np.ptp(cloth.points, axis=0).max())
    units = [unit for unit, length in PER_METRE.items() if SMALLEST * height < size / length < LARGEST * height]
    return list_axes(units if options.units == "auto" else [options.units], options)


def list_axes(units: list[str], options: AlignOptions) -> list[Axes]:
    """`units` with all axes that `options` leave open, the usual axes first."""
    found = [
        Axes(unit, up, front)
        for unit in units
        for up in (AXES if options.up == "auto" else [options.up])
        for front in (AXES if options.front == "auto" else [options.front])
        if up[-1] != front[-1]
    ]
    return sorted(found, key=axes_prior)


def _slides(points: NDArray[np.float64], surface: Skin) -> list[NDArray[np.float64]]:
    """Translations that centre `points` on the body and try every height."""
    low, high = points.min(axis=0), points.max(axis=0)
    bottom, top = surface.vertices[:, 1].min() - low[1], surface.vertices[:, 1].max() - high[1]
    heights = np.linspace(bottom, top, int(np.clip(np.ceil(abs(top - bottom) / SLIDE), 1, 16)) + 1)
    x = surface.vertices[:, 0].mean() - (low[0] + high[0]) / 2
    z = surface.joints[:, 2].mean() - (low[2] + high[2]) / 2
    return [np.array([x, y, z]) for y in heights]
