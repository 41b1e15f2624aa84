"""An outfit in several poses, and how it should move there: off the skin, and back to its edges' lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.posed_skinning import PosedVertices
from garmentc.passes.springs import Springs

_MOST_SHRUNK = 0.1
"""Share of a squared length that skinning leaves at least, as far as it is made up for: in cloth that it all but
collapses to a point, no movement at rest is large enough."""


@dataclass(frozen=True)
class PosedCloth:
    """n vertices in P poses, float32, with the planes that they should stay outside of.

    posed    the vertices, and how they are turned
    normals  (3, n, P) unit normals of the skin where there is a contact, 0 where there is none
    least    (n, P) how far along them each vertex should be, at least: metres from the origin
    """

    posed: PosedVertices
    normals: NDArray[np.float32]
    least: NDArray[np.float32]

    def way(
        self, moved: NDArray[np.float32], springs: Springs, rounds: int, relaxation: float, momentum: float
    ) -> NDArray[np.float32]:
        """How far cloth with the rest-space displacements `moved` settles, (3, n, P), in rest space too."""
        start = self.posed.vertices + self.posed.turned(moved)
        if not rounds:  # only out of the skin
            return self.at_rest(self.way_out(start))
        return self.at_rest(self.settled(start, springs, rounds, relaxation, momentum) - start)

    def settled(
        self,
        start: NDArray[np.float32],
        springs: Springs,
        rounds: int,
        relaxation: float | NDArray[np.float32],
        momentum: float,
    ) -> NDArray[np.float32]:
        """Where vertices at `start` (3, n, P) come to in so many rounds.

        A round goes towards unstretched springs, a share `relaxation` of the way that would be right for an edge alone
        (one of all, or (n, 1)), and from there out to where it should be; it begins a share `momentum` of the last
        round's way ahead.
        """
        before = now = start
        for _ in range(rounds):
            ahead = now - before
            ahead *= np.float32(momentum)
            ahead += now
            pull = springs.pull(ahead)
            pull *= np.asarray(relaxation, np.float32)
            ahead += pull
            ahead += self.way_out(ahead)
            before, now = now, ahead
        return now

    def way_out(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """The step (3, n, P) of those of the vertices (3, n, P) that are too close to the skin."""
        lacking = self.least - np.einsum("inp,inp->np", self.normals, vertices)
        np.maximum(lacking, 0, out=lacking)
        way: NDArray[np.float32] = self.normals * lacking
        return way

    def at_rest(self, way: NDArray[np.float32]) -> NDArray[np.float32]:
        """What skinning makes `way` (3, n, P) of, nearly: it turns, and shrinks where joints' rotations are mixed.

        The exact way, `PosedVertices.at_rest`, lets what is regressed on keys grow where skinning all but collapses.
        """
        turn = self.posed.turn
        result: NDArray[np.float32] = self.posed.turned_back(way)
        result /= np.maximum(np.einsum("ijnp,ijnp->np", turn, turn) / np.float32(3), np.float32(_MOST_SHRUNK))
        return result
