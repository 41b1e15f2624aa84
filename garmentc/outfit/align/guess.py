"""Guesses at how a file is meant, and what each costs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.align.axes import PER_METRE, Axes, Frame
from garmentc.outfit.align.fit import ClothSample, misfit
from garmentc.outfit.align.origins import BODY, FITTED, known_origins
from garmentc.outfit.align.pose import largest_turn
from garmentc.outfit.align.skin import Skin
from garmentc.outfit.align.stance import Stance

USUAL_FRONT = {"y": "z", "z": "-y"}
"""Where characters look: +Z in Y-up tools (Maya, glTF), -Y in Z-up tools (Blender, 3ds Max)."""

UNIT_PRIOR = {"m": 1.0, "cm": 1.0, "mm": 1.02, "dm": 1.05, "in": 1.1, "ft": 1.1}
TURNED_ABOUT_PRIOR, SIDEWAYS_PRIOR, ODD_UP_PRIOR = 1.15, 1.3, 1.5
OTHER_ORIGIN_PRIOR, FITTED_PRIOR = 1.03, 1.3
A_POSE_PRIOR, SLIGHT_TURN_PRIOR = 1.05, 1.5
"""Priors: how many times better than usual guesses the unusual ones must fit."""

SLIGHT_TURN = np.radians(10)
"""Limbs turned less are more often cloth cut for another body than an A-pose."""


@dataclass(frozen=True)
class Guess:
    """Unit and axes, and how the body then stands.

    prior  how much better it must fit than usual guesses, a factor
    cost   the misfit relative to the outfit's size, times the prior
    """

    axes: Axes
    stance: Stance
    prior: float
    cost: float

    @property
    def frame(self) -> Frame:
        x, y, z = (float(value) for value in self.stance.translation)
        return Frame(self.axes.unit, self.axes.up, self.axes.front, self.stance.origin, (x, y, z))


def guess(cloth: ClothSample, axes: Axes, stance: Stance) -> Guess:
    """A guess with its cost; `cloth` is in file coordinates."""
    prior = UNIT_PRIOR[axes.unit] * axes_prior(axes)
    if stance.origin != BODY:
        prior *= FITTED_PRIOR if stance.origin == FITTED else OTHER_ORIGIN_PRIOR
    if stance.angles.any():
        prior *= SLIGHT_TURN_PRIOR if largest_turn(stance.angles) < SLIGHT_TURN else A_POSE_PRIOR
    size = max(cloth.radius / PER_METRE[axes.unit], 1e-300)
    return Guess(axes, stance, prior, prior * stance.misfit / size)


def axes_prior(axes: Axes) -> float:
    """1 for the usual axes, more for others."""
    if axes.up not in USUAL_FRONT:
        return ODD_UP_PRIOR
    if axes.front == USUAL_FRONT[axes.up]:
        return 1.0
    return TURNED_ABOUT_PRIOR if axes.front[-1] == USUAL_FRONT[axes.up][-1] else SIDEWAYS_PRIOR


def cheapest(guesses: list[Guess]) -> Guess:
    """The guess that costs least; the first of equal ones."""
    return min(guesses, key=lambda candidate: candidate.cost)


def in_body_axes(cloth: ClothSample, axes: Axes) -> ClothSample:
    """`cloth` in metres and the body's axes."""
    return ClothSample(axes.metres(cloth.points), axes.rotated(cloth.normals))


def known_stances(
    cloth: ClothSample, surface: Skin, pose: NDArray[np.float64] | None, origin: str = "auto"
) -> list[Stance]:
    """The stances with a known origin that `origin` allows ("auto": all, "keep": the body's own), scored.

    `cloth` is in body axes; `surface` is the body's skin in `pose`.
    """
    known = known_origins(surface)
    names = list(known) if origin == "auto" else [BODY]
    scores = misfit(surface.distance(cloth.points + np.stack([known[name] for name in names])[:, None]))
    return [Stance(pose, name, known[name], float(score)) for name, score in zip(names, scores, strict=True)]
