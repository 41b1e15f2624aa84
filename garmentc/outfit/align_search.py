"""The search for units, axes and origin where a file is not already as the body is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align_axes import PER_METRE, Frame, axes_prior, axis_pairs
from garmentc.outfit.align_fit import ClothSample, Skin, misfit
from garmentc.outfit.align_options import AlignOptions
from garmentc.outfit.align_origin import BODY, FITTED, known_origins
from garmentc.outfit.align_pose import Stance, largest_turn

SMALLEST, LARGEST = 0.05, 1.3
"""Longest side of an outfit as a part of the body's height: from a bracelet to a train."""

UNIT_PRIOR = {"m": 1.0, "cm": 1.0, "mm": 1.02, "dm": 1.05, "in": 1.1, "ft": 1.1}
FITTED_PRIOR = 1.3
KNOWN_PRIOR = {BODY: 1.0}
OTHER_KNOWN_PRIOR = 1.03
A_POSE_PRIOR, SLIGHT_TURN_PRIOR = 1.05, 1.5
"""Priors: factors by which an unusual guess must fit better than a usual one."""

SLIGHT_TURN = np.radians(10)

SEARCH_POINTS = 60
SLIDE = 0.12
"""Metres between the heights that are tried where no known origin fits."""


@dataclass(frozen=True)
class Guess:
    """A frame with how the body stands in it. `cost` is the misfit as a part of the outfit's size, times priors."""

    unit: str
    up: str
    front: str
    stance: Stance
    cost: float

    @property
    def frame(self) -> Frame:
        x, y, z = (float(value) for value in self.stance.translation)
        return Frame(self.unit, self.up, self.front, self.stance.origin, (x, y, z))


def turned_cloth(cloth: ClothSample, unit: str, up: str, front: str) -> ClothSample:
    """`cloth` in metres and the body's axes."""
    frame = Frame(unit, up, front)
    return ClothSample(frame.apply(cloth.points), frame.rotated(cloth.normals))


def guess(cloth: ClothSample, unit: str, up: str, front: str, stance: Stance) -> Guess:
    """A guess with its cost; `cloth` is in file coordinates."""
    prior = UNIT_PRIOR[unit] * axes_prior(up, front)
    prior *= FITTED_PRIOR if stance.origin == FITTED else KNOWN_PRIOR.get(stance.origin, OTHER_KNOWN_PRIOR)
    if stance.angles.any():
        prior *= SLIGHT_TURN_PRIOR if largest_turn(stance.angles) < SLIGHT_TURN else A_POSE_PRIOR
    return Guess(unit, up, front, stance, prior * stance.misfit * PER_METRE[unit] / max(cloth.radius, 1e-300))


def known_stances(
    cloth: ClothSample, surface: Skin, pose: NDArray[np.float64] | None, origin: str = "auto"
) -> list[Stance]:
    """The stances with a known origin that `origin` allows ("auto": all, "keep": the body's own), scored."""
    known = known_origins(surface)
    names = list(known) if origin == "auto" else [BODY]
    scores = misfit(surface.distance(cloth.points + np.stack([known[name] for name in names])[:, None]))
    return [Stance(pose, name, known[name], float(score)) for name, score in zip(names, scores, strict=True)]


def search_frames(cloth: ClothSample, surface: Skin, options: AlignOptions) -> list[Guess]:
    """One rough guess for each unit and axis pair that `options` allow, the best first.

    Each is tried with a few points of the cloth, the known origins and a slide along the body's height.
    Empty where no unit makes the outfit as large as a part of a body.
    """
    cloth = cloth.thinned(SEARCH_POINTS)
    known = known_origins(surface)
    height = float(np.ptp(surface.vertices[:, 1]))
    ways, clouds = [], []
    for unit, length in PER_METRE.items():
        size = np.ptp(cloth.points, axis=0).max() / length
        if options.units != unit and not (options.units == "auto" and SMALLEST * height < size < LARGEST * height):
            continue
        for pair in axis_pairs(options.up, options.front):
            points = turned_cloth(cloth, unit, *pair).points
            moves = [(name, move) for name, move in known.items() if options.origin == "auto" or name == BODY]
            if options.origin == "auto":
                moves += [(FITTED, move) for move in _slides(points, surface)]
            ways += [(unit, *pair, name, move) for name, move in moves]
            clouds += [points + move for _, move in moves]
    if not ways:
        return []
    best: dict[tuple[str, str, str], Guess] = {}
    for (unit, u, f, _, move), score in zip(ways, misfit(surface.distance(np.stack(clouds))), strict=True):
        # Here the origin is only a place to start from, so it brings no prior.
        candidate = guess(cloth, unit, u, f, Stance(options.given_pose, BODY, move, float(score)))
        if (unit, u, f) not in best or candidate.cost < best[unit, u, f].cost:
            best[unit, u, f] = candidate
    return sorted(best.values(), key=lambda candidate: candidate.cost)


def _slides(points: NDArray[np.float64], surface: Skin) -> list[NDArray[np.float64]]:
    """Translations that centre `points` on the body and try every height."""
    low, high = points.min(axis=0), points.max(axis=0)
    bottom, top = surface.vertices[:, 1].min() - low[1], surface.vertices[:, 1].max() - high[1]
    heights = np.linspace(bottom, top, int(np.clip(np.ceil(abs(top - bottom) / SLIDE), 1, 16)) + 1)
    x = surface.vertices[:, 0].mean() - (low[0] + high[0]) / 2
    z = surface.joints[:, 2].mean() - (low[2] + high[2]) / 2
    return [np.array([x, y, z]) for y in heights]
