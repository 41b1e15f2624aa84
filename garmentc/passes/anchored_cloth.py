"""Some vertices of an outfit with all that makes them settle: springs between them, and the skin beneath."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.outfit.topology import edges
from garmentc.passes.anchors import Anchors
from garmentc.passes.body_contacts import Planes, wanted_clearance
from garmentc.passes.bulging import Bulging
from garmentc.passes.nearby_skin import NearbySkin
from garmentc.passes.part_of_rig import take_vertices
from garmentc.passes.posed_cloth import PosedCloth
from garmentc.passes.posed_skinning import PosedVertices
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel


@dataclass(frozen=True)
class AnchoredCloth:
    """n anchors of an outfit.

    part    the rig of the anchors alone
    wanted  (n,) float32 metres that they should keep from the skin beyond what that bulges out
    """

    part: Rig
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
        *,
        searched: NDArray[Any],
        clearance: float,
        bulge: float,
    ) -> AnchoredCloth:
        """The `anchors` of `rig` on its body.

        searched   (P, 24, 3) poses in which all of the skin is searched for what is nearest to a vertex
        clearance  metres, see `wanted_clearance`
        bulge      metres, see `Bulging`
        """
        joined, part = edges(rig.triangles), take_vertices(rig, anchors.rows)
        springs = Springs.of(part.template, anchors.joined(joined))
        return cls(
            part,
            springs,
            Bulging.of(rig.template, joined, anchors.rows, springs, bulge),
            NearbySkin.of(part, anchors.normals, body, betas, searched),
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
