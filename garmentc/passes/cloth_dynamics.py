"""Cloth as a body: it has inertia and weight, its edges hold it together, and the skin stops it and drags it along."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.overlaps import Overlaps
from garmentc.passes.springs import Springs

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

    normals  (3, n, P) unit normals, 0 where there is no contact
    before, after   (n, P) metres along them, from the origin, that each vertex should be at the start and end, at least
    slid     (3, n, P) metres that the skin moves meanwhile, or None where it stands still
    """

    normals: _Floats
    before: _Floats
    after: _Floats
    slid: _Floats | None = None


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
    held      how firmly the skin holds each vertex, (n, 1) from 0 to 1, and where at the start and end, (3, n, P)
    drift     (3,) metres that the air goes meanwhile, with the body; velocities are damped to its own. None: none
    borne     (n, P) whether anything bears the weight of what a vertex belongs to; what nothing bears does not fall

    Many small steps converge faster than many iterations of a long one (Macklin et al. 2019, "Small steps in physics
    simulation"): what a step leaves undone is in the velocities of the next. Averaged over a vertex's edges, a round
    moves it as a spring of stiffness m r / 12 h^2 would, for a share r of the way and a round's time h; so waves cross
    a mesh of edges a with a (r / 12)^(1/2) / h, whatever it is made of.
    """
    shape = cloth.vertices.shape
    now, step = cloth.vertices.reshape(3, -1), cloth.step.reshape(3, -1)
    time = seconds / rounds
    stiffness = np.float32(min(_STIFFEST, 12 * (dynamics.wave_speed * time / springs.lengths.mean()) ** 2))
    fall = np.float32(_GRAVITY * time**2) * borne.reshape(-1).astype(np.float32)
    kept, smoothing = np.float32(np.exp(-time / dynamics.damping)), np.float32(dynamics.smoothing)
    friction = np.float32(dynamics.friction)
    wind = None if drift is None else ((1 - kept) / rounds * drift[:, None]).astype(np.float32)
    normals = skin.normals.reshape(3, -1)
    nowhere = ~normals.any(axis=0)
    least, rises = skin.before.reshape(-1).copy(), (skin.after - skin.before).reshape(-1) / np.float32(rounds)
    least[nowhere] = -np.inf
    slid = None if skin.slid is None else skin.slid.reshape(3, -1) / np.float32(rounds)
    layers = overlaps.in_poses(shape[2])
    above_skin = np.take(normals, layers.beneath, axis=1)
    firm = np.flatnonzero(np.broadcast_to(held[0], shape[1:]).reshape(-1))
    firmness = np.broadcast_to(held[0], shape[1:]).reshape(-1)[firm]
    place, goes = (np.take(array.reshape(3, -1), firm, axis=1) for array in (held[1], held[2] - held[1]))
    goes /= np.float32(rounds)
    for _ in range(rounds):
        ahead = now + step
        ahead[1] -= fall
        pull = springs.pull(ahead.reshape(shape)).reshape(3, -1)
        pull *= stiffness
        ahead += pull
        if slid is not None:
            least += rises
        lacking = least - np.einsum("ik,ik->k", normals, ahead)
        touching = np.flatnonzero(lacking > 0)
        out, press = np.take(normals, touching, axis=1), lacking[touching]
        drag = 0 if slid is None else np.take(slid, touching, axis=1)
        if len(touching):
            there = np.take(ahead, touching, axis=1) + out * press
            slip = there - np.take(now, touching, axis=1) - drag
            slip -= out * np.einsum("ik,ik->k", out, slip)
            length = np.sqrt(np.einsum("ik,ik->k", slip, slip))
            slip *= np.minimum(1, friction * press / np.maximum(length, np.finfo(np.float32).tiny))
            ahead[:, touching] = there - slip
        if len(layers.over):
            lifted, up = layers.lift(ahead, above_skin)
            ahead[:, lifted] += up
        if len(firm):
            place = place + goes
            ahead[:, firm] += firmness * (place - np.take(ahead, firm, axis=1))
        step = ahead - now
        if len(touching):  # Skin pushes, but it does not throw.
            speed = np.take(step, touching, axis=1)
            speed -= out * np.maximum(np.einsum("ik,ik->k", out, speed - drag), 0)
            step[:, touching] = speed
        if smoothing:
            rough = springs.roughness(step.reshape(shape)).reshape(3, -1)
            rough *= smoothing
            step += rough
        step *= kept
        if wind is not None:
            step += wind
        now = ahead
    return MovingCloth(now.reshape(shape), step.reshape(shape))
