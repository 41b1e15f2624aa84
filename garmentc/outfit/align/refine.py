"""The best guess for one body once unit and axes are known: T-pose or A-pose, origin known or fitted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from garmentc.outfit.align.fit import ClothSample, misfit
from garmentc.outfit.align.guess import Guess, cheapest, guess, in_body_axes, known_stances
from garmentc.outfit.align.options import AlignOptions
from garmentc.outfit.align.origins import BODY, FITTED, known_origins, origin_translation
from garmentc.outfit.align.pose import ALL_TURNS, TURNS, a_pose, largest_turn
from garmentc.outfit.align.skin import RestBody
from garmentc.outfit.align.stance import Stance, fit_stance, wrapped_turns

THIN = 3
"""Fits are made to every third vertex of the body."""

ARMS_DOWN = np.array([0.8 if name == "shoulder down" else 0.0 for name in TURNS])
"""A second start for the fit of A-poses, from which arms close to the sides are found."""

NEARLY_STRAIGHT = np.radians(1)
"""A fitted pose in which no limb turns further is the T-pose."""

NEARBY = 0.05
"""Metres between a fitted origin and a known one that it may stand for."""


def refined(cloth: ClothSample, body: RestBody, start: Guess, options: AlignOptions) -> Guess:
    """The best guess for `body` with the axes of `start`.

    The fits begin at the stance of `start`, which may have been found for another body.
    """
    there, thin = in_body_axes(cloth, start.axes), body.thinned(THIN)
    pose = options.given_pose
    origin = FITTED if options.origin == "auto" else BODY
    straight = fit_stance(there, thin, Stance(pose, origin, start.stance.translation))
    stances = [] if options.needs_pose else [straight, *known_stances(there, body.skin(pose), pose, options.origin)]
    if options.fits_pose:
        turned = _turned(there, thin, straight, start.stance)
        if options.needs_pose or largest_turn(turned.angles) > NEARLY_STRAIGHT:
            stances += [turned, *_with_known_origins(there, thin, turned)]
    return cheapest([guess(cloth, start.axes, _rescored(there, body, stance)) for stance in stances])


def sits_better_moved(cloth: ClothSample, body: RestBody, known: Guess, options: AlignOptions) -> bool:
    """True where the known origin of a guess is only near the true one, as the floor under soles is."""
    if options.origin != "auto" or known.stance.origin == BODY:
        return False
    there = in_body_axes(cloth, known.axes)
    moved = fit_stance(there, body.thinned(THIN), replace(known.stance, origin=FITTED))
    return guess(cloth, known.axes, _rescored(there, body, moved)).cost < known.cost


def arms_hang(cloth: ClothSample, body: RestBody, known: Guess, options: AlignOptions) -> bool:
    """True where the outfit of a guess without A-pose sits better on a body with its arms lowered, by a quick look."""
    if not options.fits_pose:
        return False
    thin = body.thinned(THIN)
    points = in_body_axes(cloth, known.axes).points + known.stance.translation
    poses = [a_pose(part * ARMS_DOWN) for part in (0.0, 0.4, 0.8)]
    straight, *lowered = (float(misfit(thin.skin(pose).distance(points))) for pose in poses)
    return min(lowered) < straight


def _turned(cloth: ClothSample, body: RestBody, straight: Stance, start: Stance) -> Stance:
    """The best fitted A-pose, from that of `start` if it has one. Limbs that the cloth doesn't wrap stay straight."""
    starts = [start.angles] if start.angles.any() else [start.angles, ARMS_DOWN]
    fits = [
        fit_stance(cloth, body, replace(straight, pose=a_pose(angles), angles=angles), ALL_TURNS) for angles in starts
    ]
    best = min(fits, key=lambda stance: stance.misfit)
    told = wrapped_turns(cloth, body, best)
    if told.all():
        return best
    angles = np.where(told, best.angles, 0.0)
    return fit_stance(cloth, body, replace(best, pose=a_pose(angles), angles=angles), told)


def _with_known_origins(cloth: ClothSample, body: RestBody, fitted: Stance) -> list[Stance]:
    """`fitted` again with the known origins that are close to its own."""
    if fitted.origin != FITTED:
        return []
    near = [
        name
        for name, translation in known_origins(body.skin(fitted.pose)).items()
        if np.linalg.norm(translation - fitted.translation) < NEARBY
    ]
    return [fit_stance(cloth, body, replace(fitted, origin=name), fitted.angles != 0) for name in near]


def _rescored(cloth: ClothSample, body: RestBody, stance: Stance) -> Stance:
    """`stance` as it is on the whole body.

    What was fitted is rounded, to 0.1 mm and 0.1 mrad, so that the last bits of the fit don't show in the output.
    """
    if stance.angles.any():
        angles = np.round(stance.angles, 4)
        stance = replace(stance, pose=a_pose(angles), angles=angles)
    surface = body.skin(stance.pose)
    fitted = stance.origin == FITTED
    translation = np.round(stance.translation, 4) if fitted else origin_translation(stance.origin, surface)
    score = misfit(surface.distance(cloth.points + translation))
    return replace(stance, translation=translation, misfit=float(score))
