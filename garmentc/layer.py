"""An outfit on its way through the pipeline: as read, on its body, and after the passes."""

from __future__ import annotations

from dataclasses import dataclass

from garmentc.families.bundle import Bundle
from garmentc.families.held_cloth import HeldCloth
from garmentc.outfit.align import Alignment
from garmentc.outfit.corners import CornerMesh
from garmentc.outfit.outfit import Outfit
from garmentc.outfit.topology import Welded
from garmentc.passes.report import PassReport
from garmentc.rig import Rig
from garmentc.smpl.motion import Motion
from garmentc.smpl.parameters import Parameters


@dataclass(frozen=True)
class Inputs:
    """What was read before anything is known about the body."""

    outfit: Outfit
    parameters: Parameters
    bundle: Bundle


@dataclass(frozen=True)
class Dressed:
    """The outfit on its body, in the body's axes and T-pose, what holds it there, and the motions of this body."""

    alignment: Alignment
    outfit: Outfit
    welded: Welded
    corners: CornerMesh
    cloth: HeldCloth
    motions: tuple[Motion, ...]


@dataclass(frozen=True)
class Layer:
    """An outfit at the end of the passes, with what it was made from. Several are worn on the same body."""

    source: Inputs
    dressed: Dressed
    rig: Rig
    passes: tuple[PassReport, ...]
