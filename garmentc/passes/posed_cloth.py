"""An outfit in several poses, and how it should move there: off the skin, and back to its edges' lengths."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.body_contacts import Contacts, rest_vertices
from garmentc.passes.springs import Springs
from garmentc.rig import Rig
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT
from garmentc.smpl.skinning import joint_transforms


@dataclass(frozen=True)
class PosedCloth:
    """n vertices in P poses, float32, to first order in displacements of the rest vertices. Poses come last.

    vertices   (n, 3, P) posed
    turn       (n, 3, 3, P) what skinning does to a displacement: nearly a rotation
    clearance  (n, P) and
    gradient   (n, 3, P) as in Contacts
    """

    vertices: NDArray[np.float32]
    turn: NDArray[np.float32]
    clearance: NDArray[np.float32]
    gradient: NDArray[np.float32]

    @classmethod
    def of(cls, rig: Rig, poses: NDArray[Any], contacts: Contacts) -> PosedCloth:
        """The rig in `poses` (P, 24, 3), where it has `contacts`."""
        poses = np.asarray(poses, np.float32)
        transforms = joint_transforms(axis_angle_to_matrix(poses), rig.joints.astype(np.float32))[:, :, :3]
        by_joint = transforms.transpose(1, 2, 3, 0).reshape(JOINT_COUNT, -1)
        blended = (rig.weights.astype(np.float32) @ by_joint).reshape(-1, 3, 4, len(poses))
        turn = np.ascontiguousarray(blended[:, :, :3])
        rest = rest_vertices(rig, poses).transpose(1, 2, 0)
        vertices = np.einsum("nijp,njp->nip", turn, rest) + blended[:, :, 3]
        gradient = np.ascontiguousarray(contacts.gradient.transpose(1, 2, 0))
        return cls(vertices, turn, np.ascontiguousarray(contacts.clearance.T), gradient)

    def relaxation(
        self, moved: NDArray[np.float32], springs: Springs, share: float, smoothing: float
    ) -> NDArray[np.float32]:
        """Rest-space step (n, 3, P) from displacements `moved` (n, 3, P) towards unstretched springs.

        share      of the way that would be right for an edge alone
        smoothing  share of the way to the mean displacement of the neighbours
        """
        pull = springs.pull(self.vertices + np.einsum("nijp,njp->nip", self.turn, moved))
        step: NDArray[np.float32] = share * np.einsum("nijp,nip->njp", self.turn, pull)
        return step + smoothing * springs.roughness(moved)

    def push(self, moved: NDArray[np.float32], wanted: NDArray[np.float32]) -> NDArray[np.float32]:
        """Rest-space step (n, 3, P) along the skin's normal to the `wanted` clearances (n,), for what is closer."""
        lacking = wanted[:, None] - self.clearance - np.einsum("nip,nip->np", self.gradient, moved)
        length = np.einsum("nip,nip->np", self.gradient, self.gradient)
        step: NDArray[np.float32] = self.gradient * (np.maximum(lacking, 0) / np.maximum(length, 1e-6))[:, None]
        return step
