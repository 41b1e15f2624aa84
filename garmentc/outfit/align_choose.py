"""The choice among guesses: as the file is, if it fits so; otherwise searched and fitted, on every body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from garmentc.errors import Diagnostic
from garmentc.outfit.align_axes import UNIT_NAMES, axis_pairs
from garmentc.outfit.align_fit import ClothSample, misfit
from garmentc.outfit.align_options import AlignOptions
from garmentc.outfit.align_origin import BODY, FITTED, known_origins
from garmentc.outfit.align_pose import (
    ALL_TURNS,
    TURNS,
    RestBody,
    Stance,
    a_pose,
    fit_stance,
    largest_turn,
    wrapped_turns,
)
from garmentc.outfit.align_search import Guess, guess, known_stances, search_frames, turned_cloth

UNCERTAIN = 1.15
"""Guesses whose costs differ by less than this factor are reported as ambiguous."""

NEUTRAL = 1.05
"""The neutral body is taken where no other fits better by more than this factor."""

NEARLY_STRAIGHT = np.radians(1)
"""A fitted pose in which no joint turns further is the T-pose."""

NEARBY = 0.05
"""Metres between a fitted origin and a known one that it may stand for."""

THIN = 3
"""Poses are fitted to every third vertex of the body."""

FINALISTS = 4
"""Frames that are looked at closely."""

HOPELESS = 3.0
"""How much worse than the best frame one may look roughly, as a factor, to be looked at closely."""

ARMS_DOWN = np.array([0.8 if name == "shoulder down" else 0.0 for name in TURNS])
"""A second start for the fit of A-poses, from which arms close to the sides are found."""

AS_BODY = ("m", "y", "z")


Frames = tuple[str, str, str]
"""Unit, up axis, front axis."""


def choose_guesses(
    cloth: ClothSample, bodies: Mapping[str, RestBody], options: AlignOptions
) -> tuple[dict[str, Guess], tuple[Diagnostic, ...]]:
    """The best guess for each of `bodies`, and what was doubtful about unit and axes.

    Cloth that hugs a body in the file's own coordinates needs no search: the common case, and the quick one.
    Cloth that is worn, but loosely or in another pose, keeps unit and axes. For anything else all are tried, first
    with the origins that files usually have, then with origin and pose fitted.
    """
    if _allows(options, *AS_BODY):
        as_is = _known(cloth, bodies, AS_BODY, options, "keep")
        if _hugs(cloth, bodies, as_is, options):
            return as_is, ()
        if _touches(cloth, bodies, as_is) and not _fits_turned_about(cloth, bodies, as_is, options):
            best = _best(as_is)
            fitted = _fitted(cloth, bodies[best], as_is[best], options)
            if fitted.stance.origin == BODY and not fitted.stance.angles.any():
                return as_is, ()
            return {gender: _fitted(cloth, body, fitted, options) for gender, body in bodies.items()}, ()

    reference = bodies.get("neutral", next(iter(bodies.values())))
    rough = search_frames(cloth, reference.thinned(THIN).skin(options.given_pose), options)
    if not rough:
        return _nothing_found(cloth, bodies, options)
    rough = [start for start in rough[:FINALISTS] if start.cost < HOPELESS * rough[0].cost]
    known = [_known(cloth, bodies, (start.unit, start.up, start.front), options, options.origin) for start in rough]
    known.sort(key=lambda guesses: guesses[_best(guesses)].cost)
    if _hugs(cloth, bodies, known[0], options) and not _sits_better_moved(cloth, bodies, known[0], options):
        return known[0], _doubts([guesses[_best(guesses)] for guesses in known])
    found = sorted((_fitted(cloth, reference, start, options) for start in rough), key=lambda guess: guess.cost)
    return {gender: _fitted(cloth, body, found[0], options) for gender, body in bodies.items()}, _doubts(found)


def _allows(options: AlignOptions, *frame: str) -> bool:
    asked = (options.units, options.up, options.front)
    return all(value in ("auto", usual) for value, usual in zip(asked, frame, strict=True))


def _best(guesses: Mapping[str, Guess]) -> str:
    return min(guesses, key=lambda gender: guesses[gender].cost)


def _known(
    cloth: ClothSample, bodies: Mapping[str, RestBody], frame: Frames, options: AlignOptions, origin: str
) -> dict[str, Guess]:
    """For each body the best guess with this unit and these axes, a known origin and the pose not fitted."""
    there = turned_cloth(cloth, *frame)
    pose = options.given_pose
    guesses = {}
    for gender, body in bodies.items():
        stances = known_stances(there, body.skin(pose), pose, origin)
        guesses[gender] = min(
            (guess(cloth, *frame, stance) for stance in stances), key=lambda candidate: candidate.cost
        )
    return guesses


def _distance(cloth: ClothSample, bodies: Mapping[str, RestBody], guesses: Mapping[str, Guess]) -> NDArray[np.float64]:
    """Signed distances (S,) of the cloth to the body that it fits best."""
    best = _best(guesses)
    chosen = guesses[best]
    there = turned_cloth(cloth, chosen.unit, chosen.up, chosen.front)
    return bodies[best].skin(chosen.stance.pose).distance(there.points + chosen.stance.translation)


def _hugs(
    cloth: ClothSample, bodies: Mapping[str, RestBody], guesses: Mapping[str, Guess], options: AlignOptions
) -> bool:
    """True for cloth that can't be meant otherwise: close to the skin nearly everywhere."""
    if options.pose == "a":
        return False
    distance = _distance(cloth, bodies, guesses)
    gap = np.abs(distance)
    return bool((distance < -0.01).mean() < 0.02 and np.median(gap) < 0.04 and np.percentile(gap, 97) < 0.08)


def _touches(cloth: ClothSample, bodies: Mapping[str, RestBody], guesses: Mapping[str, Guess]) -> bool:
    """True for cloth that is at least worn, with loose parts or in another pose."""
    distance = _distance(cloth, bodies, guesses)
    return bool((distance < -0.01).mean() < 0.1 and np.median(np.abs(distance)) < 0.05)


def _fits_turned_about(
    cloth: ClothSample, bodies: Mapping[str, RestBody], as_is: Mapping[str, Guess], options: AlignOptions
) -> bool:
    if options.front != "auto":
        return False
    turned = _known(cloth, bodies, ("m", "y", "-z"), options, "keep")
    return turned[_best(turned)].cost < as_is[_best(as_is)].cost


def _sits_better_moved(
    cloth: ClothSample, bodies: Mapping[str, RestBody], guesses: Mapping[str, Guess], options: AlignOptions
) -> bool:
    """True where a known origin is only near the true one, as the floor under soles is."""
    best = _best(guesses)
    known = guesses[best]
    if options.origin != "auto" or known.stance.origin == BODY:
        return False
    there = turned_cloth(cloth, known.unit, known.up, known.front)
    moved = fit_stance(there, bodies[best].thinned(THIN), replace(known.stance, origin=FITTED))
    return guess(cloth, known.unit, known.up, known.front, _rescored(there, bodies[best], moved)).cost < known.cost


def _fitted(cloth: ClothSample, body: RestBody, start: Guess, options: AlignOptions) -> Guess:
    """The best guess for `body` with the unit and axes of `start`: T-pose or A-pose, origin known or fitted.

    The fits begin at the stance of `start`, which may have been found for another body.
    """
    there = turned_cloth(cloth, start.unit, start.up, start.front)
    thin = body.thinned(THIN)
    pose = options.given_pose
    origin = FITTED if options.origin == "auto" else BODY
    straight = fit_stance(there, thin, Stance(pose, origin, start.stance.translation))
    stances = [] if options.pose == "a" else [straight, *known_stances(there, body.skin(pose), pose, options.origin)]
    if options.fits_pose:
        turned = _turned(there, thin, straight, start.stance)
        if options.pose == "a" or largest_turn(turned.angles) > NEARLY_STRAIGHT:
            stances += _with_known_origins(there, thin, turned)
    guesses = [guess(cloth, start.unit, start.up, start.front, _rescored(there, body, stance)) for stance in stances]
    return min(guesses, key=lambda candidate: candidate.cost)


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
    """`fitted`, and the same with the known origins close to its own."""
    if fitted.origin != FITTED:
        return [fitted]
    near = [
        name
        for name, translation in known_origins(body.skin(fitted.pose)).items()
        if np.linalg.norm(translation - fitted.translation) < NEARBY
    ]
    turns = fitted.angles != 0
    return [fitted, *(fit_stance(cloth, body, replace(fitted, origin=name), turns) for name in near)]


def _rescored(cloth: ClothSample, body: RestBody, stance: Stance) -> Stance:
    """`stance` with its misfit on all of `cloth`; fitted translations are rounded to a tenth of a millimetre."""
    surface = body.skin(stance.pose)
    translation = np.round(stance.translation, 4) if stance.origin == FITTED else stance.translation
    score = float(misfit(surface.distance(cloth.points + translation)))
    return replace(stance, translation=translation, misfit=score)


def _nothing_found(
    cloth: ClothSample, bodies: Mapping[str, RestBody], options: AlignOptions
) -> tuple[dict[str, Guess], tuple[Diagnostic, ...]]:
    """No unit makes the outfit as large as a part of a body: it stays as it is, with a warning."""
    size = np.ptp(cloth.points, axis=0).max()
    message = (
        f"the outfit is {size:.3g} long, too large or too small for a body in any unit; taken as metres; give units"
    )
    guesses = _known(cloth, bodies, ("m", *next(axis_pairs(options.up, options.front))), options, "keep")
    return guesses, (Diagnostic("units-unknown", message),)


def _doubts(found: list[Guess]) -> tuple[Diagnostic, ...]:
    best, others = found[0], found[1:]
    close = [other for other in others if other.cost < UNCERTAIN * best.cost]
    if not close:
        return ()
    other = close[0]
    taken, also = (f"{UNIT_NAMES[g.unit]}, {g.up.upper()} up, facing {g.front.upper()}" for g in (best, other))
    message = f"taken as {taken}; {also} fits nearly as well; say which with units, up and front"
    return (Diagnostic("frame-ambiguous", message),)


def choose_gender(guesses: Mapping[str, Guess]) -> tuple[str, tuple[Diagnostic, ...]]:
    """The gender that fits best, neutral where that is as good; and a warning where another fits nearly as well."""
    best = min(guesses, key=lambda gender: guesses[gender].cost / (NEUTRAL if gender == "neutral" else 1))
    close = [g for g in guesses if g != best and guesses[g].cost < UNCERTAIN * guesses[best].cost]
    if not close:
        return best, ()
    scores = ", ".join(f"{gender} {guesses[gender].stance.misfit * 1000:.1f} mm" for gender in (best, *close))
    message = f"fitted to the {best} body, but the bodies differ little here ({scores}); say which with gender"
    return best, (Diagnostic("gender-ambiguous", message),)
