"""An outfit in several poses, and how it should move there: off the skin, and back to its edges' lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.compiled import compiled
from garmentc.passes.posed_skinning import PosedVertices
from garmentc.passes.springs import Springs, pulled_along

_Floats = NDArray[np.float32]


@dataclass(frozen=True)
class PosedCloth:
    """n vertices in P poses, float32, with the planes that they should stay outside of.

    posed    the vertices, and how they are turned
    normals  (3, n, P) unit normals of the skin where there is a contact, 0 where there is none
    least    (n, P) how far along them each vertex should be, at least: metres from the origin
    """

    posed: PosedVertices
    normals: _Floats
    least: _Floats

    def way(self, moved: _Floats, springs: Springs, rounds: int, relaxation: float, momentum: float) -> _Floats:
        """How far cloth with the rest-space displacements `moved` settles, (3, n, P), in rest space too."""
        start = self.posed.vertices + self.posed.turned(moved)
        if not rounds:  # only out of the skin
            return self.posed.nearly_at_rest(self.way_out(start))
        return self.posed.nearly_at_rest(self.settled(start, springs, rounds, relaxation, momentum) - start)

    def settled(
        self,
        start: _Floats,
        springs: Springs,
        rounds: int,
        relaxation: float | _Floats,
        momentum: float,
    ) -> _Floats:
        """Where vertices at `start` (3, n, P) come to in so many rounds.

        A round goes towards unstretched springs, a share `relaxation` of the way that would be right for an edge alone
        (one of all, or (n,)), and from there out to where it should be; it begins a share `momentum` of the last
        round's way ahead.
        """
        share = np.broadcast_to(np.asarray(relaxation, np.float32), (start.shape[1],)).copy()
        before, now, ahead = start.copy(), start.copy(), np.empty_like(start)
        for _ in range(rounds):
            _coast(now, before, np.float32(momentum), ahead)
            # What was before is not needed any more.
            pulled_along(ahead, springs.begins, springs.others, springs.apart, share, before)
            _push_out(before, self.normals, self.least)
            before, now = now, before
        return now

    def way_out(self, vertices: _Floats) -> _Floats:
        """The step (3, n, P) of those of the vertices (3, n, P) that are too close to the skin."""
        lacking = self.least - np.einsum("inp,inp->np", self.normals, vertices)
        np.maximum(lacking, 0, out=lacking)
        way: _Floats = self.normals * lacking
        return way


@compiled
def _coast(now: _Floats, before: _Floats, momentum: np.float32, ahead: _Floats) -> None:
    """Fill `ahead` (3, n, P) with where vertices `now` go with a share of their way from `before`."""
    _, count, poses = now.shape
    for axis in range(3):
        for i in range(count):
            for p in range(poses):
                ahead[axis, i, p] = now[axis, i, p] + momentum * (now[axis, i, p] - before[axis, i, p])


@compiled
def _push_out(vertices: _Floats, normals: _Floats, least: _Floats) -> None:
    """Bring `vertices` (3, n, P) as far along their normals as they should be, at least."""
    _, count, poses = vertices.shape
    for i in range(count):
        for p in range(poses):
            u, v, w = normals[0, i, p], normals[1, i, p], normals[2, i, p]
            there = u * vertices[0, i, p] + v * vertices[1, i, p] + w * vertices[2, i, p]
            way = max(least[i, p] - there, np.float32(0))
            vertices[0, i, p] += u * way
            vertices[1, i, p] += v * way
            vertices[2, i, p] += w * way
