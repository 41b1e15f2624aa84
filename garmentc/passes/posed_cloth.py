"""An outfit in several poses, and how it should move there: off the skin, and back to its edges' lengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.bulging import Bulging
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.posed_skinning import PosedVertices, posed_outfit
from garmentc.passes.springs import Springs
from garmentc.rig import Rig

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

    @classmethod
    def of(
        cls, rig: Rig, poses: NDArray[Any], skin: NearbySkin, wanted: NDArray[np.float32], bulging: Bulging
    ) -> PosedCloth:
        """The rig in `poses` (P, 24, 3), with `wanted` clearances (n,) from the skin beyond what that bulges out."""
        posed = posed_outfit(rig, poses)
        clearance, normals = skin.contacts(posed, poses)
        least = bulging.height(posed.vertices, normals)
        least += wanted[:, None]
        least -= clearance
        least += np.einsum("inp,inp->np", normals, posed.vertices)
        return cls(posed, normals, least)

    def way(
        self, moved: NDArray[np.float32], springs: Springs, rounds: int, relaxation: float, momentum: float
    ) -> NDArray[np.float32]:
        """How far cloth with the rest-space displacements `moved` goes in so many rounds, (3, n, P), in rest space too.

        A round goes towards unstretched springs, a share `relaxation` of the way that would be right for an edge alone,
        and from there out to where it should be; it begins a share `momentum` of the last round's way ahead. No round
        only goes out to where it should be.
        """
        start = np.einsum("ijnp,jnp->inp", self.posed.turn, moved)
        start += self.posed.vertices
        if not rounds:
            return self._at_rest(self._way_out(start))
        before = now = start
        for _ in range(rounds):
            ahead = now - before
            ahead *= np.float32(momentum)
            ahead += now
            pull = springs.pull(ahead)
            pull *= np.float32(relaxation)
            ahead += pull
            ahead += self._way_out(ahead)
            before, now = now, ahead
        return self._at_rest(now - start)

    def _way_out(self, vertices: NDArray[np.float32]) -> NDArray[np.float32]:
        """The step (3, n, P) of those of the vertices (3, n, P) that are too close to the skin."""
        lacking = self.least - np.einsum("inp,inp->np", self.normals, vertices)
        np.maximum(lacking, 0, out=lacking)
        way: NDArray[np.float32] = self.normals * lacking
        return way

    def _at_rest(self, way: NDArray[np.float32]) -> NDArray[np.float32]:
        """What skinning makes `way` (3, n, P) of, nearly: it turns, and shrinks where joints' rotations are mixed."""
        turn = self.posed.turn
        result: NDArray[np.float32] = np.einsum("ijnp,inp->jnp", turn, way)
        result /= np.maximum(np.einsum("ijnp,ijnp->np", turn, turn) / np.float32(3), np.float32(_MOST_SHRUNK))
        return result
