"""Where an outfit comes too close to its body in a set of poses."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.passes.pose_blocks import over_blocks
from garmentc.passes.posed_skinning import posed_body, posed_outfit
from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.skeleton import JOINT_COUNT, PARENTS

REACH = 0.015
"""Metres: vertices farther out than this are in no danger."""

DEPTH = 0.03
"""Metres: deeper ones belong to limbs that are stuck in each other, where no movement of cloth helps."""

CLOSEST = 0.001
"""Metres: what even the tightest cloth should keep."""

CLEARANCE = 0.005
"""Metres: what loose cloth should keep beyond that."""

FAR = 1.0
"""Metres: the clearance where there is no skin near to care about."""

POSES_AT_ONCE = 4
"""As many as threads search in all of the skin at a time."""

_SHARED_WEIGHT = 0.2


@dataclass(frozen=True)
class Planes:
    """The planes of F triangles in P poses: `centers` and unit `normals` (3, F, P) float32."""

    centers: NDArray[np.float32]
    normals: NDArray[np.float32]

    @classmethod
    def of(cls, vertices: NDArray[np.float32], faces: NDArray[Any]) -> Planes:
        """Of the triangles `faces` (F, 3) of posed `vertices` (3, V, P)."""
        a, b, c = (np.take(vertices, faces[:, k], axis=1) for k in range(3))
        u, v = b - a, c - a
        normals: NDArray[np.float32] = np.stack(
            [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]
        )
        normals /= np.maximum(np.sqrt(np.einsum("ifp,ifp->fp", normals, normals)), np.finfo(np.float32).tiny)
        return cls((a + b + c) / np.float32(3), normals)

    def pose(self, number: int) -> Planes:
        """Those in one of the poses."""
        one = slice(number, number + 1)
        return Planes(np.ascontiguousarray(self.centers[..., one]), np.ascontiguousarray(self.normals[..., one]))

    def nearest(
        self, points: NDArray[np.float32], reach: float, marks: tuple[NDArray[Any], NDArray[Any]] | None = None
    ) -> NDArray[np.intp]:
        """Rows (n, P) of the centres nearest to `points` (3, n, P); F where there is none within `reach` metres.

        marks  more coordinates in metres, of the points (n, D) and of the centres (F, D), the same in all poses
        """
        from scipy.spatial import cKDTree

        found = np.empty(points.shape[1:], dtype=np.intp)
        for pose in range(points.shape[2]):
            ours, theirs = self.centers[:, :, pose].T, points[:, :, pose].T
            if marks is not None:
                theirs, ours = np.hstack([theirs, marks[0]]), np.hstack([ours, marks[1]])
            found[:, pose] = cKDTree(ours, balanced_tree=False).query(theirs, distance_upper_bound=reach)[1]
        return found

    def offset(self, points: NDArray[np.float32], rows: NDArray[np.intp]) -> tuple[NDArray[Any], NDArray[Any]]:
        """How far outside the planes `rows` (n, P) `points` (3, n, P) are, metres (n, P); and the normals (3, n, P)."""
        place = rows * self.centers.shape[2] + np.arange(self.centers.shape[2])
        centers, normals = (np.take(array.reshape(3, -1), place, axis=1) for array in (self.centers, self.normals))
        return np.einsum("inp,inp->np", normals, points - centers), normals


@dataclass(frozen=True)
class Skin:
    """The triangles of a body that an outfit of N vertices may be in contact with.

    faces    (F, 3) those that hang on the joints of some vertex of the outfit, or on neighbouring ones
    joints   (F, 24) how much each hangs on a joint and its neighbours
    weights  (N, 24) of the outfit
    """

    faces: NDArray[np.int32]
    joints: NDArray[np.float32]
    weights: NDArray[np.float32]

    @classmethod
    def of(cls, body: BodyModel, rig: Rig) -> Skin:
        weights = rig.weights.astype(np.float32)
        near = body.weights.astype(np.float32) @ _neighbouring_joints()
        joints = (near[body.faces[:, 0]] + near[body.faces[:, 1]] + near[body.faces[:, 2]]) / 3
        reachable = joints @ weights.max(axis=0) > _SHARED_WEIGHT
        return cls(body.faces[reachable], joints[reachable], weights)

    def joined(self, vertices: NDArray[Any], faces: NDArray[Any]) -> NDArray[np.bool_]:
        """Whether `vertices` (K,) of the outfit and `faces` (K,) hang on the same or neighbouring joints; (K,)."""
        joined: NDArray[np.bool_] = np.einsum("kj,kj->k", self.weights[vertices], self.joints[faces]) > _SHARED_WEIGHT
        return joined


def find_clearance(
    rig: Rig, body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any], depth: float = DEPTH
) -> NDArray[np.float32]:
    """Clearance (P, N) in metres of the rig from the body in `poses` (P, 24, 3), down to `depth` metres inside.

    It is negative inside, and FAR where there is no contact. The skin is taken as the plane of the triangle whose
    centre is nearest: nine times in ten within 0.3 mm of the exact distance, and ten times as fast. A contact counts
    only where vertex and skin hang on the same or neighbouring joints: a hand on the trousers and an arm pressed to
    the ribs are not the cloth's fault, and cloth blown away from them would look worse.
    """
    skin = Skin.of(body, rig)

    def find(block: NDArray[Any]) -> NDArray[np.float32]:
        points = posed_outfit(rig, block).vertices
        planes = Planes.of(posed_body(body, betas, block), skin.faces)
        rows = planes.nearest(points, 2 * depth)
        found = rows < len(skin.faces)
        distance, _ = planes.offset(points, np.where(found, rows, 0))
        close = found & in_contact(distance, depth)
        vertices, at = np.nonzero(close)
        close[vertices, at] = skin.joined(vertices, rows[vertices, at])
        clearance: NDArray[np.float32] = np.where(close, distance, np.float32(FAR)).T
        return clearance

    return np.concatenate(over_blocks(find, poses, POSES_AT_ONCE))


def in_contact(distance: NDArray[np.float32], depth: float | NDArray[np.float32] = DEPTH) -> NDArray[np.bool_]:
    """Which distances from the skin are close enough to matter, and not deeper than can be mended."""
    return (distance < REACH) & (distance > -depth)


def wanted_clearance(
    rig: Rig, body: BodyModel, betas: NDArray[Any] | None, clearance: float = CLEARANCE
) -> NDArray[np.float32]:
    """Clearance (N,) in metres that vertices should keep in every pose, beyond what the tightest cloth should.

    It is 0 for cloth that lies on the skin at rest, grows with the clearance there, so that layers stay in order, and
    goes to `clearance` where they are loose.
    """
    at_rest = find_clearance(rig, body, betas, np.zeros((1, JOINT_COUNT, 3)))[0]
    wanted: NDArray[np.float32] = -clearance * np.expm1(-np.maximum(at_rest, 0) / clearance)
    return wanted


def _neighbouring_joints() -> NDArray[np.float32]:
    """(24, 24): 1 for joints at most two bones apart."""
    step = np.eye(JOINT_COUNT)
    for joint, parent in enumerate(PARENTS):
        if parent >= 0:
            step[joint, parent] = step[parent, joint] = 1
    return (step @ step > 0).astype(np.float32)
