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


@dataclass(frozen=True)
class PosedCloth:
    """n vertices in P poses, float32, to first order in displacements of the rest vertices.

    posed      the vertices, and how they are turned
    lacking    (n, P) how far each would have to go out, metres at rest, and
    outwards   (3, n, P) in which direction, a unit vector at rest; 0 where there is no contact
    """

    posed: PosedVertices
    lacking: NDArray[np.float32]
    outwards: NDArray[np.float32]

    @classmethod
    def of(
        cls, rig: Rig, poses: NDArray[Any], skin: NearbySkin, wanted: NDArray[np.float32], bulging: Bulging
    ) -> PosedCloth:
        """The rig in `poses` (P, 24, 3), with `wanted` clearances (n,) from the skin beyond what that bulges out."""
        posed = posed_outfit(rig, poses)
        clearance, normals = skin.contacts(posed, poses)
        lacking = bulging.height(posed.vertices, normals)
        lacking += wanted[:, None]
        lacking -= clearance
        # How clearance changes with a displacement of the rest vertex, to first order.
        gradient = np.einsum("ijnp,inp->jnp", posed.turn, normals)
        size = np.maximum(np.sqrt(np.einsum("inp,inp->np", gradient, gradient)), 1e-3)
        return cls(posed, lacking / size, gradient / size)

    def settled(
        self, moved: NDArray[np.float32], springs: Springs, rounds: int, relaxation: float, momentum: float
    ) -> NDArray[np.float32]:
        """Rest-space displacements (3, n, P) that cloth with the displacements `moved` comes to in so many rounds.

        A round goes towards unstretched springs, a share `relaxation` of the way that would be right for an edge alone,
        and from there out to where it should be; it begins a share `momentum` of the last round's way ahead.
        """
        before = moved
        for _ in range(rounds):
            ahead = moved + np.float32(momentum) * (moved - before)
            vertices = np.einsum("ijnp,jnp->inp", self.posed.turn, ahead)
            vertices += self.posed.vertices
            step = np.einsum("ijnp,inp->jnp", self.posed.turn, springs.pull(vertices))
            step *= relaxation
            ahead += step
            ahead += self.way_out(ahead)
            before, moved = moved, ahead
        return moved

    def way_out(self, moved: NDArray[np.float32]) -> NDArray[np.float32]:
        """The rest-space step (3, n, P), from displacements `moved`, of what is too close to the skin there."""
        lacking = self.lacking - np.einsum("inp,inp->np", self.outwards, moved)
        np.maximum(lacking, 0, out=lacking)
        way: NDArray[np.float32] = self.outwards * lacking
        return way
