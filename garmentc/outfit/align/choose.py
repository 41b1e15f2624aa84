"""The choice among guesses: as the file is, if it fits so; otherwise searched and fitted, on every body."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic
from garmentc.outfit.align.axes import AS_BODY, Axes
from garmentc.outfit.align.fit import ClothSample, misfit, unevenness
from garmentc.outfit.align.guess import Guess, axes_prior, cheapest, guess, in_body_axes, known_stances
from garmentc.outfit.align.options import AlignOptions
from garmentc.outfit.align.origins import BODY
from garmentc.outfit.align.refine import THIN, arms_hang, refined, sits_better_moved
from garmentc.outfit.align.search import list_axes, search_axes
from garmentc.outfit.align.skin import RestBody

UNCERTAIN = 1.15
"""Guesses whose costs differ by less than this factor are reported as ambiguous."""

CLOSE = 0.03
"""Metres: cloth farther than this from every body tells nothing about gender."""

FEW_POINTS, LARGEST_GAP = 8, np.radians(100)
"""A band has so many points close to the skin, in all directions, with no larger angle between them."""

NEUTRAL = 1.05
"""The neutral body is taken where no other fits better by more than this factor."""

FINALISTS, HOPELESS = 4, 3.0
"""So many axes are looked at closely, if they cost at most so many times as much as the best."""

Bodies = Mapping[str, RestBody]
"""By gender."""

Guesses = dict[str, Guess]
"""By the gender of the body that each was made for."""


def choose_guesses(cloth: ClothSample, bodies: Bodies, options: AlignOptions) -> tuple[Guesses, tuple[Diagnostic, ...]]:
    """The best guess for each of `bodies`, and what was doubtful about unit and axes.

    Cloth that hugs a body in the file's own coordinates needs no search: the common case, and the quick one.
    Cloth that is worn, but loosely or in another pose, keeps unit and axes. For anything else all are tried, first
    with the origins that files usually have, then with origin and pose fitted.
    """
    if AS_BODY in list_axes(["m"], options) and options.units in ("auto", "m"):
        as_is = _unfitted(cloth, bodies, AS_BODY, options, "keep")
        if _hugs(cloth, bodies, as_is, options):
            return as_is, ()
        if _is_worn(cloth, bodies, as_is) and not _fits_turned_about(cloth, bodies, as_is, options):
            gender = _best(as_is)
            fitted = refined(cloth, bodies[gender], as_is[gender], options)
            if fitted.stance.origin == BODY and not fitted.stance.angles.any():
                return as_is, ()
            return {name: refined(cloth, body, fitted, options) for name, body in bodies.items()}, ()

    reference = bodies.get("neutral", next(iter(bodies.values())))
    rough = search_axes(cloth, reference.thinned(THIN).skin(options.given_pose), options)
    if not rough:
        return _nothing_found(cloth, bodies, options)
    rough = [start for start in rough[:FINALISTS] if start.cost < HOPELESS * rough[0].cost]
    unfitted = [_unfitted(cloth, bodies, start.axes, options, options.origin) for start in rough]
    unfitted.sort(key=lambda guesses: guesses[_best(guesses)].cost)
    found = [guesses[_best(guesses)] for guesses in unfitted]
    if _is_settled(cloth, bodies, unfitted[0], options):
        return unfitted[0], _doubts(found)
    # One body will do to tell the axes apart, unless the outfit sits on another without any fitting.
    found += [refined(cloth, reference, start, options) for start in rough]
    found = [cheapest([other for other in found if other.axes == start.axes]) for start in rough]
    found.sort(key=lambda candidate: candidate.cost)
    return {name: refined(cloth, body, found[0], options) for name, body in bodies.items()}, _doubts(found)


def gender_misfits(guesses: Guesses, cloth: ClothSample, bodies: Bodies) -> dict[str, float]:
    """By gender, metres: how badly the cloth that is close to any of the bodies sits on each, times its guess's prior.

    The hem of a skirt says nothing about who wears it, and there is more of it than of the waistband. Nor does a small
    gap everywhere: another body may be held in the cloth as closely, but not as evenly.
    """
    distances = np.stack([_distance(cloth, bodies[gender], guesses[gender]) for gender in guesses])
    close = np.abs(distances).min(axis=0) < CLOSE
    told = distances[:, close] if close.any() else distances
    scores = misfit(told) + unevenness(told)
    return {gender: guesses[gender].prior * float(score) for gender, score in zip(guesses, scores, strict=True)}


def choose_gender(misfits: Mapping[str, float]) -> tuple[str, tuple[Diagnostic, ...]]:
    """The gender that fits best, neutral where that is as good; and a warning where another fits nearly as well."""
    best = min(misfits, key=lambda gender: misfits[gender] / (NEUTRAL if gender == "neutral" else 1))
    close = [gender for gender in misfits if gender != best and misfits[gender] < UNCERTAIN * misfits[best]]
    if not close:
        return best, ()
    scores = ", ".join(f"{gender} {misfits[gender] * 1000:.1f} mm" for gender in (best, *close))
    message = f"fitted to the {best} body, but the bodies differ little here ({scores}); choose one with --gender"
    return best, (Diagnostic("gender-ambiguous", message),)


def _best(guesses: Mapping[str, Guess]) -> str:
    return min(guesses, key=lambda gender: guesses[gender].cost)


def _unfitted(cloth: ClothSample, bodies: Bodies, axes: Axes, options: AlignOptions, origin: str) -> Guesses:
    """For each body the best guess with these axes, a known origin and the pose not fitted."""
    there, pose = in_body_axes(cloth, axes), options.given_pose
    return {
        gender: cheapest([guess(cloth, axes, stance) for stance in known_stances(there, body.skin(pose), pose, origin)])
        for gender, body in bodies.items()
    }


def _distance(cloth: ClothSample, body: RestBody, chosen: Guess) -> NDArray[np.float64]:
    """Signed distances (S,) of the cloth to the body where the guess puts it."""
    points = in_body_axes(cloth, chosen.axes).points + chosen.stance.translation
    return body.skin(chosen.stance.pose).distance(points)


def _hugs(cloth: ClothSample, bodies: Bodies, guesses: Guesses, options: AlignOptions) -> bool:
    """True for cloth that can't be meant otherwise: close to the skin nearly everywhere."""
    gender = _best(guesses)
    distance = _distance(cloth, bodies[gender], guesses[gender])
    inside, gap = (distance < -0.01).mean(), np.abs(distance)
    if options.needs_pose or inside > 0.005 or np.median(gap) > 0.04 or np.percentile(gap, 97) > 0.08:
        return False
    return not arms_hang(cloth, bodies[gender], guesses[gender], options)


def _is_worn(cloth: ClothSample, bodies: Bodies, guesses: Guesses) -> bool:
    """True for cloth that is worn, but in another pose (much is near) or loosely (a band of it lies round the body)."""
    gender = _best(guesses)
    distance = _distance(cloth, bodies[gender], guesses[gender])
    inside, gap = (distance < -0.01).mean(), np.abs(distance)
    if inside < 0.1 and np.median(gap) < 0.05:
        return True
    surface = bodies[gender].skin(guesses[gender].stance.pose)
    band = surface.normals[surface.nearest(cloth.points[gap < CLOSE])]
    directions = np.sort(np.arctan2(band[:, 0], band[:, 2]))
    return bool(inside < 0.005 and len(band) >= FEW_POINTS and _largest_gap(directions) < LARGEST_GAP)


def _largest_gap(directions: NDArray[np.float64]) -> float:
    """The largest angle between neighbours of sorted `directions`, radians."""
    return float(np.diff(directions, append=directions[0] + 2 * np.pi).max())


def _fits_turned_about(cloth: ClothSample, bodies: Bodies, as_is: Guesses, options: AlignOptions) -> bool:
    about = Axes(front="-z")
    if about not in list_axes(["m"], options):
        return False
    turned = _unfitted(cloth, bodies, about, options, "keep")
    return turned[_best(turned)].cost < as_is[_best(as_is)].cost


def _is_settled(cloth: ClothSample, bodies: Bodies, guesses: Guesses, options: AlignOptions) -> bool:
    """True for guesses with usual axes and known origins that no fit will better."""
    gender = _best(guesses)
    best = guesses[gender]
    if axes_prior(best.axes) > 1 or not _hugs(cloth, bodies, guesses, options):
        return False
    return not sits_better_moved(cloth, bodies[gender], best, options)


def _nothing_found(cloth: ClothSample, bodies: Bodies, options: AlignOptions) -> tuple[Guesses, tuple[Diagnostic, ...]]:
    """No unit makes the outfit as large as a part of a body: it stays as it is, with a warning."""
    size = np.ptp(cloth.points, axis=0).max()
    message = f"the outfit is {size:.3g} long, too large or too small for a body in any unit; taken as metres; "
    guesses = _unfitted(cloth, bodies, list_axes(["m"], options)[0], options, "keep")
    return guesses, (Diagnostic("units-unknown", message + "say which with --units"),)


def _doubts(found: list[Guess]) -> tuple[Diagnostic, ...]:
    """A warning where the second of the guesses `found`, which differ in axes, is nearly as good as the first."""
    best, close = found[0], [other for other in found[1:] if other.cost < UNCERTAIN * found[0].cost]
    if not close:
        return ()
    message = f"taken as {best.axes}; {close[0].axes} fits nearly as well; say which with --units, --up and --front"
    return (Diagnostic("frame-ambiguous", message),)
