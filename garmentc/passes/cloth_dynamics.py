"""Cloth as a body: it has inertia and weight, its edges hold it together, and the skin stops it and drags it along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.compiled import compiled
from garmentc.passes.overlaps import Overlaps, lift
from garmentc.passes.springs import Springs, pulled_along, smoothed

_Floats = NDArray[np.float32]

_GRAVITY = 9.81
"""Metres a second squared, down along Y."""

_STIFFEST = 1.2
"""Share of the step that would be right for an edge alone: with 4/3 the fastest waves of a lace would grow."""


@dataclass(frozen=True)
class ClothDynamics:
    """What all cloth is made of, and how it is simulated.

    wave_speed  m/s: how fast stretch travels, the root of stiffness over weight. Simulated fabrics have 25 m/s too (see
                simulation settings); cloth of any weight hangs alike then, a metre stretched by less than two per cent
    friction    Coulomb coefficient against the skin
    damping     seconds in which velocities fall to 1/e, as the air sees them, which goes with the body
    smoothing   how far velocities are brought to those of the vertices around in each round: where skin moves, contacts
                make cloth tremble without it, and what trembles slides
    most        rounds a second: edges so short that they would need more get softer
    """

    wave_speed: float = 25.0
    friction: float = 0.5
    damping: float = 0.14
    smoothing: float = 0.3
    most: float = 3600.0

    def round_time(self, springs: Springs) -> float:
        """Seconds of a round in which a wave gets as far as a round can take it: about a third of an edge."""
        return float(springs.lengths.mean()) * float(np.sqrt(_STIFFEST / 12)) / self.wave_speed

    def rounds(self, springs: Springs, seconds: float) -> int:
        """How many rounds a stretch of time takes, at least one."""
        wanted = seconds / max(self.round_time(springs), 1 / self.most)
        return max(1, int(np.ceil(wanted - 1e-6)))


@dataclass(frozen=True)
class SkinPath:
    """The planes of skin that n vertices in P poses touch, over a stretch of time.

    normals  (3, n, P) unit normals, 0 where there is none
    before, after   (n, P) metres along them, from the origin, that each vertex should be at the start and end, at least
    slid     (3, n, P) metres that the skin moves meanwhile
    """

    normals: _Floats
    before: _Floats
    after: _Floats
    slid: _Floats


@dataclass(frozen=True)
class MovingCloth:
    """n vertices in P poses, (3, n, P) metres, and how far they went in the last round."""

    vertices: _Floats
    step: _Floats


def advanced(
    cloth: MovingCloth,
    springs: Springs,
    overlaps: Overlaps,
    skin: SkinPath,
    held: tuple[_Floats, _Floats, _Floats],
    borne: NDArray[np.bool_],
    dynamics: ClothDynamics,
    seconds: float,
    rounds: int,
    drift: NDArray[Any] | None = None,
) -> MovingCloth:
    """The cloth some time later, in `rounds` equal steps of position-based dynamics, one iteration each.

    overlaps  what lies over what: it stays there, along the normal of the skin below, and does not press on it
    held      how firmly the skin holds each vertex, (n,) from 0 to 1, and where at the start and end, (3, n, P)
    borne     (n, P) whether anything bears the weight of what a vertex belongs to; what nothing bears does not fall
    drift     (3, P) metres that the air goes meanwhile, with the body; velocities are damped to its own. None: none

    Many small steps converge faster than many iterations of a long one (Macklin et al. 2019, "Small steps in physics
    simulation"): what a step leaves undone is in the velocities of the next. Averaged over a vertex's edges, a round
    moves it as a spring of stiffness m r / 12 h^2 would, for a share r of the way and a round's time h; so waves cross
    a mesh of edges a with a (r / 12)^(1/2) / h, whatever it is made of.
    """
    time = seconds / rounds
    way = min(_STIFFEST, 12 * (dynamics.wave_speed * time / springs.lengths.mean()) ** 2)
    stiffness = np.full(len(cloth.vertices[0]), way, np.float32)
    fall = np.float32(_GRAVITY * time**2) * borne.astype(np.float32)
    kept, smoothing = np.float32(np.exp(-time / dynamics.damping)), np.float32(dynamics.smoothing)
    friction, wind = np.float32(dynamics.friction), np.zeros((3, cloth.vertices.shape[2]), np.float32)
    if drift is not None:
        wind += (1 - kept) / rounds * drift
    normals, before, after = map(np.ascontiguousarray, (skin.normals, skin.before, skin.after))
    slid = skin.slid / np.float32(rounds)
    firm = np.flatnonzero(held[0])
    begin, end = (np.take(place, firm, axis=1) for place in held[1:])
    firmness, lacking = held[0][firm], np.empty((len(overlaps.over), cloth.vertices.shape[2]), np.float32)
    now, step = np.array(cloth.vertices), np.array(cloth.step)
    ahead, there, pressed = np.empty_like(now), np.empty_like(now), np.empty_like(now[0])
    for number in range(1, rounds + 1):
        share = np.float32(number / rounds)
        _coast(now, step, fall, ahead)
        pulled_along(ahead, springs.begins, springs.others, springs.apart, stiffness, there)
        _stop(there, now, normals, before, after, slid, share, friction, pressed)
        lift(there, normals, overlaps.over, overlaps.beneath, overlaps.gaps, lacking)
        _hold(there, firm, firmness, begin, end, share)
        _go(now, there, normals, slid, pressed, step)
        if smoothing > 0:
            smoothed(step, springs.begins, springs.others, smoothing, ahead)
            step, ahead = ahead, step
        _damp(step, kept, wind)
        now, there = there, now
    return MovingCloth(now, step)


@compiled
def _coast(now: _Floats, step: _Floats, fall: _Floats, ahead: _Floats) -> None:
    """Fill `ahead` (3, n, P) with where vertices `now` go with their last `step`, and `fall` (n, P) metres down."""
    _, count, poses = now.shape
    for axis in range(3):
        for i in range(count):
            for p in range(poses):
                ahead[axis, i, p] = now[axis, i, p] + step[axis, i, p]
    for i in range(count):
        for p in range(poses):
            ahead[1, i, p] -= fall[i, p]


@compiled
def _stop(
    there: _Floats,
    now: _Floats,
    normals: _Floats,
    before: _Floats,
    after: _Floats,
    slid: _Floats,
    share: np.float32,
    friction: np.float32,
    pressed: _Floats,
) -> None:
    """Push vertices `there` (3, n, P) that come from `now` out of the skin, which drags them along (Coulomb friction).

    The skin is a `share` of its way from `before` to `after`, and goes `slid` in a round. Fill `pressed` (n, P) with
    how far vertices were in it.
    """
    _, count, poses = there.shape
    none, one, tiny = np.float32(0), np.float32(1), np.float32(1e-30)
    x, y, z = there[0], there[1], there[2]
    right, up, front = normals[0], normals[1], normals[2]
    for i in range(count):
        for p in range(poses):
            u, v, w = right[i, p], up[i, p], front[i, p]
            least = before[i, p] + share * (after[i, p] - before[i, p])
            lacking = least - (u * x[i, p] + v * y[i, p] + w * z[i, p])
            press = max(lacking, none) if u != 0 or v != 0 or w != 0 else none
            a, b, c = x[i, p] + u * press, y[i, p] + v * press, z[i, p] + w * press
            sx = a - now[0, i, p] - slid[0, i, p]
            sy = b - now[1, i, p] - slid[1, i, p]
            sz = c - now[2, i, p] - slid[2, i, p]
            out = u * sx + v * sy + w * sz
            sx, sy, sz = sx - u * out, sy - v * out, sz - w * out
            rubs = min(one, friction * press / max(np.sqrt(sx * sx + sy * sy + sz * sz), tiny))
            x[i, p], y[i, p], z[i, p] = a - rubs * sx, b - rubs * sy, c - rubs * sz
            pressed[i, p] = press


@compiled
def _hold(
    there: _Floats, firm: NDArray[np.intp], firmness: _Floats, begin: _Floats, end: _Floats, share: np.float32
) -> None:
    """Bring vertices `firm` (F,) of `there` (3, n, P) to where they are held, as far as their `firmness` (F,) goes: a
    `share` of the way from `begin` to `end`, (3, F, P)."""
    for axis in range(3):
        for k in range(len(firm)):
            for p in range(there.shape[2]):
                place = begin[axis, k, p] + share * (end[axis, k, p] - begin[axis, k, p])
                there[axis, firm[k], p] += firmness[k] * (place - there[axis, firm[k], p])


@compiled
def _go(now: _Floats, there: _Floats, normals: _Floats, slid: _Floats, pressed: _Floats, step: _Floats) -> None:
    """Fill `step` (3, n, P) with the way from `now` to `there`. Skin pushes, but it does not throw: what was `pressed`
    (n, P) does not go out faster than skin that goes `slid`."""
    _, count, poses = now.shape
    none = np.float32(0)
    for i in range(count):
        for p in range(poses):
            u, v, w = normals[0, i, p], normals[1, i, p], normals[2, i, p]
            sx = there[0, i, p] - now[0, i, p]
            sy = there[1, i, p] - now[1, i, p]
            sz = there[2, i, p] - now[2, i, p]
            out = u * (sx - slid[0, i, p]) + v * (sy - slid[1, i, p]) + w * (sz - slid[2, i, p])
            out = max(out, none) if pressed[i, p] > 0 else none
            step[0, i, p], step[1, i, p], step[2, i, p] = sx - u * out, sy - v * out, sz - w * out


@compiled
def _damp(step: _Floats, kept: np.float32, wind: _Floats) -> None:
    """Damp `step` (3, n, P) to what is `kept` of it, and `wind` (3, P)."""
    _, count, poses = step.shape
    for axis in range(3):
        for i in range(count):
            for p in range(poses):
                step[axis, i, p] = step[axis, i, p] * kept + wind[axis, p]
