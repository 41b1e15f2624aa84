"""Cloth along motions, frame after frame: it falls where it is coarse, and settles where it is fine."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.anchored_cloth import AnchoredCloth
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import Planes
from garmentc.passes.cloth_dynamics import ClothDynamics, MovingCloth, advanced
from garmentc.passes.posed_skinning import PosedVertices, posed_outfit
from garmentc.passes.stretches import Stretches
from garmentc.rig import Rig
from garmentc.smpl.skeleton import JOINT_COUNT

_Floats = NDArray[np.float32]

_LIES = 0.03
"""Metres: what is as near to the skin at rest lies on it, and what is twice as far hangs."""

_MOST_AT_REST = 6000
"""Rounds: more for edges so short that a second would take more."""


@dataclass(frozen=True)
class Falling:
    """How cloth moves as a body of its own.

    anchors   vertices that do, at most
    apart     metres between them, at least: closer ones would need more rounds to be as stiff
    memory    seconds after which cloth goes back to where the pose alone would have it, to 1/e: what has slid off comes
              back
    stays     metres that cloth sags in a second at rest until it has found its place; what lies on the body and goes
              twice as far is falling off, and something must hold it
    first     rounds of falling at rest, the body still, before anything is shown,
    touching  in which it is asked so often what the cloth touches
    """

    anchors: int = 4000
    apart: float = 0.02
    dynamics: ClothDynamics = field(default_factory=ClothDynamics)
    memory: float = 4.0
    stays: float = 0.05
    first: int = 240
    touching: int = 6


@dataclass(frozen=True)
class Settling:
    """How the cloth between goes back to its lengths and out of the skin, where there is any.

    anchors               vertices that do, at most
    rounds                of that in a frame
    relaxation, momentum  as in `ResolveCollisions`
    smoothing             how far the movement of vertices is brought to that of their neighbours; keeps cloth from
                          crumpling, and makes fewer shapes do
    """

    anchors: int = 10_000
    rounds: int = 10
    relaxation: float = 1.2
    momentum: float = 0.8
    smoothing: float = 0.2


@dataclass(frozen=True)
class AnimatedCloth:
    """n anchors of an outfit, of which some fall and the others go with them.

    falls     those that fall, and how firmly the skin holds them, (m,)
    settles   all n, or None where they are the same
    yielding  (n,) 0 where the skin holds the cloth
    carried   sparse (n, m) what takes movements of those that fall to all
    """

    falls: AnchoredCloth
    firmness: _Floats
    settles: AnchoredCloth | None
    yielding: _Floats
    carried: Any
    falling: Falling
    settling: Settling

    @classmethod
    def of(
        cls,
        rig: Rig,
        anchors: Anchors,
        anchored: Callable[[Anchors], AnchoredCloth],
        firmness: NDArray[Any],
        falling: Falling,
        settling: Settling,
    ) -> AnimatedCloth:
        """The `anchors` of `rig`, made cloth by `anchored`; `firmness` (N,) of all its vertices."""
        from scipy.sparse import vstack

        settles = anchored(anchors)
        closeness = float(settles.springs.lengths.mean()) / falling.apart
        count = min(falling.anchors, round(len(anchors.rows) * min(1.0, closeness**2)))
        yielding = 1 - firmness[anchors.rows]
        if count >= len(anchors.rows):
            return cls(settles, _held(settles, 1 - yielding, falling), None, yielding, None, falling, settling)
        coarse = Anchors.of(rig, max(1, count))
        carried = vstack([block for _, block in coarse.interpolators(rig.vertex_count)], "csr")[anchors.rows]
        falls = anchored(coarse)
        held = _held(falls, firmness[coarse.rows], falling)
        return cls(falls, held, settles, yielding, carried, falling, settling)

    def along(self, stretches: Stretches) -> Iterator[tuple[int, _Floats | None]]:
        """The frames of `stretches`, and where the anchors are there, (3, n, S), without translation; None where that
        does not count."""
        last: _Frame | None = None
        for number, poses in enumerate(stretches.poses):
            posed, skin = posed_outfit(self.falls.part, poses), self.falls.skin.planes(poses)
            if last is None:
                cloth = self._begun(poses, stretches.ahead(number), stretches.fps)
            else:
                gone = stretches.ahead(number - 1)
                cloth = self._advanced(last.seen_from(gone), posed.vertices, skin, gone, 1 / stretches.fps)
            last = _Frame(cloth, posed.vertices, skin)
            counts = stretches.shares[number].any()
            yield number, self._settle(poses, posed, skin, cloth.vertices) if counts else None

    def _begun(self, poses: NDArray[Any], ahead: NDArray[Any], fps: float) -> MovingCloth:
        """The cloth in `poses` (S, 24, 3), with the speed of bodies that go `ahead` (3, S) metres in a frame."""
        falling = self.falling
        start = self.falls.fallen(poses, self.firmness, falling.dynamics, falling.first, falling.touching)
        rounds = falling.dynamics.rounds(self.falls.springs, 1 / fps) if fps else 1
        step = (ahead / rounds).astype(np.float32)
        return MovingCloth(start, np.repeat(step[:, None], start.shape[1], axis=1))

    def _advanced(self, last: _Frame, posed: _Floats, skin: Planes, gone: NDArray[Any], seconds: float) -> MovingCloth:
        """The cloth a frame later: the poses alone would have it at `posed` (3, m, S); bodies have `gone` (3, S)."""
        dynamics, springs = self.falling.dynamics, self.falls.springs
        path = self.falls.path(last.cloth.vertices, last.skin, skin)
        held = self.firmness, last.posed, posed
        borne = self.falls.borne(last.cloth.vertices, path, self.firmness)
        rounds = dynamics.rounds(springs, seconds)
        cloth = advanced(last.cloth, springs, self.falls.overlaps, path, held, borne, dynamics, seconds, rounds, gone)
        forgotten = np.float32(-np.expm1(-seconds / self.falling.memory))
        return MovingCloth(cloth.vertices + forgotten * (posed - cloth.vertices), cloth.step)

    def _settle(self, poses: NDArray[Any], posed: PosedVertices, skin: Planes, fallen: _Floats) -> _Floats:
        """Where all anchors are (3, n, S) in `poses` (S, 24, 3) when those that fall have come to `fallen` (3, m, S).

        posed, skin  of those that fall
        """
        if self.settles is None:
            cloth, vertices = self.falls, fallen.copy()
            contact = cloth.touching(PosedVertices(vertices, posed.turn), skin)
        else:
            cloth, now = self.settles, posed_outfit(self.settles.part, poses)
            moved = posed.at_rest(fallen - posed.vertices)
            way = np.stack([self.carried @ axis for axis in moved]).astype(np.float32)
            vertices = now.vertices + now.turned(way)
            contact = cloth.touching(PosedVertices(vertices, now.turn), cloth.skin.planes(poses))
            relaxation, momentum = self.settling.relaxation * self.yielding, self.settling.momentum
            vertices = contact.settled(vertices, cloth.springs, self.settling.rounds, relaxation, momentum)
            vertices += self.settling.smoothing * cloth.springs.roughness(vertices - now.vertices)
        # The skin that was nearest when the frame began may not be any more.
        vertices += contact.way_out(vertices)
        cloth.overlaps.restore(vertices, contact.normals)
        return vertices


def _held(cloth: AnchoredCloth, firmness: _Floats, falling: Falling) -> _Floats:
    """Firmness (m,), with what something else holds that nobody has told of: buttons, straps, elastic.

    An outfit hangs at rest as its author has it. What lies on the body and falls off it, though it just stands there,
    must be held. What hangs, as the hem of a wide skirt does, may sag as far as it will.
    """
    rest, second = np.zeros((1, JOINT_COUNT, 3)), round(1 / falling.dynamics.round_time(cloth.springs))
    rounds = min(second, _MOST_AT_REST)
    begin, skin = cloth.part.template.T[:, :, None].astype(np.float32), cloth.skin.planes(rest)
    fallen = cloth.fallen(rest, firmness, falling.dynamics, rounds, 30)
    falls_off = np.clip(np.linalg.norm(fallen - begin, axis=0) / falling.stays - 1, 0, 1)
    near = cloth.path(begin, skin, skin)
    away = np.einsum("inp,inp->np", near.normals, begin) - near.before
    lies = near.normals.any(axis=0) * np.clip(2 - away / _LIES, 0, 1)
    held: _Floats = np.maximum(firmness, (lies * falls_off)[:, 0]).astype(np.float32)
    return held


@dataclass(frozen=True)
class _Frame:
    """The cloth of S stretches in a frame, where poses alone would have it (3, m, S), and the skin."""

    cloth: MovingCloth
    posed: _Floats
    skin: Planes

    def seen_from(self, ahead: NDArray[Any]) -> _Frame:
        """The same in the axes of bodies that have gone `ahead` (3, S) metres since."""
        back = -ahead.astype(np.float32)[:, None]
        cloth = MovingCloth(self.cloth.vertices + back, self.cloth.step)
        return _Frame(cloth, self.posed + back, Planes(self.skin.centers + back, self.skin.normals))
