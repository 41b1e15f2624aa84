"""An outfit and its body in many poses at once. Poses come last: what is done for all of them runs along memory."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from garmentc.rig import Rig
from garmentc.smpl.body import BodyModel
from garmentc.smpl.rotations import axis_angle_to_matrix
from garmentc.smpl.skeleton import JOINT_COUNT
from garmentc.smpl.skinning import joint_transforms

_Floats = NDArray[np.float32]

_DAMPING = 0.003
"""Share of a squared length: where skinning leaves less, that is made up for in part only, for what it all but
collapses to a point would have to move too far."""

_MOST_SHRUNK = 0.1
"""Share of a squared length that skinning leaves at least, as far as it is made up for where movements are fitted."""


@dataclass(frozen=True)
class PosedVertices:
    """n vertices in P poses, in any precision.

    vertices  (3, n, P) metres
    turn      (3, 3, n, P) what skinning does to a displacement of the rest vertex: nearly a rotation
    """

    vertices: NDArray[Any]
    turn: NDArray[Any]

    def pose(self, number: int) -> PosedVertices:
        """One of the poses."""
        one = slice(number, number + 1)
        return PosedVertices(np.ascontiguousarray(self.vertices[..., one]), np.ascontiguousarray(self.turn[..., one]))

    def turned(self, moved: NDArray[Any]) -> NDArray[Any]:
        """What skinning makes of displacements `moved` (3, n, P) of the rest vertices."""
        result: NDArray[Any] = np.einsum("ijnp,jnp->inp", self.turn, moved)
        return result

    def turned_back(self, way: NDArray[Any]) -> NDArray[Any]:
        """`way` (3, n, P) turned as the rest vertices are: the transpose of `turned`, which never lengthens."""
        result: NDArray[Any] = np.einsum("ijnp,inp->jnp", self.turn, way)
        return result

    def at_rest(self, way: NDArray[Any]) -> NDArray[Any]:
        """What skinning makes `way` (3, n, P) of: the inverse of `turned`, damped (Levenberg 1944).

        Skinning turns, and shrinks where joints' rotations are mixed, in some directions more than in others.
        """
        (xx, xy, xz), (_, yy, yz), (_, _, zz) = np.einsum("kinp,kjnp->ijnp", self.turn, self.turn)
        xx, yy, zz = xx + _DAMPING, yy + _DAMPING, zz + _DAMPING
        # The inverse of that symmetric matrix: its cofactors over its determinant.
        a, b, c = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        x, y, z = self.turned_back(way)
        result: NDArray[Any] = np.stack(
            [
                a * x + b * y + c * z,
                b * x + (xx * zz - xz * xz) * y + (xy * xz - xx * yz) * z,
                c * x + (xy * xz - xx * yz) * y + (xx * yy - xy * xy) * z,
            ]
        )
        result *= (1 + _DAMPING) / (xx * a + xy * b + xz * c)
        return result

    def nearly_at_rest(self, way: NDArray[Any]) -> NDArray[Any]:
        """What skinning makes `way` (3, n, P) of, nearly: it turns, and shrinks where joints' rotations are mixed.

        The exact way, `at_rest`, lets what is regressed on keys grow where skinning all but collapses.
        """
        result = self.turned_back(way)
        result /= self._shrunk
        return result

    @cached_property
    def _shrunk(self) -> NDArray[Any]:
        """(n, P) the square of what skinning leaves of a length, the mean over all directions."""
        mean = np.einsum("ijnp,ijnp->np", self.turn, self.turn) / self.turn.dtype.type(3)
        shrunk: NDArray[Any] = np.maximum(mean, self.turn.dtype.type(_MOST_SHRUNK))
        return shrunk


def posed_outfit(rig: Rig, poses: NDArray[Any], dtype: type[np.floating[Any]] = np.float32) -> PosedVertices:
    """The rig in `poses` (P, 24, 3), as `rig.posed` makes it."""
    poses = np.asarray(poses, dtype)
    shapes = rig.blend_shapes.reshape(rig.morph_count, 3 * rig.vertex_count).astype(dtype, copy=False)
    moved = (rig.pose_keys(poses) @ shapes).reshape(len(poses), -1, 3)
    rest = np.ascontiguousarray((rig.template.astype(dtype) + moved).transpose(2, 1, 0))
    return _skinned(rest, rig.weights, rig.joints, poses)


def posed_body(body: BodyModel, betas: NDArray[Any] | None, poses: NDArray[Any]) -> _Floats:
    """The vertices (3, V, P) of the body in `poses` (P, 24, 3), as `body.posed` makes them."""
    poses = np.asarray(poses, np.float32)
    rest = np.repeat(body.shaped(betas).T.astype(np.float32)[:, :, None], len(poses), axis=2)
    features = axis_angle_to_matrix(poses) - np.eye(3, dtype=np.float32)
    by_joint = features.reshape(len(poses), JOINT_COUNT, 9).transpose(1, 2, 0)[1:]
    correctives = body.correctives
    for feature, moved, block in zip(by_joint, correctives.vertices, correctives.directions, strict=True):
        rest[:, moved] += block.transpose(2, 1, 0).astype(np.float32) @ feature
    return _skinned(rest, body.weights, body.joints(betas), poses).vertices


def _skinned(rest: NDArray[Any], weights: NDArray[Any], joints: NDArray[Any], poses: NDArray[Any]) -> PosedVertices:
    """Linear blend skinning of rest vertices (3, n, P), each with its pose, in the poses' precision."""
    transforms = joint_transforms(axis_angle_to_matrix(poses), joints.astype(poses.dtype))
    blended = weights.astype(poses.dtype) @ np.ascontiguousarray(transforms.transpose(2, 3, 1, 0)[:3])
    turn = blended[:, :3]
    return PosedVertices(np.einsum("ijnp,jnp->inp", turn, rest) + blended[:, 3], turn)
