"""Some vertices of an outfit with all that makes them settle: springs between them, and the skin beneath."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import CLEARANCE, REACH, Planes, wanted_clearance
from garmentc.passes.bulging import Bulging
from garmentc.passes.cloth_dynamics import ClothDynamics, MovingCloth, SkinPath, advanced
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.overlaps import Overlaps
from garmentc.passes.part_of_rig import take_vertices
from garmentc.passes.pieces import Pieces, sewn_on
from garmentc.passes.pose_set import farthest_apart
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_skinning import PosedVertices, posed_outfit
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel

_SEARCHED = 24
"""Poses in which all of the skin is searched for what is nearest to a vertex."""

BULGE = 0.005
"""Metres: between the vertices of coarse cloth the skin of a round limb rises. Cloth keeps that distance too, but at
most this much."""


@dataclass(frozen=True)
class AnchoredCloth:
    """n anchors of an outfit.

    anchors   which vertices they are
    part      the rig of those alone
    pieces    what of them hangs together
    overlaps  what lies over what
    wanted    (n,) float32 metres that they should keep from the skin beyond what that bulges out
    """

    anchors: Anchors
    part: Rig
    pieces: Pieces
    overlaps: Overlaps
    springs: Springs
    bulging: Bulging
    skin: NearbySkin
    wanted: NDArray[np.float32]

    @classmethod
    def of(
        cls,
        rig: Rig,
        anchors: Anchors,
        body: BodyModel,
        betas: NDArray[Any] | None,
        poses: NDArray[Any],
        *,
        clearance: float = CLEARANCE,
        bulge: float = BULGE,
    ) -> AnchoredCloth:
        """The `anchors` of `rig` on its body.

        poses      (P, 24, 3) what it will be in
        clearance  metres that loose cloth should keep beyond what all cloth should; where less is there at rest, less
        bulge      metres that it keeps at most for skin that bulges out between vertices
        """
        joined, part = edges(rig.triangles), take_vertices(rig, anchors.rows)
        pairs, pieces = sewn_on(part.template, anchors.joined(joined))
        springs = Springs.of(part.template, pairs)
        return cls(
            anchors,
            part,
            pieces,
            Overlaps.of(part.template, anchors.normals, pairs, pieces, body.shaped(betas), body.faces),
            springs,
            Bulging.of(rig.template, joined, anchors.rows, springs, bulge),
            NearbySkin.of(part, anchors.normals, body, betas, farthest_apart(poses, _SEARCHED)),
            wanted_clearance(part, body, betas, clearance),
        )

    def touching(self, posed: PosedVertices, planes: Planes) -> PosedCloth:
        """The anchors where they are in the P poses of the skin's `planes`, with what they touch there."""
        clearance, normals = self.skin.contacts(posed, planes)
        least = self.bulging.height(posed.vertices, normals)
        least += self.wanted[:, None]
        least -= clearance
        least += np.einsum("inp,inp->np", normals, posed.vertices)
        return PosedCloth(posed, normals, least)

    def path(self, vertices: NDArray[np.float32], before: Planes, after: Planes) -> SkinPath:
        """The skin that anchors at `vertices` (3, n, P) are near, while it goes from the planes `before` to `after`."""
        normals, start, end = self.skin.path(vertices, before, after)
        height = self.bulging.height(vertices, normals)
        height += self.wanted[:, None]
        low, high = (height + np.einsum("inp,inp->np", normals, centers) for centers in (start, end))
        return SkinPath(normals, low, high, end - start)

    def borne(self, vertices: NDArray[np.float32], skin: SkinPath, firmness: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether the skin bears or holds anything of the piece that each anchor at `vertices` belongs to, (n, P).

        firmness  (n,) how much it holds each
        """
        away = np.einsum("inp,inp->np", skin.normals, vertices) - skin.before
        touching = skin.normals.any(axis=0) & (away < REACH)
        return self.pieces.any(touching | (firmness[:, None] > 0))

    def fallen(
        self, poses: NDArray[Any], firmness: NDArray[Any], dynamics: ClothDynamics, rounds: int, touching: int
    ) -> NDArray[np.float32]:
        """Where the cloth has fallen to (3, n, P), from where the rig has it in `poses` (P, 24, 3), the body still.

        rounds, touching  how many rounds, and how often meanwhile it is asked what the cloth touches
        """
        start, planes = posed_outfit(self.part, poses), self.skin.planes(poses)
        cloth = MovingCloth(start.vertices, np.zeros_like(start.vertices))
        held = firmness.astype(np.float32), start.vertices, start.vertices
        still = np.zeros_like(start.vertices)
        for some in filter(None, np.diff(np.linspace(0, rounds, touching + 1).astype(int)).tolist()):
            contact = self.touching(PosedVertices(cloth.vertices, start.turn), planes)
            skin = SkinPath(contact.normals, contact.least, contact.least, still)
            time = some * dynamics.round_time(self.springs)
            borne = self.borne(cloth.vertices, skin, firmness)
            cloth = advanced(cloth, self.springs, self.overlaps, skin, held, borne, dynamics, time, some)
        return cloth.vertices
